"""The array form: core nodes as straight-line array code with the lanes last, one assignment per shared node.

The form of an operator is in the operator table. With scratch arrays (NumPy), operators that are one ufunc
write into preallocated arrays, which are used again once nothing reads them any more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, are_constant, children, plain, walk
from taskspec.language.expressions.operators import OPERATORS, Operator
from taskspec.language.expressions.types import Kind, Role, Type
from taskspec.programs import literal

Drawn = Callable[[Draw, Sequence[str]], str]
"""The source of a draw from the sources of its arguments."""

UFUNCS: dict[str, str] = {
    "({0} + {1})": "add",
    "({0} - {1})": "subtract",
    "({0} * {1})": "multiply",
    "({0} / {1})": "divide",
    "(-{0})": "negative",
    "({0} == {1})": "equal",
    "({0} != {1})": "not_equal",
    "({0} < {1})": "less",
    "({0} <= {1})": "less_equal",
    "xp.abs({0})": "absolute",
    "xp.minimum({0}, {1})": "minimum",
    "xp.maximum({0}, {1})": "maximum",
    "xp.fmin({0}, {1})": "fmin",
    "xp.fmax({0}, {1})": "fmax",
    "xp.sqrt({0})": "sqrt",
    "xp.logical_not({0})": "logical_not",
    "xp.logical_and({0}, {1})": "logical_and",
    "xp.logical_or({0}, {1})": "logical_or",
}
"""Array templates that are one ufunc, which can write into an array that is given."""
_CASTS = frozenset({"to_int", "to_real"})
_DTYPE = {Kind.BOOL: "bool_", Kind.INT: "int64", Kind.REAL: "float64"}
_VIEWS = frozenset({"slice", "element", "reshape", "fill"})


@dataclass
class Scratch:
    """Arrays to write into: a pool for each type, and who holds which."""

    free: dict[Type, list[str]] = field(default_factory=dict)
    made: dict[str, Type] = field(default_factory=dict)

    def take(self, type_: Type) -> str:
        pool = self.free.setdefault(type_, [])
        if pool:
            return pool.pop()
        name = f"b{len(self.made)}"
        self.made[name] = type_
        return name

    def give(self, name: str) -> None:
        self.free.setdefault(self.made[name], []).append(name)

    @property
    def declarations(self) -> list[str]:
        """Statements that allocate the arrays for n lanes."""
        lines = []
        for name, t in self.made.items():
            shape = "".join(f"{k}, " for k in t.shape)
            lines.append(f"{name} = np.empty(({shape}n{',' * (not t.shape)}), np.{_DTYPE[t.kind]})")
        return lines


@dataclass(frozen=True)
class Sink:
    """An array of the program that is to hold the value of a node.

    It is written as soon as the value is known, if nothing reads what it holds, the nodes of these ids, after that.
    """

    name: str
    held: frozenset[int] = frozenset()


@dataclass
class ArrayForm:
    """Emits statements for nodes.

    `names` gives the source of every read, `drawn` the source of every draw; `constants` collects the arrays that are
    referred to.
    """

    names: Mapping[tuple[Role, str], str]
    drawn: Drawn
    constants: dict[str, Any] = field(default_factory=dict)
    scratch: Scratch | None = None
    sinks: Mapping[int, Sink] = field(default_factory=dict)  # by id of a node
    fresh: int = 0
    _lines: list[str] = field(default_factory=list)
    _place: int = 0
    _numbers: dict[tuple[Kind, str], str] = field(default_factory=dict)
    _values: dict[int, str] = field(default_factory=dict)
    _buffers: dict[int, str] = field(default_factory=dict)  # by id of the node that owns it
    _owner: dict[int, int] = field(default_factory=dict)  # of a view: the node whose array it shows
    _last: dict[int, int] = field(default_factory=dict)

    def emit(self, roots: Iterable[Node]) -> tuple[list[str], list[str]]:
        """Write the statements for the roots, and the source of each root."""
        roots = tuple(roots)
        order = list(walk(roots))
        for place, node in enumerate(order):
            for child in children(node):
                owner = self.owner(child)
                self._last[owner] = place
                if isinstance(node, Apply) and _shares_memory(node):
                    self._owner[id(node)] = owner
        for root in roots:
            self._last[self.owner(root)] = len(order)
        for self._place, node in enumerate(order):
            self._values[id(node)] = self._node(node)
            for owner in dict.fromkeys(map(self.owner, children(node))):
                if self._last.get(owner) == self._place and owner in self._buffers and self.scratch is not None:
                    self.scratch.give(self._buffers.pop(owner))
        return self._lines, [self._values[id(root)] for root in roots]

    def owner(self, node: Node) -> int:
        """Id of the node whose array holds the value of a node."""
        return self._owner.get(id(node), id(node))

    def constant(self, value: Any) -> str:
        name = f"C{len(self.constants)}"
        self.constants[name] = value
        return name

    def _assign(self, text: str) -> str:
        self.fresh += 1
        self._lines.append(f"v{self.fresh} = {text}")
        return f"v{self.fresh}"

    def _node(self, node: Node) -> str:
        match node:
            case Const() if node.type.is_scalar:
                return literal(plain(node.value))
            case Const():
                return self._held(node)
            case Read(role=role, name=name):
                return self.names[role, name]
            case Draw():
                return self._assign(self.drawn(node, list(map(self._array, node.args))))
            case Apply(op=op) if op in OPERATORS:
                return self._function(node, OPERATORS[op])
            case Apply():
                return self._structure(node)

    def _held(self, node: Const) -> str:
        for known, value in self.constants.items():
            if value is node:
                return known
        return self.constant(node)

    def _function(self, node: Apply, entry: Operator) -> str:
        args = [self._values[id(a)] for a in node.args]
        if node.op in _CASTS:
            return self._cast(node, args[0])
        template = self._template(node, entry)
        ufunc = UFUNCS.get(template)
        if ufunc is None or self.scratch is None or are_constant(node.args):
            return self._assign(template.format(*args))
        args = list(map(self._operand, node.args))
        out = self._buffer(node)
        if ufunc in ("minimum", "maximum"):  # these two insist
            keyword = "out="
        else:
            keyword = ""
        self._lines.append(f"{ufunc}({', '.join(args)}, {keyword}{out})")
        return out

    def _operand(self, node: Node) -> str:
        """Source of an operand; a number is an array, since NumPy would make one of it in every call."""
        if not isinstance(node, Const) or not node.type.is_scalar:
            return self._values[id(node)]
        value = plain(node.value)
        kind = node.type.kind
        key = (kind, repr(value))  # tells -0.0 from 0.0
        if key not in self._numbers:
            self._numbers[key] = self.constant(np.array(value, getattr(np, _DTYPE[kind])))
        return self._numbers[key]

    def _buffer(self, node: Node, in_place: bool = True) -> str:
        """Choose a buffer for a value; `in_place` says that it may be an array which is read in the same call."""
        assert self.scratch is not None
        sink = self.sinks.get(id(node))
        if sink is not None and all(self._last.get(held, -1) < self._place + in_place for held in sink.held):
            return sink.name
        name = self.scratch.take(node.type)
        self._buffers[id(node)] = name
        return name

    def _cast(self, node: Apply, arg: str) -> str:
        if node.args[0].type.kind is node.type.kind:
            return arg
        if self.scratch is None:
            return self._assign(f"rt.{'as_int' if node.op == 'to_int' else 'as_real'}({arg})")
        out = self._buffer(node)
        self._lines.append(f"copyto({out}, {arg})")
        return out

    def _template(self, node: Apply, entry: Operator) -> str:
        if not any(a.type.kind is Kind.REAL for a in node.args):
            return entry.array.template
        if entry.array.nonzero is not None and any(isinstance(a, Const) and all(a.flat) for a in node.args):
            return entry.array.nonzero
        return entry.array.real or entry.array.template

    def _structure(self, node: Apply) -> str:
        args = [self._values[id(a)] for a in node.args]
        static = node.static
        match node.op:
            case "slice":
                start, count, step = static
                stop = start + count * step
                return self._assign(f"{args[0]}[{start}:{'' if stop < 0 else stop}:{step}]")
            case "element":
                return self._assign(f"{args[0]}[{static[0]}]")
            case "reshape":
                shape = "".join(f"{n}, " for n in static)
                return self._assign(f"{args[0]}.reshape({shape}-1)")
            case "fill":
                return self._assign(f"rt.fill({args[0]}, {static!r})")
            case "index" if _is_look_up(node):
                table = self.constant(_LookupTable(node.args[0]))
                axis = len(node.args[0].type.shape) - 1
                if self.scratch is None:
                    return self._assign(f"rt.look_up({table}, {args[1]}, {axis})")
                out = self._buffer(node, in_place=False)
                self._lines.append(f'{table}.take({args[1]}, {axis}, {out}, "clip")')
                return out
            case op:
                name = {"vector": "stack"}.get(op, op)
                return self._assign(f"rt.{name}({', '.join(map(self._array, node.args))})")

    def _array(self, node: Node) -> str:
        """Structural operators and draws need arrays, where a constant scalar is a mere number."""
        if isinstance(node, Const) and node.type.is_scalar:
            return self._held(node)
        return self._values[id(node)]


def _is_look_up(node: Apply) -> bool:
    table, place = node.args
    return isinstance(table, Const) and len(table.type.shape) <= 2 and place.type.is_scalar


@dataclass(frozen=True)
class _LookupTable:
    """Marks a constant that is wanted for look-ups: without an axis for the lanes, indexed along its last axis."""

    node: Node


def _shares_memory(node: Apply) -> bool:
    """Test whether the value may be memory of the argument: views, casts to the same kind, sums of one element."""
    if node.op in _CASTS:
        return node.args[0].type.kind is node.type.kind
    return node.op in _VIEWS or (node.op in ("sum", "prod") and node.args[0].type.size == 1)


def arrays(constants: Mapping[str, Any], make: Callable[[Const], Any]) -> dict[str, Any]:
    """Convert constants to arrays: (*shape, 1), so that they broadcast, or tables where marked."""
    made = {}
    for name, value in constants.items():
        match value:
            case _LookupTable(node=Const() as node):
                made[name] = make(node)[..., 0].T.copy()
            case Const():
                made[name] = make(value)
            case _:
                made[name] = value
    return made
