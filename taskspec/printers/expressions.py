"""Surface syntax -> the mathematics tree, in the notation people write by hand.

Brackets follow the table of `printers.brackets`; functions and distributions follow its templates. Where hand
writing has an idiom of its own (a sum over a slice, a set-builder, an indicator), `printers.idioms` knows it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import assert_never

from taskspec.lang import syntax as s
from taskspec.lang.dists import is_distribution
from taskspec.lang.operators import FUNCTIONS, INFIX
from taskspec.lang.operators.entry import Level
from taskspec.printers import idioms, piecewise
from taskspec.printers import tree as m
from taskspec.printers.names import Notation, Writer
from taskspec.printers.pieces import Piece, applied, fill, multiply, operands, prime
from taskspec.printers.symbols import label
from taskspec.printers.tex import read
from taskspec.printers.text import text


def mathematics(expr: s.Expr, notation: Notation, of: str | None = None) -> m.Math:
    """Return the mathematics of a value; a condition becomes its indicator.

    Args:
        expr: what to print.
        notation: symbols of the names.
        of: the component that the value belongs to, whose labels it may name.
    """
    return ExpressionWriter(notation, of).number(expr).tree


def condition(expr: s.Expr, notation: Notation) -> m.Math:
    """Return the mathematics of a condition."""
    return ExpressionWriter(notation).truth(expr).tree


@dataclass(frozen=True)
class ExpressionWriter(Writer):
    """Writes each form of expression."""

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
            case s.Logical(op=op, operands=parts):
                return self._logical(op, parts)
            case s.Compare():
                return self._compare(expr)
            case s.IfElse() | s.Piecewise() | s.Table() | s.Weights():
                return applied("cases", piecewise.cases(self, expr))
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
            return applied("not", m.Row((m.Sym("¬"), *operands("not", [self.truth(inner)]))))
        return _signed("−" if expr.op == "-" else "+", self.number(expr.operand))

    def _binary(self, expr: s.Binary) -> Piece:
        match expr.op:
            case "+" | "-":
                sides = [self.number(expr.left), self.number(expr.right)]
                left, right = operands(expr.op, sides)
                return applied(
                    expr.op, _flat(left, m.Sym("+" if expr.op == "+" else "−"), right), _leads(sides[0], left)
                )
            case "*":
                return self._product(expr)
            case "/":
                return self._fraction(expr)
            case "**":
                return self._power(expr)
            case _:
                left, right = operands(expr.op, [self.number(expr.left), self.number(expr.right)])
                return applied(expr.op, fill(INFIX[expr.op].latex, (("0", left), ("1", right))))

    def _product(self, expr: s.Binary) -> Piece:
        factors: list[s.Expr] = [expr.right]
        left = expr.left
        while isinstance(left, s.Binary) and left.op == "*":
            factors.append(left.right)
            left = left.left
        factors.append(left)
        factors.reverse()
        pieces = [self.number(f) for f in factors]
        trees = operands("*", pieces)
        return applied("*", multiply(trees), _leads(pieces[0], trees[0]))

    def _fraction(self, expr: s.Binary) -> Piece:
        sign, top = _pull_sign(expr.left)
        fraction = applied("/", m.Frac(*operands("/", [self.number(top), self.number(expr.right)])))
        return _signed("−", fraction) if sign else fraction

    def _power(self, expr: s.Binary) -> Piece:
        base, exponent = operands("**", [self.number(expr.left), self.number(expr.right)])
        if isinstance(base, m.Script) and base.sup is None:
            return applied("**", replace(base, sup=exponent))
        return applied("**", m.Script(base, sup=exponent))

    def _logical(self, op: str, parts: tuple[s.Expr, ...]) -> Piece:
        trees = operands(op, map(self.truth, parts))
        return applied(op, m.joined(trees, "∧" if op == "and" else "∨"))

    def _compare(self, expr: s.Compare) -> Piece:
        congruence = idioms.divisible(self, expr)
        if congruence is not None:
            return applied("congruence", congruence)
        sides = [expr.first, *(side for _, side in expr.rest)]
        owner = next((x.id for x in sides if isinstance(x, s.Name) and x.id in self.notation.labels), self.of)
        inner = replace(self, of=owner)
        first, *others = operands("compare", map(inner.number, sides))
        items: list[m.Math] = [first]
        for (op, _), side in zip(expr.rest, others, strict=True):
            items += [read(_relation(op)), side]
        return applied("compare", m.Row(tuple(items)))

    # -- calls ----------------------------------------------------------------------------------------------------

    def _call(self, expr: s.Call) -> Piece:
        if is_distribution(expr.function):
            return idioms.distribution(self, expr)
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
        """Return the probability of a condition, with the policy below."""
        given = dict(zip(("condition", "under"), expr.args, strict=False)) | dict(expr.keywords)
        policy = text(given["under"]) if "under" in given else self.notation.events[expr.function]
        head = m.Script(self.notation.symbol(expr.function), m.Words(policy))
        return Piece(m.Row((head, m.brackets(self.truth(given["condition"]).tree))))

    def _template(self, latex: str, expr: s.Call) -> Piece:
        """Return a function by its template."""
        pieces = [self.number(a) for a in expr.args]
        trees = operands(expr.function, pieces)
        holes = [*((str(i), tree) for i, tree in enumerate(trees)), ("*", m.joined(trees))]
        return applied(expr.function, fill(latex, holes), expr.function == "dot" and _leads(pieces[0], trees[0]))

    def _subscript(self, expr: s.Subscript) -> Piece:
        if isinstance(expr.value, s.Name) and expr.value.id in self.notation.singles:
            return self.piece(expr.value)
        (tree,) = operands("subscript", [self.number(expr.value)])
        below = m.joined(self._index(i) for i in expr.indices)
        if isinstance(tree, m.Script) and tree.sub is None and tree.sup is None:
            return Piece(replace(tree, sub=below))
        if isinstance(tree, m.Script) and tree.sub is not None and tree.sup is None and not _is_slice(expr.value):
            return Piece(replace(tree, sub=m.Row((tree.sub, m.Sym(","), below))))
        return Piece(m.Script(m.brackets(tree) if isinstance(tree, m.Script) else tree, below))

    def _index(self, index: s.Expr | s.Slice) -> m.Math:
        if not isinstance(index, s.Slice):
            return self.number(index).tree
        start, stop, step = (() if x is None else (self.number(x).tree,) for x in (index.start, index.stop, index.step))
        if not start and stop and not step:
            start = (m.Num("0"),)  # where it begins is told with where it ends
        return m.Row((*start, m.Sym(":"), *stop, *((m.Sym(":"), *step) if step else ())))

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
    """Return a sum in one row, so that it can break at any of its signs."""
    head = (
        left.items
        if isinstance(left, m.Row) and any(x in (m.Sym("+"), m.Sym("−")) for x in left.items[1:])
        else (left,)
    )
    return m.Row((*head, sign, right))


def _leads(piece: Piece, operand: m.Math) -> bool:
    """Return whether an operand leads with a sign, being without brackets."""
    return piece.signed and operand is piece.tree


def _signed(sign: str, piece: Piece) -> Piece:
    """Return a piece with a sign before it, which binds no tighter than the piece does."""
    (operand,) = operands("sign", [piece])
    own = applied("sign", m.Row((m.Sym(sign), operand)), signed=True)
    return replace(own, level=min(own.level, piece.level if operand is piece.tree else Level.ATOM))


def _is_slice(expr: s.Expr) -> bool:
    return isinstance(expr, s.Subscript) and any(isinstance(i, s.Slice) for i in expr.indices)


def _pull_sign(expr: s.Expr) -> tuple[bool, s.Expr]:
    """Write -a*b over c as minus a*b over c."""
    match expr:
        case s.Unary(op="-", operand=operand):
            return True, operand
        case s.Binary(op="*", left=left):
            sign, rest = _pull_sign(left)
            return sign, replace(expr, left=rest)
        case _:
            return False, expr


def _number(text: str) -> Piece:
    """Return digits as written; an exponent as a power of ten."""
    mantissa, mark, exponent = text.lower().replace("_", "").partition("e")
    if not mark or not exponent.lstrip("+-").isdigit():
        return Piece(m.Num(text.replace("_", "")))
    sign = (m.Sym("−"),) if exponent.startswith("-") else ()
    power = m.Script(m.Num("10"), sup=m.row(*sign, m.Num(exponent.lstrip("+-0") or "0")))
    if mantissa in ("1", "1."):
        return applied("**", power)
    return applied("*", m.Row((m.Num(mantissa), m.Sym("×"), power)))
