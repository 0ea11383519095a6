"""Surface syntax -> the mathematics tree, in the notation people write by hand.

Brackets follow the tables of `printers.pieces`; functions and distributions follow the templates of their entries. Where hand
writing has an idiom of its own (a sum over a slice, a set-builder, an indicator), `printers.idioms` knows it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import assert_never

from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.dists import is_distribution
from taskspec.language.expressions.operators import FUNCTIONS, INFIX
from taskspec.show.printers import idioms
from taskspec.show.printers import tree as m
from taskspec.show.printers.cases import cases
from taskspec.show.printers.names import Notation, Writer, label
from taskspec.show.printers.pieces import Piece, applied, fill, indexed, indicator, multiply, operands, prime
from taskspec.show.printers.rewrites import from_start, is_vector, pointwise
from taskspec.show.printers.tex import read
from taskspec.show.printers.text import text


def mathematics(expr: s.Expr, notation: Notation, of: str | None = None) -> m.Math:
    """Convert a value to mathematics; a condition becomes its indicator."""
    return ExpressionWriter(notation, of).number(expr).tree


def condition(expr: s.Expr, notation: Notation) -> m.Math:
    return ExpressionWriter(notation).truth(expr).tree


@dataclass(frozen=True)
class ExpressionWriter(Writer):
    def number(self, expr: s.Expr) -> Piece:
        """Print an expression as a value; conditions on elements have their index below."""
        if self.is_condition(expr) and is_vector(self, expr):
            elements = pointwise(self, expr)
            if elements is not None:
                of, index, inner = elements
                return Piece(m.Script(m.brackets(indicator(of.truth(inner).tree)), index))
        return Writer.number(self, expr)

    def piece(self, expr: s.Expr) -> Piece:  # noqa: C901, PLR0912
        match expr:
            case s.Number(text=digits):
                return _number(digits)
            case s.Boolean(value=value):
                return Piece(m.Num(str(int(value))))
            case s.Quoted(value=word):
                return Piece(self.notation.label(word, self.of) or label(word))
            case s.Name(id=name, primed=primed):
                printed = None
                if not primed:
                    printed = self.notation.label(name, self.of)
                return Piece(printed or prime(self.notation.symbol(name), primed))
            case s.Unary():
                return self._unary(expr)
            case s.Binary():
                return self._binary(expr)
            case s.Logical(op=op, operands=parts):
                sign = {"and": "∧", "or": "∨"}[op]
                return applied(op, m.joined(operands(op, map(self.truth, parts)), sign))
            case s.Compare():
                return self._compare(expr)
            case s.IfElse() | s.Piecewise() | s.Table() | s.Weights():
                return applied("cases", cases(self, expr))
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

    def _unary(self, expr: s.Unary) -> Piece:
        if expr.op != "not":
            return _signed(expr.op.replace("-", "−"), self.number(expr.operand))
        match expr.operand:
            case s.Compare(rest=((op, side),)) as inner if op in _OPPOSITE:
                return self._compare(replace(inner, rest=((_OPPOSITE[op], side),)))
            case inner:
                return applied("not", m.Row((m.Sym("¬"), *operands("not", [self.truth(inner)]))))

    def _binary(self, expr: s.Binary) -> Piece:
        if expr.op == "*":
            return self._product(expr)
        if expr.op == "/":
            sign, top = _pull_sign(expr.left)
            fraction = applied("/", m.Frac(*operands("/", [self.number(top), self.number(expr.right)])))
            if sign:
                return _signed("−", fraction)
            return fraction
        sides = [self.number(expr.left), self.number(expr.right)]
        left, right = operands(expr.op, sides)
        match expr.op:
            case "+" | "-":
                head: tuple[m.Math, ...] = (left,)
                if isinstance(left, m.Row) and {m.Sym("+"), m.Sym("−")} & set(left.items[1:]):
                    head = left.items  # in one row, so that it can break at any of its signs
                total = m.Row((*head, m.Sym(expr.op.replace("-", "−")), right))
                return applied(expr.op, total, _leads(sides[0], left))
            case "**":
                if isinstance(left, m.Script) and left.sup is None:
                    return applied("**", replace(left, sup=right))
                return applied("**", m.Script(left, sup=right))
            case _:
                return applied(expr.op, fill(INFIX[expr.op].latex, (("0", left), ("1", right))))

    def _product(self, expr: s.Binary) -> Piece:
        factors: list[s.Expr] = [expr.right]
        left = expr.left
        while isinstance(left, s.Binary) and left.op == "*":
            factors.append(left.right)
            left = left.left
        factors.append(left)
        factors.reverse()
        factors = _squared(factors)
        pieces = list(map(self.number, factors))
        trees = operands("*", pieces)
        if len(factors) == 1:
            return pieces[0]
        return applied("*", multiply(trees, [is_vector(self, f) for f in factors]), _leads(pieces[0], trees[0]))

    def _compare(self, expr: s.Compare) -> Piece:
        congruence = idioms.divisible(self, expr)
        if congruence is not None:
            return applied("congruence", congruence)
        sides = [expr.first, *(side for _, side in expr.rest)]
        inner = self
        for side in reversed(sides):
            if isinstance(side, s.Name) and side.id in self.notation.labels:
                inner = replace(self, of=side.id)
        first, *others = operands("compare", map(inner.number, sides))
        items: list[m.Math] = [first]
        for (op, _), other in zip(expr.rest, others, strict=True):
            relation = INFIX[op].latex.replace("{0}", "").replace("{1}", "")
            items += [read(relation.strip()), other]
        return applied("compare", m.Row(tuple(items)))

    def _call(self, expr: s.Call) -> Piece:
        if is_distribution(expr.function):
            return idioms.distribution(self, expr)
        printed = None
        if expr.function in idioms.IDIOMS:
            printed = idioms.IDIOMS[expr.function](self, expr)
        if printed is not None:
            return printed
        function = FUNCTIONS.get(expr.function)
        if function is not None and function.accepts(len(expr.args)):
            pieces = list(map(self.number, expr.args))
            trees = operands(expr.function, pieces)
            holes = [*((str(i), tree) for i, tree in enumerate(trees)), ("*", m.joined(trees))]
            signed = expr.function == "dot" and _leads(pieces[0], trees[0])
            return applied(expr.function, fill(function.latex, holes), signed)
        if expr.function in self.notation.events:
            return self._event(expr)
        arguments = m.brackets(m.joined(self.numbers(expr.args)))
        return Piece(m.Row((self.notation.symbol(expr.function), arguments)))

    def _event(self, expr: s.Call) -> Piece:
        """Write a probability, or the expectation of a measure, with the policy below."""
        first = "name"
        write = self.number
        if expr.function == "probability":
            first = "condition"
            write = self.truth
        given = dict(zip((first, "under"), expr.args, strict=False)) | dict(expr.keywords)
        policy = self.notation.events[expr.function]
        if "under" in given:
            policy = text(given["under"])
        head = m.Script(self.notation.symbol(expr.function), m.Words(policy))
        return Piece(m.Row((head, m.brackets(write(given[first]).tree))))

    def _subscript(self, expr: s.Subscript) -> Piece:
        if isinstance(expr.value, s.Name) and expr.value.id in self.notation.singles:
            return self.piece(expr.value)
        (tree,) = operands("subscript", [self.number(expr.value)])
        below = m.joined(self._index(expr.value, axis, index) for axis, index in enumerate(expr.indices))
        if isinstance(tree, m.Script):
            is_part = isinstance(expr.value, s.Subscript) and s.Slice in map(type, expr.value.indices)
            if tree.sup is not None or (tree.sub is not None and is_part):
                tree = m.brackets(tree)
        return Piece(indexed(tree, below))

    def _index(self, vector: s.Expr, axis: int, index: s.Expr | s.Slice) -> m.Math:
        """Print an index, or all indices of a slice: its end is left out, and mathematics counts to the last one."""
        if not isinstance(index, s.Slice):
            return self.number(from_start(self, vector, axis, index)).tree
        if index.step is not None:
            return self._steps(index)
        start = from_start(self, vector, axis, index.start or s.Number(0, "0", index.place))
        if index.stop is not None:
            last = idioms.less_one(self, from_start(self, vector, axis, index.stop))
            return idioms.interval(self.number(start).tree, last)
        if index.start is not None:
            return m.Row((self.number(start).tree, m.Sym(":")))
        return m.Sym(":")

    def _steps(self, index: s.Slice) -> m.Math:
        parts: list[m.Math] = []
        for part in (index.start, index.stop, index.step):
            if part is not None:
                parts.append(self.number(part).tree)
            parts.append(m.Sym(":"))
        return m.Row(tuple(parts[:-1]))

    def _vector(self, expr: s.Vector) -> Piece:
        if len(expr.items) == 1 and not isinstance(expr.items[0], s.Vector):
            return self.number(expr.items[0])
        rows = []
        for item in expr.items:
            if isinstance(item, s.Vector):
                rows.append(tuple(self.numbers(item.items)))
        if len(rows) == len(expr.items) and len(set(map(len, rows))) == 1:
            return Piece(m.Matrix(tuple(rows)))
        return Piece(m.brackets(m.joined(self.numbers(expr.items))))


_OPPOSITE = {"==": "!=", "!=": "==", "in": "not in", "not in": "in", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}


def _squared(factors: list[s.Expr]) -> list[s.Expr]:
    squares: list[s.Expr] = []
    for factor in factors:
        match (factor, squares[-1:]):
            case s.Name() as name, [s.Name() as before] if before.written == name.written:
                two = s.Number(2, "2", name.place)
                squares[-1] = s.Binary("**", name, two, name.place)
            case _:
                squares.append(factor)
    return squares


def _leads(piece: Piece, operand: m.Math) -> bool:
    return piece.signed and operand is piece.tree


def _signed(sign: str, piece: Piece) -> Piece:
    (operand,) = operands("sign", [piece])
    own = applied("sign", m.Row((m.Sym(sign), operand)), signed=True)
    if operand is not piece.tree:
        return own
    return replace(own, level=min(own.level, piece.level))


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
    """Digits as written; an exponent as a power of ten."""
    mantissa, mark, exponent = text.lower().replace("_", "").partition("e")
    if not mark or not exponent.lstrip("+-").isdigit():
        return Piece(m.Num(text.replace("_", "")))
    digits = m.Num(exponent.lstrip("+-0") or "0")
    power = m.Script(m.Num("10"), sup=m.signed(exponent.startswith("-"), digits))
    if mantissa in ("1", "1."):
        return applied("**", power)
    return applied("*", m.Row((m.Num(mantissa), m.Sym("×"), power)))
