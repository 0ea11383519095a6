"""Comparisons, chained ones included: every side is worked out once, so that what it draws is one draw."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial, reduce

from taskspec.lang import alternatives, sets
from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker, check_comparable
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import Scope, Value
from taskspec.lang.types import Domain

_OPERATORS = {"==": "eq", "!=": "ne", "<": "lt", "<=": "le"}
_TURNED = {">": "<", ">=": "<="}


def compare(checker: BaseChecker, expr: s.Compare, scope: Scope) -> Node:
    """`a < b == c`: every pair of neighbours compared, and all of it must hold."""
    sides = [_Side(checker, side, scope) for side in (expr.first, *(side for _, side in expr.rest))]
    signs = [op for op, _ in expr.rest]
    links = zip(signs, sides, sides[1:], strict=False)
    return reduce(partial(checker.builder.apply, "and"), checker.each([partial(_link, *link) for link in links]))


class _Side:
    """One side of a comparison, worked out once. A word that may be a label means what its neighbour makes of it."""

    def __init__(self, checker: BaseChecker, expr: s.Expr, scope: Scope) -> None:
        self.checker = checker
        self.expr = expr
        self.scope = scope
        self.word = expr.value if isinstance(expr, s.Quoted) else expr.id if isinstance(expr, s.Name) else ""
        self.may_be_label = isinstance(expr, s.Quoted) or (
            isinstance(expr, s.Name) and scope.lookup(expr.written) is None
        )
        self._found: list[Value | None] = []

    @cached_property
    def parts(self) -> list[_Side]:
        """The elements of a vector that is written out, sides themselves."""
        items = self.expr.items if isinstance(self.expr, s.Vector) else ()
        return [_Side(self.checker, item, self.scope) for item in items]

    @property
    def has_choices(self) -> bool:
        """Whether it names a choice, or is a vector that does."""
        return alternatives.domain_of(self.expr, self.scope) is not None or any(p.has_choices for p in self.parts)

    def check(self, want: Domain | None = None) -> Value | None:
        """Return the value beside a neighbour of the domain `want`, the first one if there are two; None when it is broken."""
        if self.may_be_label:
            return self.checker.check(self.expr, self.scope, want)
        if not self._found:
            self._found.append(self.checker.check(self.expr, self.scope, want))
        return self._found[0]

    def value(self, want: Domain | None = None) -> Value:
        """Return the same.

        Raises:
            Poisoned: when it is broken.
        """
        return self.check(want) or self.checker.poison()

    def number(self) -> Node:
        return self.checker.number_of(self.value())


def _link(op: str, left: _Side, right: _Side) -> Node:
    checker = left.checker
    if op in ("in", "not in"):
        found = _member(left, right)
        return checker.builder.apply("not", found) if op == "not in" else found
    if op in ("==", "!=") and _of_choices(left, right):
        return checker.stack(checker.each(_part_links(op, left, right)), left.expr)
    if op in ("==", "!="):
        one, other = _alike(left, right)
        if one.domain is not None and one.domain == other.domain:
            return checker.builder.apply(_OPERATORS[op], one.node, other.node)
        check_comparable(one.domain, other.domain)
        nodes = [checker.number_of(one), checker.number_of(other)]
    else:
        nodes = checker.each([left.number, right.number])
    if op in _TURNED:
        nodes.reverse()
        op = _TURNED[op]
    return checker.builder.apply(_OPERATORS[op], *nodes)


def _alike(left: _Side, right: _Side) -> tuple[Value, Value]:
    """Return two values to compare: a label on one side belongs to the choice on the other."""
    if left.may_be_label and not right.may_be_label:
        other = right.value()
        return left.value(other.domain), other
    one = left.check()
    if one is None:
        if not (right.may_be_label and right.scope.is_label(right.word)):
            right.check()
        left.checker.poison()
    return one, right.value(one.domain)


# -- vectors of choices -------------------------------------------------------------------------------------------


def _of_choices(left: _Side, right: _Side) -> bool:
    """Return whether both are vectors that are written out, with choices among their elements: labels are those of
    their own element.
    """
    return 0 < len(left.parts) == len(right.parts) and (left.has_choices or right.has_choices)


def _part_links(op: str, left: _Side, right: _Side) -> list[Callable[[], Node]]:
    return [partial(_link, op, *parts) for parts in zip(left.parts, right.parts, strict=True)]


def _member(left: _Side, right: _Side) -> Node:
    """`x in {a, b}`; where x is a vector of choices, it is compared with one vector after the other."""
    checker = left.checker
    if isinstance(right.expr, s.Comprehension) and right.expr.is_set and left.has_choices:
        return _member_of_many(left, right.expr, right.scope)
    items = right.expr.items if isinstance(right.expr, s.SetOf | s.Vector) else ()
    sides = [_Side(checker, item, right.scope) for item in items]
    if not sides or not all(_of_choices(left, side) for side in sides):
        return sets.member(checker, left.value(), left.expr, right.expr, right.scope)
    same = checker.each([partial(_link, "==", left, side) for side in sides])
    return reduce(partial(checker.builder.apply, "or"), [checker.builder.apply("all", node) for node in same])


def _member_of_many(left: _Side, right: s.Comprehension, scope: Scope) -> Node:
    """`x in {... for ...}` of a choice, or a vector with choices: labels of each element belong to the choice in its place."""
    checker = left.checker
    b = left.checker.builder
    element = right.element
    parts = left.parts or [left]
    items = element.items if left.parts and isinstance(element, s.Vector) else (element,)
    if len(items) != len(parts):
        return sets.member(checker, left.value(), left.expr, right, scope)
    domains = [alternatives.domain_of(part.expr, scope) for part in parts]
    wants = {item.id: domain for item, domain in zip(items, domains, strict=True) if isinstance(item, s.Name)}

    def same(inner: Scope) -> Node:
        for item, domain in zip(items, domains, strict=True):
            if not isinstance(checker.value(item, inner, domain).node, Const):
                checker.fail(
                    "E312", item, "a set is enumerated before the task runs; it may use parameters and constants only"
                )
        found = _link("==", left, _Side(checker, element, inner))
        return b.apply("all", found) if found.type.shape else found

    none: Node = b.scalar(False)
    return reduce(partial(b.apply, "or"), sets.unroll(checker, right, scope, same, wants), none)
