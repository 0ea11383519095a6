"""The typed core of the language: expressions once names, parameters and labels are resolved.

Four node classes, closed. Nodes are interned by the `Builder` that makes them, so equal expressions are one
object, sharing is explicit, and identity is equality. Everything downstream (interpreter, code generators,
exact enumeration) walks these nodes; nothing downstream sees names of parameters or labels of choices.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, cast

from taskspec.language.expressions.types import Expression, Kind, Role, Type


@dataclass(frozen=True, slots=True, eq=False)
class Const(Expression):
    """A literal: a Python scalar (bool, int, float, Fraction), or a flat row-major tuple of them."""

    value: Any
    type: Type

    @property
    def flat(self) -> tuple[Any, ...]:
        return (self.value,) if self.type.is_scalar else self.value

    @property
    def numbers(self) -> tuple[Any, ...]:
        """The elements as bools, ints or floats: what leaves the compiler."""
        return tuple(map(plain, self.flat))


@dataclass(frozen=True, slots=True, eq=False)
class Read(Expression):
    """The present value of a state or action component, of the time, or of a bound variable."""

    role: Role
    name: str
    type: Type
    low: float = float("-inf")
    high: float = float("inf")


@dataclass(frozen=True, slots=True, eq=False)
class Apply(Expression):
    """An operator of `lang.operators` applied to arguments; `static` holds what is fixed at compile time (slice bounds)."""

    op: str
    args: tuple[Node, ...]
    type: Type
    static: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Draw(Expression):
    """A base variate of `lang.variates`; `site` tells two written occurrences apart."""

    base: str
    args: tuple[Node, ...]
    type: Type
    site: int


Node = Const | Read | Apply | Draw
_WITH_ARGUMENTS = (Apply, Draw)  # a union would be built again for each node


def children(node: Node) -> tuple[Node, ...]:
    match node:
        case Const() | Read():
            return ()
        case Apply(args=args) | Draw(args=args):
            return args


def walk(roots: Iterable[Expression], known: Container[int] = frozenset()) -> Iterator[Node]:
    """Yield every node below the roots once, arguments before users, in a stable order.

    Nodes whose ids are `known` are left out, with all that is below them alone.
    """
    seen: set[int] = set()
    for root in roots:
        stack: list[Node | None] = [cast("Node", root)]
        users: list[Node] = []  # whose arguments are on the stack, above a None
        while stack:
            node = stack.pop()
            if node is None:
                yield users.pop()
            elif id(node) not in seen and id(node) not in known:
                seen.add(id(node))
                if isinstance(node, _WITH_ARGUMENTS) and node.args:
                    users.append(node)
                    stack.append(None)
                    stack.extend(node.args[::-1])
                else:
                    yield node


def draws(roots: Iterable[Expression]) -> tuple[Draw, ...]:
    """Draws below the roots, by site, except that draws come before others that depend on them."""
    by_site = {}
    for n in walk(roots):
        if isinstance(n, Draw):
            by_site[n.site] = n
    if len(by_site) < 2:
        return tuple(by_site.values())
    in_order = [by_site[site] for site in sorted(by_site)]
    return tuple(n for n in walk(in_order) if isinstance(n, Draw))


def draw_sites(roots: Iterable[Expression]) -> set[int]:
    return {draw.site for draw in draws(roots)}


def reads(roots: Iterable[Expression]) -> frozenset[tuple[Role, str]]:
    names = set()
    for n in walk(roots):
        if isinstance(n, Read):
            names.add((n.role, n.name))
    return frozenset(names)


def are_constant(nodes: Iterable[Node]) -> bool:
    return all(isinstance(node, Const) for node in nodes)


def have_one_shape(nodes: Iterable[Node]) -> bool:
    return len({node.type.shape for node in nodes}) < 2


Remake = Callable[[Node, tuple[Node, ...]], Node]
"""Gives a node over other arguments."""


def rewrite(roots: Iterable[Expression], replacements: Mapping[int, Node], remake: Remake) -> tuple[Node, ...]:
    """Replace nodes by id, and rebuild all that use them bottom-up by `remake`."""
    roots = tuple(roots)
    done: dict[int, Node] = {}
    for node in walk(roots):
        replaced = replacements.get(id(node))
        if replaced is None:
            args = tuple(done[id(child)] for child in children(node))
            replaced = node
            if not all(a is b for a, b in zip(args, children(node), strict=True)):
                replaced = remake(node, args)
        done[id(node)] = replaced
    return tuple(done[id(root)] for root in roots)


def exact(value: Any, kind: Kind) -> Any:
    """Convert a scalar to the Python number of its kind; Fractions stay exact."""
    if kind is Kind.BOOL:
        return bool(value)
    if kind is Kind.INT:
        return int(value)
    return value if type(value) is Fraction else float(value)  # `isinstance` asks the numbers' abstract classes


def plain(value: Any) -> Any:
    """Convert a constant's scalar to a bool, int or float, which leave the compiler."""
    if type(value) is Fraction:
        return float(value)
    return value
