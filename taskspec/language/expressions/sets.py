"""Finite sets: comprehensions over lattices and ranges, enumerated at compile time; membership; and comparisons.

Sets are enumerated as arrays, all candidates at once, so that a set of a million points costs milliseconds. Every side of a
comparison, chained ones included, is worked out once, so that what it draws is one draw.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits
from taskspec.language.expressions import alternatives, batch
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.ir import Const, Node, draws, have_one_shape, reads, walk
from taskspec.language.expressions.scope import BaseChecker, Poisoned, Scope, Value, check_comparable
from taskspec.language.expressions.types import INT_WIDEST, Domain, Kind, Role, Type

_ENUMERATED = "a set is enumerated before the task runs; it may use parameters and constants only"
T = TypeVar("T")
MOST_AXES = 32  # as many as arrays may have
Wants = Mapping[str, Domain | None]
_NONE: Wants = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class _Points:
    """Candidates of a clause: an array with one row for each, and the domain of labels if they are labels."""

    rows: Array  # (count, *shape)
    domain: Domain | None = None


def uniform(checker: BaseChecker, expr: s.SetOf | s.Comprehension, scope: Scope, want: Domain | None) -> Value:
    b = checker.builder
    table, domain = _table(checker, expr, scope, want)
    count = table.type.shape[0]
    if not count:
        checker.fail("E407", expr, "this set is empty")
    index = b.draw("index", (b.scalar(count),), Type(Kind.INT))
    return Value(b.structure("index", [table, index]), domain)


def _table(
    checker: BaseChecker, expr: s.SetOf | s.Comprehension, scope: Scope, want: Domain | None
) -> tuple[Node, Domain | None]:
    """Elements of a set as the rows of a vector; equal constants count once, as in mathematics."""
    b = checker.builder
    if isinstance(expr, s.Comprehension):
        points = _enumerate(checker, expr, scope)
        return _constant(checker, points.rows), points.domain
    values = alternatives.alternative_values(checker, expr.items, scope, want)
    nodes, domain = alternatives.unify(checker, values, expr.items, want)
    if not have_one_shape(nodes):
        checker.fail("E307", expr, "the elements of this set have different shapes")
    kind = max(n.type.kind for n in nodes)
    return b.structure("vector", list(dict.fromkeys(b.cast(n, kind) for n in nodes))), domain


def _member_of_values(checker: BaseChecker, value: Value, left: s.Expr, right: s.Expr, scope: Scope) -> Node:
    """`x in {a, b}`, `x in (a, b)` or `x in {y for y in ...}`, for the value of `x`, written as `left`."""
    b = checker.builder
    if isinstance(right, s.Vector):
        right = s.SetOf(right.items, right.place)
    if isinstance(right, s.Call) and right.function in ("range", "box"):
        x = s.Name("x", False, right.place)
        right = s.Comprehension(x, (s.Clause(("x",), right, ()),), True, right.place)
    if not isinstance(right, s.SetOf | s.Comprehension) or (isinstance(right, s.Comprehension) and not right.is_set):
        checker.fail("E306", right, "`in` needs a set written out: `x in {a, b}`")
    if isinstance(right, s.SetOf) and not right.items:
        return b.scalar(False)
    table, domain = _table(checker, right, scope, value.domain)
    node = value.node
    if domain is None or domain != value.domain:  # numbers, or what labels stand for in arithmetic
        check_comparable(domain, value.domain)
        node = checker.number_of(value)
        table = checker.number_of(Value(table, domain))
    if not table.type.shape[0]:
        return b.scalar(False)
    if node.type.shape != table.type.shape[1:]:
        checker.fail("E307", left, f"{node.type} cannot be an element of this set")
    if node.type.is_scalar:
        return b.apply("any", b.apply("eq", table, node))
    member: Node = b.scalar(False)
    for row in range(table.type.shape[0]):
        here = b.apply("all", b.apply("eq", b.structure("element", [table], (row,)), node))
        member = b.apply("or", member, here)
    return member


# -- comprehensions written out -----------------------------------------------------------------------------------


def unroll(
    checker: BaseChecker, expr: s.Comprehension, scope: Scope, element: Callable[[Scope], T], wants: Wants = _NONE
) -> list[T]:
    """Write out `[e for x in range(n) for y in range(m)]`, one result for each element, which may depend on the state.

    `element` makes it, in a scope of its own; `wants` are the domains of variables.
    """

    def over(clauses: tuple[s.Clause, ...], scope: Scope) -> list[T]:
        if not clauses:
            return [element(scope)]
        clause = clauses[0]
        want = None
        if len(clause.targets) == 1:
            want = wants.get(clause.targets[0])
        points = _candidates(checker, clause, scope, want)
        _check_few(checker, "unrolled", len(points.rows), expr, "elements to write out")
        checker.expand(expr, len(points.rows))
        results = []
        with checker.repeated(max(1, len(points.rows))):
            for row in points.rows:
                inner = scope.child(_bind(checker, clause, row, points.domain, expr))
                if all(_holds(checker, c, inner) for c in clause.conditions):
                    results += over(clauses[1:], inner)
        return results

    elements = over(expr.clauses, scope)
    _check_few(checker, "unrolled", len(elements), expr, "elements to write out")
    return elements


def _holds(checker: BaseChecker, condition: s.Expr, scope: Scope) -> bool:
    node = checker.condition(condition, scope)
    if not isinstance(node, Const):
        hint = "test inside: `[x if condition else 0 for ...]`"
        checker.fail("E312", condition, "the condition of a vector's comprehension must be a constant", hint)
    return bool(node.value)


def _bind(checker: BaseChecker, clause: s.Clause, row: Array, domain: Domain | None, expr: s.Expr) -> dict[str, Any]:
    b = checker.builder
    whole = _constant(checker, row)
    if len(clause.targets) == 1:
        return {clause.targets[0]: Value(whole, domain)}
    if whole.type.shape[:1] != (len(clause.targets),):
        checker.fail("E307", expr, f"cannot unpack this into {len(clause.targets)} names")
    bindings = {}
    for i, name in enumerate(clause.targets):
        bindings[name] = Value(b.structure("element", [whole], (i,)))
    return bindings


# -- enumeration --------------------------------------------------------------------------------------------------


def _enumerate(checker: BaseChecker, expr: s.Comprehension, scope: Scope) -> _Points:
    columns: dict[str, Array] = {}
    bindings: dict[str, Any] = {}
    count = 1
    inner = scope
    for clause in expr.clauses:
        points = _candidates(checker, clause, inner)
        count *= len(points.rows)
        _check_few(checker, "candidates", count, expr, "candidates of a set")
        for name, rows in columns.items():
            columns[name] = np.repeat(rows, len(points.rows), axis=0)
        repeated = np.tile(points.rows, (count // max(1, len(points.rows)), *(1 for _ in points.rows.shape[1:])))
        parts = [(clause.targets[0], repeated)]
        if len(clause.targets) > 1:
            if repeated.ndim < 2 or repeated.shape[1] != len(clause.targets):
                checker.fail("E307", expr, f"cannot unpack this into {len(clause.targets)} names")
            parts = [(name, repeated[:, i]) for i, name in enumerate(clause.targets)]
        for name, column in parts:
            ends = (0.0, 0.0)
            if column.size:
                ends = (float(column.min()), float(column.max()))
            type_ = Type(_kind(column), column.shape[1:])
            columns[name] = column
            bindings[name] = Value(checker.builder.read(Role.VARIABLE, name, type_, *ends), points.domain)
        inner = scope.child(dict(bindings))
        keep = np.ones(count, dtype=bool)
        for condition in clause.conditions:
            keep &= _over(checker, checker.condition(condition, inner), columns, condition)
        columns = {name: rows[keep] for name, rows in columns.items()}
        count = int(keep.sum())
    if count == 0:
        return _Points(np.zeros((0,), np.bool_))
    value = checker.value(expr.element, inner)
    rows = _over(checker, value.node, columns, expr.element)
    _, first = np.unique(rows, axis=0, return_index=True)
    return _Points(rows[np.sort(first)], value.domain)


def _over(checker: BaseChecker, node: Node, columns: dict[str, Array], expr: s.Expr) -> Array:
    if draws([node]) or any(role is not Role.VARIABLE or name not in columns for role, name in reads([node])):
        checker.fail("E312", expr, _ENUMERATED)
    for part in walk([node]):
        if isinstance(part, Const) and part.type.kind is Kind.INT:
            _check_width(checker, expr, *part.flat)
    count = len(next(iter(columns.values())))
    values = {}
    for name, rows in columns.items():
        values[(Role.VARIABLE, name)] = np.moveaxis(rows, 0, -1)
    (result,) = batch.evaluate([node], values)
    return np.moveaxis(np.broadcast_to(result, (*result.shape[:-1], count)), -1, 0)


def _candidates(checker: BaseChecker, clause: s.Clause, scope: Scope, want: Domain | None = None) -> _Points:
    expr = clause.domain
    domain = None
    match expr:
        case s.Call(function="box"):
            return _Points(_box(checker, expr, scope))
        case s.Call(function="range"):
            return _Points(_range(checker, expr, scope))
        case s.SetOf() | s.Comprehension(is_set=True):
            table, domain = _table(checker, expr, scope, want)
        case _:
            table = checker.numeric(expr, scope)
    if not isinstance(table, Const) or table.type.is_scalar:
        message = "a comprehension goes over a constant: `range(n)`, `box(low, high, n)`, a set or a vector"
        hint = None
        if len(clause.targets) == 1 and len(table.type.shape) == 1:
            name = clause.targets[0]
            hint = (
                f"`for i in range(len({expr.place.written}))`, and `{expr.place.written}[i]` in the place of `{name}`"
            )
        checker.fail("E312", expr, message, hint)
    return _Points(batch.array(table)[..., 0], domain)


def _box(checker: BaseChecker, expr: s.Call, scope: Scope) -> Array:
    if len(expr.args) != 3:
        hint = "`box(-1, 1, 2)` is the square of integer points from -1 to 1"
        checker.fail("E304", expr, "box(low, high, n) was given the wrong arguments", hint)
    low, high, size = expr.args
    a = checker.integer(low, scope, "an argument of `box`")
    b = checker.integer(high, scope, "an argument of `box`")
    axes = checker.integer(size, scope, "an argument of `box`")
    if axes < 1 or b < a:
        checker.fail("E407", expr, f"box({a}, {b}, {axes}) has no points")
    if axes > MOST_AXES:
        checker.fail("E314", expr, f"a box of {axes:,} axes is too large; the limit is {MOST_AXES}")
    _check_few(checker, "candidates", (b - a + 1) ** axes, expr, "points of a box")
    _check_width(checker, expr, a, b)
    grid = np.meshgrid(*[np.arange(a, b + 1)] * axes, indexing="ij")
    return np.stack([g.ravel() for g in grid], axis=1)


def _range(checker: BaseChecker, expr: s.Call, scope: Scope) -> Array:
    if not 1 <= len(expr.args) <= 3:
        checker.fail("E304", expr, "range takes one to three arguments")
    ends = [checker.integer(e, scope, "an argument of `range`") for e in expr.args]
    if len(ends) == 3 and ends[2] == 0:
        checker.fail("E315", expr, "the step of `range` cannot be 0")
    chosen = range(*ends)
    length = max(0, -((chosen.start - chosen.stop) // chosen.step))  # of any size, which `len` has not
    _check_few(checker, "candidates", length, expr, "values of a range")
    _check_width(checker, expr, *ends)
    return np.array(chosen, dtype=np.int64)


def _check_width(checker: BaseChecker, expr: s.Expr, *ends: int) -> None:
    if any(abs(end) >= INT_WIDEST for end in ends):
        checker.fail("E318", expr, "ints have 64 bits; this set exceeds them")


def _check_few(checker: BaseChecker, limit: str, number: int, expr: s.Expr, what: str) -> None:
    most = getattr(limits(), limit)
    if number > most:
        message = f"{count_of(number)} {what} are too many; the limit is {most:,}"
        checker.fail("E314", expr, message, how_to_raise(limit, number))


def _kind(array: Array) -> Kind:
    return {"b": Kind.BOOL, "i": Kind.INT}.get(array.dtype.kind, Kind.REAL)


def _constant(checker: BaseChecker, array: Array) -> Const:
    if array.ndim == 0:
        value = array.item()
    else:
        value = array.ravel().tolist()
    return checker.builder.const(value, Type(_kind(array), array.shape))


# -- comparisons --------------------------------------------------------------------------------------------------

_OPERATORS = {"==": "eq", "!=": "ne", "<": "lt", "<=": "le"}
_TURNED = {">": "<", ">=": "<="}


def compare(checker: BaseChecker, expr: s.Compare, scope: Scope) -> Node:
    """Check `a < b == c`: every pair of neighbours compared, and all of it must hold."""
    sides = [_Side(checker, expr.first, scope)]
    for _, side in expr.rest:
        sides.append(_Side(checker, side, scope))
    links = [(op, sides[i], sides[i + 1]) for i, (op, _) in enumerate(expr.rest)]
    return reduce(partial(checker.builder.apply, "and"), checker.each(_link, links))


class _Side:
    """One side of a comparison, worked out once. A word that may be a label means what its neighbour makes of it."""

    def __init__(self, checker: BaseChecker, expr: s.Expr, scope: Scope) -> None:
        self.checker = checker
        self.expr = expr
        self.scope = scope
        self.may_be_label = alternatives.may_be_label(expr, scope)
        self._found: list[Value | None] = []

    @cached_property
    def parts(self) -> list[_Side]:
        """The elements of a vector that is written out, sides themselves."""
        if isinstance(self.expr, s.Vector):
            items = self.expr.items
        else:
            items = ()
        return [_Side(self.checker, item, self.scope) for item in items]

    @property
    def domain(self) -> Domain | None:
        return alternatives.domain_of(self.expr, self.scope)

    @property
    def has_choices(self) -> bool:
        """True where it names a choice, or is a vector that does."""
        return self.domain is not None or any(p.has_choices for p in self.parts)

    def value(self, want: Domain | None = None) -> Value:
        """Value beside a neighbour of the domain `want`, the first one if there are two.

        Raises:
            Poisoned: when it is broken.
        """
        if self.may_be_label:
            return self.checker.value(self.expr, self.scope, want)
        if not self._found:
            self._found.append(self.checker.check(self.expr, self.scope, want))
        if self._found[0] is None:
            raise Poisoned
        return self._found[0]

    def number(self) -> Node:
        return self.checker.number_of(self.value())


def _link(op: str, left: _Side, right: _Side) -> Node:
    checker = left.checker
    b = checker.builder
    if op in ("in", "not in"):
        member = _member(left, right)
        if op == "not in":
            return b.apply("not", member)
        return member
    if op in ("==", "!=") and _of_choices(left, right):
        parts = [(op, *pair) for pair in zip(left.parts, right.parts, strict=True)]
        return checker.stack(checker.each(_link, parts), left.expr)
    if op in ("==", "!="):
        one, other = _alike(left, right)
        if one.domain is not None and one.domain == other.domain:
            return b.apply(_OPERATORS[op], one.node, other.node)
        check_comparable(one.domain or left.domain, other.domain or right.domain)
        nodes = [checker.number_of(one), checker.number_of(other)]
    else:
        nodes = checker.each(_Side.number, [(left,), (right,)])
    if op in _TURNED:
        return b.apply(_OPERATORS[_TURNED[op]], nodes[1], nodes[0])
    return b.apply(_OPERATORS[op], *nodes)


def _alike(left: _Side, right: _Side) -> tuple[Value, Value]:
    if left.may_be_label and not right.may_be_label:
        other = right.value()
        return left.value(other.domain or right.domain), other
    try:
        one = left.value()
    except Poisoned:
        word = right.expr.place.written
        if isinstance(right.expr, s.Quoted):
            word = right.expr.value
        if not (right.may_be_label and right.scope.is_label(word)):
            right.checker.check(right.expr, right.scope)
        raise
    if right.may_be_label:
        return one, right.value(one.domain or left.domain)
    return one, right.value(one.domain)


def _of_choices(left: _Side, right: _Side) -> bool:
    """Test whether both are vectors that are written out, with choices among them: labels belong to their own element."""
    return 0 < len(left.parts) == len(right.parts) and (left.has_choices or right.has_choices)


def _member(left: _Side, right: _Side) -> Node:
    """`x in {a, b}`; where x is a vector of choices, it is compared with one vector after the other."""
    checker = left.checker
    if isinstance(right.expr, s.Comprehension) and right.expr.is_set and left.has_choices:
        return _member_of_many(left, right.expr, right.scope)
    items: tuple[s.Expr, ...] = ()
    if isinstance(right.expr, s.SetOf | s.Vector):
        items = right.expr.items
    sides = [_Side(checker, item, right.scope) for item in items]
    if not sides or not all(_of_choices(left, side) for side in sides):
        return _member_of_values(checker, left.value(), left.expr, right.expr, right.scope)
    same = checker.each(_link, [("==", left, side) for side in sides])
    conditions = [checker.builder.apply("all", node) for node in same]
    return reduce(partial(checker.builder.apply, "or"), conditions)


def _member_of_many(left: _Side, right: s.Comprehension, scope: Scope) -> Node:
    """`x in {... for ...}` of a choice, or a vector with choices: labels of each element belong to the choice in its place."""
    checker = left.checker
    b = checker.builder
    element = right.element
    parts = left.parts or [left]
    items: tuple[s.Expr, ...] = (element,)
    if left.parts and isinstance(element, s.Vector):
        items = element.items
    if len(items) != len(parts):
        return _member_of_values(checker, left.value(), left.expr, right, scope)
    domains = [alternatives.domain_of(part.expr, scope) for part in parts]
    wants = {}
    for item, domain in zip(items, domains, strict=True):
        if isinstance(item, s.Name):
            wants[item.id] = domain

    def same(inner: Scope) -> Node:
        for item, domain in zip(items, domains, strict=True):
            if not isinstance(checker.value(item, inner, domain).node, Const):
                checker.fail("E312", item, _ENUMERATED)
        equal = _link("==", left, _Side(checker, element, inner))
        if equal.type.shape:
            return b.apply("all", equal)
        return equal

    none: Node = b.scalar(False)
    return reduce(partial(b.apply, "or"), unroll(checker, right, scope, same, wants), none)
