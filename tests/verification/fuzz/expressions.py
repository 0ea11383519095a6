"""Random well-typed expressions over the whole operator table, and points of the box that their reads are declared in."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Node, Read
from taskspec.language.expressions.operators import FUNCTIONS, OPERATORS
from taskspec.language.expressions.types import BOOL, INT, REAL, Kind, Refused, Role, Type

Flat = tuple[Any, ...]
INF = math.inf
NAN = math.nan
INTS = (-(2**62), -(2**53) - 1, -(2**31), -7, -3, -2, -1, 0, 0, 1, 1, 2, 3, 5, 8, 2**31 - 1, 2**53 + 1, 2**62)
REALS = (
    -1e300, -1e9, -7.5, -2.0, -1.0, -0.1, -1e-9, -5e-324, -0.0, 0.0, 0.0, 5e-324, 1e-9, 0.1, 0.3, 0.5, 1.0, 1.16,
    math.nextafter(2, 0), 2.0, 2.5, math.pi, 7.0, 29.0, 100.0, 699.0, 710.0, 1e9, 2.0**53, 1e300,
)  # fmt: skip
LENGTHS = (1, 2, 3, 7, 25)


class Expressions:
    """Makes nodes with one builder from the choices of one source of randomness."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.builder = Builder()
        self.reads = list[Read]()

    def node(self, depth: int = 4) -> Node:
        """A node of any type; `depth` bounds the operators on a path."""
        if depth == 0 or self.chance.random() < 0.1:
            return self._leaf()
        for _ in range(8):
            try:
                return self.chance.choice((self._operator, self._operator, self._function, self._element))(depth - 1)
            except Refused:  # the arguments do not suit it
                continue
        return self._leaf()

    def rooted(self, name: str, depth: int = 2) -> Node:
        """A node of one operator, over reads more often than not; `structure` stands for elements, slices and indices."""
        while True:
            try:
                inner = self.chance.choice((0, 0, 0, 1, depth))
                return self._element(inner) if name == "structure" else self._operator(inner, name)
            except Refused:
                continue

    # -- leaves ---------------------------------------------------------------------------------------------------

    def _leaf(self) -> Node:
        shape = self.chance.choice(((), (), (), (self.chance.choice(LENGTHS),)))
        type_ = Type(self.chance.choice((Kind.BOOL, Kind.INT, Kind.INT, Kind.REAL, Kind.REAL)), shape)
        if self.chance.random() < 0.3:
            flat = tuple(self._number(type_.kind) for _ in range(type_.size))
            return self.builder.const(flat if shape else flat[0], type_)
        return self._read(type_)

    def _read(self, type_: Type) -> Node:
        name = f"read{len(self.reads)}"
        read = self.builder.read(Role.STATE, name, type_, *self._range(type_.kind))
        assert isinstance(read, Read)
        self.reads.append(read)
        return read

    def _range(self, kind: Kind) -> tuple[float, float]:
        if kind is Kind.BOOL:
            return 0, 1
        one = self._number(kind)
        other = self._number(kind)
        low = min(one, other)
        high = max(one, other)
        match self.chance.randrange(12):
            case 0:
                return -INF, high
            case 1:
                return low, INF
            case 2 | 3:
                return low, low
            case _:
                return low, high

    def _number(self, kind: Kind) -> Any:
        match kind:
            case Kind.BOOL:
                return self.chance.random() < 0.5
            case Kind.INT:
                return self.chance.choice(INTS[3:-3] if self.chance.random() < 0.8 else INTS)
            case Kind.REAL:
                return self.chance.choice(REALS) if self.chance.random() < 0.7 else self.chance.uniform(-4, 4)

    # -- operators ------------------------------------------------------------------------------------------------

    def _operator(self, depth: int, name: str | None = None) -> Node:
        op = OPERATORS[name or self.chance.choice(list(OPERATORS))]
        if not op.elementwise and self.chance.random() < 0.8:
            type_ = Type(self.chance.choice(tuple(Kind)), (self.chance.choice(LENGTHS),))
            return self.builder.apply(op.name, self._read(type_))
        return self.builder.apply(op.name, *self._arguments(len(op.samples[0]), depth))

    def _function(self, depth: int) -> Node:
        function = FUNCTIONS[self.chance.choice(list(FUNCTIONS))]
        nodes = self._arguments(len(self.chance.choice(function.samples)), depth)
        for i in function.static:
            nodes[i] = self.builder.scalar(self.chance.choice((1, 3, 5)))
        return function.build(self.builder, nodes)

    def _arguments(self, count: int, depth: int) -> list[Node]:
        """Nodes that are likely to go together: of one kind, of one shape or scalar."""
        nodes = [self.node(depth) for _ in range(count)]
        if self.chance.random() < 0.4:
            nodes[-1] = nodes[0]
        vectors = [n for n in nodes if n.type.shape]
        return [self._element_of(n) if n.type.shape and n is not vectors[0] and self._rarely() else n for n in nodes]

    def _rarely(self) -> bool:
        return self.chance.random() < 0.5

    def _element(self, depth: int) -> Node:
        """Structure: elements, slices, vectors of what there is, indices made of ints."""
        b = self.builder
        node = self.node(depth)
        if not node.type.shape:
            return b.structure("vector", [node, b.cast(self._read(BOOL), node.type.kind), node])
        match self.chance.randrange(4):
            case 0:
                return self._element_of(node)
            case 1:
                return b.structure("slice", [node], (node.type.shape[0] - 1, node.type.shape[0], -1))
            case _:
                index = self.node(depth)
                if index.type.kind is Kind.REAL or index.type.shape:
                    raise Refused("no index")
                return b.structure("index", [node, b.position(b.cast(index, Kind.INT), node.type.shape[0])])

    def _element_of(self, node: Node) -> Node:
        return self.builder.structure("element", [node], (self.chance.randrange(node.type.shape[0]),))


