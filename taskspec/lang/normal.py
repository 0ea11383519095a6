"""Normal forms of nodes: equal numbers for expressions that compute the same in the same way, whoever built them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from taskspec.lang.interval import bounds
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, draws, walk
from taskspec.lang.operators import Elements, entry_of
from taskspec.lang.types import Kind, Range


class NormalForms:
    """Numbers for nodes, the same number for the same form; two builders may have made them.

    Operands that may change places are put in order, `x >= n` where x is at most n counts as `x == n`, and draws are told
    apart by their rank in the order of drawing.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], int] = {}

    def all(self, roots: Iterable[Node], order: Sequence[Draw] | None = None) -> list[int]:
        """The forms of some nodes; `order` ranks the draws that may occur in them."""
        roots = list(roots)
        rank = {d.site: i for i, d in enumerate(draws(roots) if order is None else order)}
        numbers: dict[int, int] = {}
        edges: dict[int, Range] = {}
        for node in walk(roots):
            key = _key(node, numbers, rank, edges)
            numbers[id(node)] = self._known.setdefault(key, len(self._known))
        return [numbers[id(node)] for node in roots]


def _key(node: Node, numbers: dict[int, int], rank: dict[int, int], edges: dict[int, Range]) -> tuple[Any, ...]:
    match node:
        case Const():
            return ("const", node.type, tuple(map(_number, node.flat)))
        case Read(role=role, name=name, low=low, high=high):
            return ("read", role, name, node.type, low, high)
        case Draw(base=base, args=args, site=site):
            return ("draw", base, node.type, rank[site], tuple(numbers[id(a)] for a in args))
        case Apply(op=op, args=args, static=static):
            if op == "le" and _only_equal(args, edges):
                op = "eq"
            return ("apply", op, node.type, static, _operands(op, args, numbers))


def _operands(op: str, args: tuple[Node, ...], numbers: dict[int, int]) -> tuple[int, ...]:
    """Return the numbers of operands, in ascending order where their order does not matter."""
    operands = tuple(numbers[id(a)] for a in args)
    entry = entry_of(op)
    if not entry.commutative or (entry.elements is Elements.CHOSEN and _may_be_zeros(args)):
        return operands
    first = min(entry.indices, default=0)
    return (*operands[:first], *sorted(operands[first:]))


def _number(value: Any) -> str:
    """A constant; a fraction and a float of the same value are one, 0 and -0 are two."""
    if isinstance(value, Fraction) and abs(value) < 2**1000 and value == float(value):
        value = float(value)
    return repr(value)


def _may_be_zeros(args: tuple[Node, ...]) -> bool:
    """Whether two reals may both be zero: then the first of 0 and -0 is taken, and their order matters."""
    return all(a.type.kind is Kind.REAL and not (isinstance(a, Const) and all(a.flat)) for a in args)


def _only_equal(args: tuple[Node, ...], edges: dict[int, Range]) -> bool:
    """Whether `a <= b` between ints can hold by equality alone, because a is never below b."""
    if any(a.type.kind is Kind.REAL for a in args):
        return False
    return bounds(args[0], edges)[0] >= bounds(args[1], edges)[1]
