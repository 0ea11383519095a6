"""Surface syntax -> the mathematics tree, in the notation people write by hand.

Brackets follow the precedences of the operator table; functions and distributions follow its templates. Where hand
writing has an idiom of its own (a sum over a slice, a set-builder, an indicator), `printers.idioms` knows it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import assert_never

from taskspec.lang import syntax as s
from taskspec.lang.dists import DIST_NAMES
from taskspec.lang.functions import FUNCTIONS, INFIX
from taskspec.printers import idioms, piecewise
from taskspec.printers import tree as m
from taskspec.printers.pieces import (
    ATOM,
    POWER,
    PRODUCT,
    RELATION,
    SIGN,
    SUM,
    Piece,
    exposed,
    fill,
    indicator,
    is_infix,
    multiply,
    parsed,
    prime,
)  # fmt: skip
from taskspec.printers.symbols import label, symbol
from taskspec.printers.tex import read
from taskspec.printers.text import text


@dataclass(frozen=True)
class Notation:
    """What the names of one task look like."""

    symbols: Mapping[str, m.Math] = field(default_factory=dict)
    labels: Mapping[str, Mapping[str, m.Math]] = field(default_factory=dict)  # component -> label
    conditions: frozenset[str] = frozenset()  # names of conditions without a value of their own
    singles: frozenset[str] = frozenset()  # vectors of one element, written like a number
    lengths: Mapping[str, s.Expr] = field(default_factory=dict)  # of vectors, symbolic
    events: Mapping[str, str] = field(
        default_factory=dict
    )  # functions of a condition `under` a policy, and which by default

    def symbol(self, name: str) -> m.Math:
        return self.symbols.get(name) or symbol(name)

    def label(self, name: str, of: str | None) -> m.Math | None:
        """The symbol of a label, of the given component or of whichever has it."""
        if of is not None and name in self.labels.get(of, {}):
            return self.labels[of][name]
        if name in self.symbols:
            return None
        return next((labels[name] for labels in self.labels.values() if name in labels), None)

    def with_symbols(self, more: Mapping[str, m.Math]) -> Notation:
        return replace(self, symbols={**self.symbols, **more})


def mathematics(expr: s.Expr, notation: Notation, of: str | None = None) -> m.Math:
    """The mathematics of a value; a condition becomes its indicator.

    Args:
        expr: what to print.
        notation: symbols of the names.
        of: the component that the value belongs to, whose labels it may name.
    """
    return Writer(notation, of).number(expr).tree


def condition(expr: s.Expr, notation: Notation) -> m.Math:
    """The mathematics of a condition."""
    return Writer(notation).truth(expr).tree


@dataclass(frozen=True)
class Writer:
    """Writes expressions in one notation; `of` is the component whose labels are meant."""

    notation: Notation
    of: str | None = None

    # -- two readings ---------------------------------------------------------------------------------------------

    def number(self, expr: s.Expr) -> Piece:
        """An expression used as a value: conditions count as 0 and 1."""
        if isinstance(expr, s.Boolean):
            return Piece(m.Num(str(int(expr.value))))
        if self.is_condition(expr):
            return Piece(indicator(self.truth(expr).tree))
        return self.piece(expr)

    def truth(self, expr: s.Expr) -> Piece:
        """An expression used as a condition."""
        if isinstance(expr, s.Boolean):
            return Piece(m.upright("true" if expr.value else "false"))
        return self.piece(expr)

    def is_condition(self, expr: s.Expr) -> bool:
        """Whether an expression is a condition by its form (a bool component is a number, 0 or 1)."""
        match expr:
            case s.Compare() | s.Logical() | s.Unary(op="not"):
                return True
            case s.Call(function=name):
                return name in ("any", "all") or name in self.notation.conditions
            case s.Name(id=name):
                return name in self.notation.conditions
            case _:
                return False

    # -- forms ----------------------------------------------------------------------------------------------------

    def piece(self, expr: s.Expr) -> Piece:
        match expr:
            case s.Number(text=digits):
                return _number(digits)
            case s.Boolean() | s.Quoted() | s.Name():
                return self._leaf(expr)
            case s.Unary():
                return self._unary(expr)
            case s.Binary():
                return self._binary(expr)
            case s.Logical(op=op, operands=operands):
                return self._logical(op, operands)
            case s.Compare():
                return self._compare(expr)
            case s.IfElse() | s.Piecewise() | s.Table() | s.Weights():
                return Piece(piecewise.cases(self, expr))
            case s.Call():
                return self._call(expr)
            case s.Subscript():
                return self._subscript(expr)
            case s.Vector():
                return self._vector(expr)
            case s.SetOf(items=items):
                return Piece(m.braces(m.joined(self.numbers(items))))
            case s.Comprehension():
                return Piece(idioms.comprehension(self, expr))
            case _:
                assert_never(expr)

    def numbers(self, exprs: Iterable[s.Expr]) -> list[m.Math]:
        return [self.number(e).tree for e in exprs]

    def _leaf(self, expr: s.Boolean | s.Quoted | s.Name) -> Piece:
        if isinstance(expr, s.Boolean):
            return Piece(m.Num(str(int(expr.value))))
        if isinstance(expr, s.Quoted):
            return Piece(self.notation.label(expr.value, self.of) or label(expr.value))
        found = None if expr.primed else self.notation.label(expr.id, self.of)
        return Piece(found or prime(self.notation.symbol(expr.id), expr.primed))

    def _unary(self, expr: s.Unary) -> Piece:
        if expr.op == "not":
            inner = expr.operand
            if isinstance(inner, s.Compare) and len(inner.rest) == 1 and inner.rest[0][0] in _OPPOSITE:
                return self._compare(replace(inner, rest=((_OPPOSITE[inner.rest[0][0]], inner.rest[0][1]),)))
            return Piece(m.Row((m.Sym("¬"), self.truth(inner).at(ATOM))), INFIX["not"].precedence)
        operand = self.number(expr.operand).at(PRODUCT)
        return Piece(m.Row((m.Sym("−" if expr.op == "-" else "+"), operand)), SIGN)

    def _binary(self, expr: s.Binary) -> Piece:
        match expr.op:
            case "+" | "-":
                right = self.number(expr.right)
                # a - (b - c) keeps its brackets; so does a + (-b)
                tight = (
                    right.at(SUM + 1 if expr.op == "-" else SUM) if right.precedence != SIGN else m.brackets(right.tree)
                )
                sign = m.Sym("+" if expr.op == "+" else "−")
                return Piece(_flat(self.number(expr.left).at(SUM), sign, tight), SUM)
            case "*":
                return self._product(expr)
            case "/":
                return self._fraction(expr)
            case "**":
                return self._power(expr)
            case _:
                left, right2 = self.number(expr.left).at(PRODUCT), self.number(expr.right).at(PRODUCT + 1)
                tree = fill(INFIX[expr.op].latex, (("0", left), ("1", right2)))
                return Piece(tree, ATOM if expr.op == "//" else PRODUCT)

    def _product(self, expr: s.Binary) -> Piece:
        factors: list[s.Expr] = [expr.right]
        left = expr.left
        while isinstance(left, s.Binary) and left.op == "*":
            factors.append(left.right)
            left = left.left
        factors.append(left)
        factors.reverse()
        pieces = [self.number(f) for f in factors]
        signed = pieces[0].precedence == SIGN
        trees = [p.at(PRODUCT if i == 0 else SIGN + 1) for i, p in enumerate(pieces)]
        return Piece(multiply(trees), SIGN if signed else PRODUCT)

    def _fraction(self, expr: s.Binary) -> Piece:
        sign, top = _pull_sign(expr.left)
        frac = m.Frac(self.number(top).tree, self.number(expr.right).tree)
        return Piece(m.Row((m.Sym("−"), frac)), SIGN) if sign else Piece(frac, SIGN + 1)

    def _power(self, expr: s.Binary) -> Piece:
        base = self.number(expr.left)
        # a fraction, and a base with scripts above, need brackets to carry an exponent
        loose = isinstance(base.tree, m.Frac) or (isinstance(base.tree, m.Script) and base.tree.sup is not None)
        exponent = self.number(expr.right).tree
        tree = m.brackets(base.tree) if loose else base.at(POWER + 1)
        if isinstance(tree, m.Script) and tree.sup is None:
            return Piece(replace(tree, sup=exponent), POWER)
        return Piece(m.Script(tree, sup=exponent), POWER)

    def _logical(self, op: str, operands: tuple[s.Expr, ...]) -> Piece:
        entry = INFIX[op]
        # two different connectives side by side are easier to read with brackets
        parts = [self.truth(o) for o in operands]
        trees = [p.at(RELATION - 1) for p in parts]
        return Piece(m.joined(trees, "∧" if op == "and" else "∨"), entry.precedence)

    def _compare(self, expr: s.Compare) -> Piece:
        congruence = idioms.divisible(self, expr)
        if congruence is not None:
            return Piece(congruence, RELATION)
        sides = [expr.first, *(side for _, side in expr.rest)]
        owner = next((x.id for x in sides if isinstance(x, s.Name) and x.id in self.notation.labels), self.of)
        inner = replace(self, of=owner)
        items: list[m.Math] = [inner.number(sides[0]).at(SUM)]
        for op, side in expr.rest:
            items += [read(_relation(op)), inner.number(side).at(SUM)]
        return Piece(m.Row(tuple(items)), RELATION)

    # -- calls ----------------------------------------------------------------------------------------------------

    def _call(self, expr: s.Call) -> Piece:
        if expr.function in DIST_NAMES:
            return Piece(idioms.distribution(self, expr))
        written = idioms.IDIOMS.get(expr.function)
        found = written(self, expr) if written is not None else None
        if found is not None:
            return found
        function = FUNCTIONS.get(expr.function)
        if function is not None and function.accepts(len(expr.args)):
            return self._template(function.latex, expr)
        if expr.function in self.notation.events:
            return self._event(expr)
        arguments = m.brackets(m.joined(self.numbers(expr.args)))
        return Piece(m.Row((self.notation.symbol(expr.function), arguments)))

    def _event(self, expr: s.Call) -> Piece:
        """The probability of a condition, with the policy below."""
        given = dict(zip(("condition", "under"), expr.args, strict=False)) | dict(expr.keywords)
        policy = text(given["under"]) if "under" in given else self.notation.events[expr.function]
        head = m.Script(self.notation.symbol(expr.function), m.Words(policy))
        return Piece(m.Row((head, m.brackets(self.truth(given["condition"]).tree))))

    def _template(self, latex: str, expr: s.Call) -> Piece:
        """A function by its template; arguments that no delimiter of it encloses get brackets."""
        pieces = [self.number(a) for a in expr.args]
        template = parsed(latex, tuple(str(i) for i in range(len(pieces))))
        bare = exposed(template)
        holes = [(str(i), p.at(PRODUCT) if str(i) in bare else p.tree) for i, p in enumerate(pieces)]
        holes.append(("*", m.joined(p.tree for p in pieces)))
        return Piece(fill(latex, holes), PRODUCT if bare and is_infix(template) else SIGN + 1 if bare else ATOM)

    def _subscript(self, expr: s.Subscript) -> Piece:
        if isinstance(expr.value, s.Name) and expr.value.id in self.notation.singles:
            return self.piece(expr.value)
        base = self.number(expr.value)
        below = m.joined(self._index(i) for i in expr.indices)
        tree = base.at(ATOM)
        if isinstance(tree, m.Script) and tree.sub is None and tree.sup is None:
            return Piece(replace(tree, sub=below))
        if isinstance(tree, m.Script) and tree.sub is not None and tree.sup is None:
            return Piece(replace(tree, sub=m.Row((tree.sub, m.Sym(","), below))))
        return Piece(m.Script(tree, below))

    def _index(self, index: s.Expr | s.Slice) -> m.Math:
        if not isinstance(index, s.Slice):
            return self.number(index).tree
        start = m.Num("0") if index.start is None else self.number(index.start).tree
        stop: tuple[m.Math, ...] = () if index.stop is None else (self.number(index.stop).tree,)
        step: tuple[m.Math, ...] = () if index.step is None else (m.Sym(":"), self.number(index.step).tree)
        return m.Row((start, m.Sym(":"), *stop, *step))

    def _vector(self, expr: s.Vector) -> Piece:
        if len(expr.items) == 1 and not isinstance(expr.items[0], s.Vector):
            return self.number(expr.items[0])
        if expr.items and all(isinstance(i, s.Vector) for i in expr.items):
            rows = [tuple(self.numbers(i.items)) for i in expr.items if isinstance(i, s.Vector)]
            if len({len(r) for r in rows}) == 1:
                return Piece(m.Matrix(tuple(rows)))
        return Piece(m.brackets(m.joined(self.numbers(expr.items))))


_OPPOSITE = {"==": "!=", "!=": "==", "in": "not in", "not in": "in", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}


def _relation(op: str) -> str:
    return INFIX[op].latex.replace("{0}", "").replace("{1}", "").strip()


def _flat(left: m.Math, sign: m.Math, right: m.Math) -> m.Math:
    """A sum in one row, so that it can break at any of its signs."""
    head = (
        left.items
        if isinstance(left, m.Row) and any(x in (m.Sym("+"), m.Sym("−")) for x in left.items[1:])
        else (left,)
    )
    return m.Row((*head, sign, right))


def _pull_sign(expr: s.Expr) -> tuple[bool, s.Expr]:
    """-a*b over c is minus a*b over c."""
    match expr:
        case s.Unary(op="-", operand=operand):
            return True, operand
        case s.Binary(op="*", left=left):
            sign, rest = _pull_sign(left)
            return sign, replace(expr, left=rest)
        case _:
            return False, expr


def _number(text: str) -> Piece:
    """Digits as written; an exponent as a power of ten."""
    mantissa, mark, exponent = text.lower().replace("_", "").partition("e")
    if not mark or not exponent.lstrip("+-").isdigit():
        return Piece(m.Num(text.replace("_", "")))
    sign = (m.Sym("−"),) if exponent.startswith("-") else ()
    power = m.Script(m.Num("10"), sup=m.row(*sign, m.Num(exponent.lstrip("+-0") or "0")))
    if mantissa in ("1", "1."):
        return Piece(power, POWER)
    return Piece(m.Row((m.Num(mantissa), m.Sym("×"), power)), PRODUCT)
