"""Normal forms of integer expressions, and expressions that do not depend on the order of elements."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence

from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, walk
from taskspec.lang.operators import Elements, entry_of
from taskspec.lang.types import Kind

# ---------- linear
# Integer expressions in a normal form, in which differences that do not matter are gone: `g - (p + m)` is `(g - p) - m`.
#
# Sums of ints become one sum with its terms in a fixed order; `abs`, `==` and `!=` do not see the sign of what they are
# asked about, nor do comparisons see on which side a term stands. Reals are left as they are: their sums round.

Terms = dict[int, tuple[Node, int]]
"""Terms of a sum by identity, with how often each is added."""


class Normal:
    """The normal form of expressions of one task; equal ones become one node."""

    def __init__(self, builder: Builder) -> None:
        self.builder = builder
        self._known: dict[int, Node] = {}
        self._order: dict[int, int] = {}

    def form(self, roots: Iterable[Node]) -> tuple[Node, ...]:
        roots = tuple(roots)
        for node in walk(roots):
            if id(node) not in self._known:
                args = tuple(self._known[id(c)] for c in children(node))
                remade = node if args == children(node) else self.builder.remake(node, args)
                self._known[id(node)] = self._simplified(remade)
        return tuple(self._known[id(root)] for root in roots)

    def terms(self, node: Node) -> tuple[Terms, Node]:
        """A whole number as a sum of terms and a constant, all of one shape."""
        b, shape = self.builder, node.type.shape
        match node:
            case Const():
                return {}, node
            case Apply(op="add" | "sub" as op, args=(left, right)):
                (mine, own), (others, other) = self.terms(b.stretch(left, shape)), self.terms(b.stretch(right, shape))
                return _added(mine, others, 1 if op == "add" else -1), b.apply(op, own, other)
            case Apply(op="neg", args=(inner,)):
                mine, own = self.terms(inner)
                return _added({}, mine, -1), b.apply("neg", own)
            case Apply(op="mul", args=(Const(value=int(factor)), inner) | (inner, Const(value=int(factor)))):
                mine, own = self.terms(b.stretch(inner, shape))
                return _added({}, mine, factor), b.apply("mul", b.scalar(factor), own)
            case _:
                zero = b.stretch(b.scalar(0), shape)
                return {id(node): (node, 1)}, zero

    # -- one node whose arguments are in normal form ------------------------------------------------------------------

    def _simplified(self, node: Node) -> Node:
        if not isinstance(node, Apply):
            return node
        whole = all(a.type.kind is not Kind.REAL for a in node.args)
        match node:
            case Apply(op="add" | "sub" | "neg" | "mul") if node.type.kind is Kind.INT:
                return self._sum(*self.terms(node))
            case Apply(op="abs", args=(inner,)) if whole:
                return self.builder.apply("abs", self._unsigned(inner))
            case Apply(op="eq" | "ne" as op, args=(left, right)) if whole:
                difference = self._unsigned(self._difference(left, right))
                return self.builder.apply(op, self._zero(difference), difference)
            case Apply(op="lt" | "le" as op, args=(left, right)) if whole:
                difference = self._difference(right, left)
                return self.builder.apply(op, self._zero(difference), difference)
            case Apply(op="where", args=(condition, then, otherwise)) if node.type.kind is Kind.INT:
                return self._apart([condition], then, otherwise, node)
            case Apply(op="min2" | "max2", args=(left, right)) if node.type.kind is Kind.INT:
                return self._apart([], left, right, node)
            case Apply(op=op, args=(inner, *rest), static=static) if (
                _rearranges(op, node) and inner.type.kind is Kind.INT
            ):
                return self._moved(op, inner, rest, static, node)
            case _:
                return node

    def _difference(self, left: Node, right: Node) -> Node:
        b = self.builder
        return self._sum(*self.terms(b.apply("sub", b.cast(left, Kind.INT), b.cast(right, Kind.INT))))

    def _zero(self, node: Node) -> Node:
        return self.builder.stretch(self.builder.scalar(0), node.type.shape)

    def _apart(self, condition: list[Node], one: Node, other: Node, node: Apply) -> Node:
        """A choice between two sums as the first of them and a choice between 0 and their difference."""
        b, shape = self.builder, node.type.shape
        one, other = b.stretch(b.cast(one, Kind.INT), shape), b.stretch(b.cast(other, Kind.INT), shape)
        terms, rest = self.terms(one)
        if not terms:
            return node
        chosen = b.apply(node.op, *condition, self._zero(node), self._difference(other, one))
        return self._sum(_added(terms, {id(chosen): (chosen, 1)}, 1), rest)

    def _unsigned(self, node: Node) -> Node:
        """The expression or its negative, whichever begins with a positive factor."""
        terms, rest = self.terms(node)
        first = min(terms, key=self._place, default=None)
        if first is None or terms[first][1] > 0:
            return node
        return self._sum(_added({}, terms, -1), self.builder.apply("neg", rest))

    def _moved(self, op: str, inner: Node, rest: list[Node], static: tuple[int, ...], node: Node) -> Node:
        """An operator that chooses elements, applied to each term of a sum."""
        b = self.builder
        terms, constant = self.terms(inner)
        if len(terms) == 1 and next(iter(terms.values())) == (inner, 1):
            return node
        found: Terms = {}
        for term, factor in terms.values():
            part = b.structure(op, [term, *rest], static)
            found = _added(found, {id(part): (part, 1)}, factor)
        return self._sum(found, b.structure(op, [constant, *rest], static))

    def _sum(self, terms: Terms, constant: Node) -> Node:
        """The sum of terms in order and a constant."""
        b, found = self.builder, None
        for key in sorted(terms, key=self._place):
            node, factor = terms[key]
            part = node if factor == 1 else b.apply("mul", b.scalar(factor), node)
            found = part if found is None else b.apply("add", found, part)
        if found is None:
            return constant
        return found if _is_zero(constant) else b.apply("add", found, constant)

    def _place(self, key: int) -> int:
        return self._order.setdefault(key, len(self._order))


def _added(terms: Terms, others: Terms, factor: int) -> Terms:
    found = dict(terms)
    for key, (node, count) in others.items():
        total = found.get(key, (node, 0))[1] + factor * count
        if total:
            found[key] = (node, total)
        else:
            found.pop(key, None)
    return found


def _rearranges(op: str, node: Apply) -> bool:
    """Return whether an operator only chooses elements of its first argument, and so acts on each term of a sum."""
    entry = entry_of(op)
    return entry.elements is Elements.MOVED and entry.indices == tuple(range(1, len(node.args)))


def _is_zero(node: Node) -> bool:
    return isinstance(node, Const) and not any(node.flat)


# ---------- order
# What depends on the order of a vector's elements alone, shown from the form of expressions.
#
# Let h be any increasing function, applied to every element of a vector of reals. An expression is *invariant* when it has
# the same value for x and for h(x), and a *selection* when its value for h(x) is h of its value for x: elements of x,
# chosen by their order. A selection that has every element of x once is a *rearrangement*. Ranks are such an h, as long
# as no two elements are equal; so what is invariant depends on the ranks alone.


class How(enum.IntEnum):
    """How an expression depends on the order of the elements; the larger, the closer to the vector itself."""

    INVARIANT = 0
    SELECTION = 1
    REARRANGEMENT = 2


def dependence(roots: Sequence[Node], name: str) -> list[How | None]:
    """How expressions depend on a state component, a vector of reals; None where it is none of these ways."""
    found: dict[int, How | None] = {}
    for node in walk(roots):
        found[id(node)] = _of(node, [found[id(c)] for c in children(node)], name)
    return [found[id(root)] for root in roots]


def _of(node: Node, args: list[How | None], name: str) -> How | None:
    match node:
        case Read(role=Role.STATE, name=read):
            return How.REARRANGEMENT if read == name else How.INVARIANT
        case Draw() if any(a is not How.INVARIANT for a in args):
            return None
        case Apply(op=op) if any(a is not How.INVARIANT for a in args):
            return None if None in args else _chosen(node, op, [a for a in args if a is not None])
        case _:
            return How.INVARIANT


def _chosen(node: Apply, op: str, args: list[How]) -> How | None:
    """Of an operator with some argument that is a selection."""
    entry = entry_of(op)
    indices = entry.indices
    elements = [a for i, a in enumerate(args) if i not in indices]
    if any(args[i] is not How.INVARIANT for i in indices) or How.INVARIANT in elements:
        return None  # an element compared with, or mixed with, something that is none
    if entry.elements is Elements.RANKED:
        return How.INVARIANT
    if entry.elements is Elements.COMPUTED or node.type.kind is not Kind.REAL:
        return None
    whole = min(elements) is How.REARRANGEMENT
    return How.REARRANGEMENT if whole and _keeps_all(node) else How.SELECTION


def _keeps_all(node: Apply) -> bool:
    """Whether the operator keeps every element of its arguments, which have them all."""
    match node:
        case Apply(op="sort" | "swap"):
            return True
        case Apply(op="slice", static=(start, count, -1)):
            return start == count - 1 and count == node.args[0].type.shape[0]
        case Apply(op="where", args=(condition, *_)):
            return condition.type.is_scalar
        case _:
            return False