# -- points -------------------------------------------------------------------------------------------------------


def points(reads: Sequence[Read], chance: random.Random, count: int) -> Iterator[dict[tuple[Role, str], Flat]]:
    """Values of the reads: corners of the box first, then their neighbours and what lies between."""
    for k in range(count):
        choose = _corner if k < count // 2 else _inside
        yield {(r.role, r.name): tuple(choose(r, chance) for _ in range(r.type.size)) for r in reads}


def outside(reads: Sequence[Read], chance: random.Random, count: int) -> Iterator[dict[tuple[Role, str], Flat]]:
    """Values of the reads whose reals keep to no range: what an environment may hold once a task has left its states."""
    wild = (*REALS, INF, -INF, NAN)
    for point in points(reads, chance, count):
        for r in reads:
            if r.type.kind is Kind.REAL:
                point[r.role, r.name] = tuple(chance.choice(wild) for _ in range(r.type.size))
        yield point


def _corner(read: Read, chance: random.Random) -> Any:
    return _typed(read, chance.choice(_ends(read)))


def _ends(read: Read) -> tuple[float, float]:
    """The ends of a range, something far where there is none."""
    if read.type.kind is Kind.BOOL:
        return 0, 1
    far = 2**62 if read.type.kind is Kind.INT else 1e300
    low = read.low if math.isfinite(read.low) else min(-far, read.high)
    return low, read.high if math.isfinite(read.high) else max(far, read.low)


def _inside(read: Read, chance: random.Random) -> Any:
    low, high = _ends(read)
    if read.type.kind is not Kind.REAL:
        inner = [v for v in (low + 1, high - 1, 0, 1, -1, (low + high) // 2) if low <= v <= high]
        return _typed(read, chance.choice(inner or [low]))
    between = low + chance.random() * (high - low) if math.isfinite(high - low) else chance.uniform(-4, 4)
    near = (math.nextafter(low, INF), math.nextafter(high, -INF), between, 0.0, -0.0, 1.0)
    return _typed(read, chance.choice([v for v in near if low <= v <= high] or [low]))


def _typed(read: Read, value: Any) -> Any:
    make: Callable[[Any], Any] = {BOOL.kind: bool, INT.kind: int, REAL.kind: float}[read.type.kind]
    return make(value)
