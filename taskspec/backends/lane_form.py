"""The lane form: core nodes as straight-line scalar Python for one environment."""

from __future__ import annotations

import marshal
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taskspec.backends.source_text import literal, tuple_of
from taskspec.lang.batch import network
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, plain, walk
from taskspec.lang.operators import OPERATORS, Elements, Operator, entry_of
from taskspec.lang.operators.vectors import strided
from taskspec.lang.types import Kind
from taskspec.lang.variates import VARIATES, one

UNROLLED = 16
"""Vectors up to this many elements become one expression for each."""
_ATOM = re.compile(r"-?[\w.]+(\[\d+\])?")


@dataclass(slots=True)
class LaneValue:
    """The source of a value: one expression per element, or the name of a flat sequence, or both."""

    atoms: list[str] | None = None
    packed: str | None = None

    @property
    def text(self) -> str:
        assert self.atoms is not None
        return self.atoms[0]


@dataclass(kw_only=True)
class LaneValues:
    """The values of nodes so far, the statements that work them out, and the constants that these refer to.

    With `unrolled` large enough, every element is an expression of its own.
    """

    constants: dict[str, Any] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    values: dict[int, LaneValue] = field(default_factory=dict)
    fresh: int = 0
    unrolled: int = UNROLLED

    def name(self) -> str:
        self.fresh += 1
        return f"v{self.fresh}"

    def assign(self, text: str) -> str:
        """Return a name for an expression; atoms need none."""
        return text if _ATOM.fullmatch(text) else self.named(text)

    def named(self, text: str) -> str:
        """Return a new name for an expression."""
        name = self.name()
        self.lines.append(f"{name} = {text}")
        return name

    def constant(self, value: Any) -> str:
        """Return the name of a value that is kept outside the function; tuples of the same numbers are kept once."""
        for name, known in self.constants.items():
            if known is value or _identical(known, value):
                return name
        name = f"C{len(self.constants)}"
        self.constants[name] = value
        return name

    def _shared(self, value: LaneValue) -> LaneValue:
        if value.atoms is not None:
            value.atoms = [self.assign(a) for a in value.atoms]
        return value

    def atoms(self, node: Node) -> list[str]:
        """Return one expression per element, row-major."""
        value = self.values[id(node)]
        if value.atoms is None:
            assert value.packed is not None
            names = [self.name() for _ in range(node.type.size)]
            self.lines.append(f"{', '.join(names)}{',' * (len(names) == 1)} = {value.packed}")
            value.atoms = names
        return value.atoms

    def packed(self, node: Node) -> str:
        """Return the name of a flat sequence of the elements."""
        value = self.values[id(node)]
        if value.packed is None:
            value.packed = self.assign(tuple_of(self.atoms(node)))
        return value.packed

    def scalar(self, node: Node) -> str:
        return self.atoms(node)[0]

    def scalar_of(self, node: Node) -> str:
        """Return the source of a node that may not be a direct argument; it was emitted with the others."""
        value = self.values[id(node)]
        value.atoms = [self.assign(a) for a in self.atoms(node)]
        return value.atoms[0]


def _identical(a: Any, b: Any) -> bool:
    """Return whether two tuples hold the same numbers of the same types: (1, 0) equals (True, False), and 0.0 equals -0.0."""
    alike = isinstance(a, tuple) and isinstance(b, tuple) and a == b
    return alike and marshal.dumps(a, 2) == marshal.dumps(b, 2)  # of version 2, which knows no references


# -- operators that only move elements ----------------------------------------------------------------------------


def _vector(lane: LaneValues, node: Apply) -> LaneValue:
    if node.type.size <= lane.unrolled:
        return LaneValue([atom for arg in node.args for atom in lane.atoms(arg)])
    parts = [f"*{lane.packed(a)}" if a.type.size > lane.unrolled else ", ".join(lane.atoms(a)) for a in node.args]
    return LaneValue(packed=lane.assign(tuple_of(parts)))


def _slice(lane: LaneValues, node: Apply) -> LaneValue:
    start, count, step = node.static
    row = strided(node.args[0].type.shape)
    value = lane.values[id(node.args[0])]
    places = [(start + k * step) * row + i for k in range(count) for i in range(row)]
    if value.atoms is not None:
        return LaneValue([value.atoms[p] for p in places])
    if row == 1 or step == 1:
        stop: int | None = (start + count * step) * row
        stop = None if stop is not None and stop < 0 else stop
        return LaneValue(
            packed=lane.assign(
                f"{value.packed}[{start * row}:{'' if stop is None else stop}:{step if row == 1 else 1}]"
            )
        )
    return LaneValue(packed=lane.assign(tuple_of([f"{value.packed}[{p}]" for p in places])))


def _element(lane: LaneValues, node: Apply) -> LaneValue:
    row = node.type.size
    first = node.static[0] * row
    value = lane.values[id(node.args[0])]
    if value.atoms is not None:
        return LaneValue(value.atoms[first : first + row])
    if not node.type.shape:
        return LaneValue([f"{value.packed}[{first}]"])
    return LaneValue(packed=lane.assign(f"{value.packed}[{first}:{first + row}]"))


def _fill(lane: LaneValues, node: Apply) -> LaneValue:
    atom = lane.assign(lane.scalar(node.args[0]))
    if node.type.size <= lane.unrolled:
        return LaneValue([atom] * node.type.size)
    return LaneValue(packed=lane.assign(f"({atom},) * {node.type.size}"))


def _index(lane: LaneValues, node: Apply) -> LaneValue:
    x, i = node.args
    row = strided(x.type.shape)
    picked = [_row(lane, x, index, row) for index in lane.atoms(i)]
    if len(picked) == 1:
        return picked[0]
    if all(p.atoms is not None for p in picked):
        return LaneValue([a for p in picked for a in p.atoms or ()])
    return LaneValue(packed=lane.assign(f"({', '.join(f'*{p.packed}' for p in picked)})"))


def _row(lane: LaneValues, x: Node, index: str, row: int) -> LaneValue:
    """Return one row of x: an expression when it is a single element."""
    if row == 1:
        return LaneValue([f"{_sequence(lane, x)}[{index}]"])
    if isinstance(x, Const):
        flat = [plain(v) for v in x.flat]
        rows = tuple(tuple(flat[k : k + row]) for k in range(0, len(flat), row))
        return LaneValue(packed=lane.assign(f"{lane.constant(rows)}[{index}]"))
    index = lane.assign(index)
    return LaneValue(packed=lane.assign(f"{lane.packed(x)}[{index} * {row}:{index} * {row} + {row}]"))


def _sequence(lane: LaneValues, x: Node) -> str:
    """Return a flat sequence to index; a constant one is kept outside the step."""
    if isinstance(x, Const):
        return lane.constant(tuple(plain(v) for v in x.flat))
    value = lane.values[id(x)]
    if value.packed is None and len(value.atoms or ()) <= lane.unrolled:
        return tuple_of(lane.atoms(x))
    return lane.packed(x)


def _put(lane: LaneValues, node: Apply) -> LaneValue:
    x, i, value = node.args
    row = value.type.size
    name = lane.name()
    lane.lines.append(f"{name} = list({lane.packed(x)})")
    if row == 1:
        lane.lines.append(f"{name}[{lane.scalar(i)}] = {lane.scalar(value)}")
    else:
        at = lane.assign(lane.scalar(i))
        lane.lines.append(f"{name}[{at} * {row}:{at} * {row} + {row}] = {lane.packed(value)}")
    return LaneValue(packed=name)


def _swap(lane: LaneValues, node: Apply) -> LaneValue:
    x, i, j = node.args
    row = strided(x.type.shape)
    name = lane.name()
    a = lane.assign(lane.scalar(i))
    b = lane.assign(lane.scalar(j))
    lane.lines.append(f"{name} = list({lane.packed(x)})")
    if row == 1:
        lane.lines.append(f"{name}[{a}], {name}[{b}] = {name}[{b}], {name}[{a}]")
    else:
        p, q = (f"{name}[{k} * {row}:{k} * {row} + {row}]" for k in (a, b))
        lane.lines.append(f"{p}, {q} = {q}, {p}")
    return LaneValue(packed=name)


STRUCTURE: dict[str, Callable[[LaneValues, Apply], LaneValue]] = {
    "vector": _vector,
    "concat": _vector,
    "slice": _slice,
    "element": _element,
    "reshape": lambda lane, node: lane.values[id(node.args[0])],
    "fill": _fill,
    "index": _index,
    "put": _put,
    "swap": _swap,
}
"""The value of a node of `lang.operators.structure`, whose arguments have theirs."""


# -- the emitter --------------------------------------------------------------------------------------------------
#
# Small vectors become one expression per element ("atoms"); larger ones are packed in one tuple or list. What an operator
# looks like comes from the operator table; how elements are arranged is decided here and in `lanestructure`.

CHAINED = 64
"""Sums up to this many terms are written out."""


@dataclass
class LaneEmitter(LaneValues):
    """Emits statements for nodes; subclasses do for other targets.

    `names` gives the source of every read; `words` the names of the random words of every draw, by site. `certain`
    gives bounds of a node (`Builder.certain`).
    """

    names: Mapping[tuple[Role, str], LaneValue]
    words: Mapping[int, Sequence[str]]
    certain: Callable[[Node], tuple[float, float]]
    shown: set[int] = field(default_factory=set)  # ids of nodes whose zeros may show a sign

    def emit(self, roots: Iterable[Node]) -> list[LaneValue]:
        """Return statements for the roots are appended to `lines`; the values refer to them."""
        roots = tuple(roots)
        order = list(walk(roots))
        self.shown |= _shown(roots, order)
        uses: dict[int, int] = {}
        for node in (*roots, *(c for n in order for c in children(n))):
            uses[id(node)] = uses.get(id(node), 0) + 1
        for node in order:
            value = self._node(node)
            self.values[id(node)] = self._shared(value) if uses[id(node)] > 1 else value
        return [self.values[id(root)] for root in roots]

    # -- nodes ----------------------------------------------------------------------------------------------------

    def _node(self, node: Node) -> LaneValue:
        match node:
            case Const():
                return self._const(node)
            case Read(role=role, name=name):
                return self.names[role, name]
            case Draw():
                return self._draw(node)
            case Apply(op=op) if op in OPERATORS:
                entry = OPERATORS[op]
                return self._elementwise(node, entry) if entry.elementwise else self._reduction(node, entry)
            case Apply(op=op):
                return self._structure(node)

    def _structure(self, node: Apply) -> LaneValue:
        return STRUCTURE[node.op](self, node)

    def _const(self, node: Const) -> LaneValue:
        flat = [plain(v) for v in node.flat]
        if node.type.size <= self.unrolled:
            return LaneValue([literal(v) for v in flat])
        return LaneValue(packed=self.constant(tuple(flat)))

    def _elementwise(self, node: Apply, entry: Operator) -> LaneValue:
        template = self._template(node, entry)
        if node.type.size <= self.unrolled or all(self.values[id(a)].atoms is not None for a in node.args):
            columns = [self.atoms(a) if a.type.shape else [self.scalar(a)] * node.type.size for a in node.args]
            if node.type.shape:
                columns = [
                    c if a.type.shape else [self.assign(c[0])] * len(c) for c, a in zip(columns, node.args, strict=True)
                ]
            return LaneValue([self._fill(template, row) for row in zip(*columns, strict=True)])
        items = []
        sources = []
        fills = []
        for i, arg in enumerate(node.args):
            if arg.type.shape:
                items.append(f"x{i}")
                sources.append(self.packed(arg))
                fills.append(f"x{i}")
            else:
                fills.append(self.assign(self.scalar(arg)))
        body = template.format(*fills)
        loop = (
            f"for {items[0]} in {sources[0]}"
            if len(items) == 1
            else f"for {', '.join(items)} in zip({', '.join(sources)})"
        )
        return LaneValue(packed=self.assign(f"[{body} {loop}]"))

    def _template(self, node: Apply, entry: Operator) -> str:
        form = entry.scalar
        if form.divides is not None and self._never_zero(node.args[1]):
            return form.divides
        real = any(a.type.kind is Kind.REAL for a in node.args)
        return form.real if real and form.real else form.template

    def _never_zero(self, divisor: Node) -> bool:
        """Return whether a divisor is finite and not 0, whatever reals come to be."""
        match divisor:
            case Const():
                return all(v and math.isfinite(v) for v in divisor.flat)
            case Apply(op="to_real", args=(whole,)):
                divisor = whole
        low, high = self.certain(divisor)
        return low > 0 or high < 0

    def _fill(self, template: str, args: Sequence[str]) -> str:
        """Return a template over arguments; one that is named twice gets a name of its own first."""
        named = [a if template.count(f"{{{i}}}") < 2 else self.assign(a) for i, a in enumerate(args)]
        text = template.format(*named)
        return self.assign(text) if len(text) > 110 else text

    # -- reductions -----------------------------------------------------------------------------------------------

    def _reduction(self, node: Apply, entry: Operator) -> LaneValue:
        (x,) = node.args
        chain = entry.scalar.chain
        if chain is not None and x.type.size <= CHAINED:
            atoms = self.atoms(x) or [chain[1]]
            if node.op == "count":
                atoms = [f"(1 if {a} else 0)" for a in atoms]
            return LaneValue([f"({chain[0].join(atoms)})"])
        if node.op == "sort" and x.type.size <= self.unrolled:
            return LaneValue(self._sorted(self._without_signs(x) if id(node) in self.shown else self.atoms(x)))
        if node.op == "cumsum" and x.type.size <= self.unrolled:
            return LaneValue(self._running(self.atoms(x)))
        whole = entry.scalar.whole if x.type.kind is not Kind.REAL else None
        call = (whole or entry.scalar.template).format(self.packed(x))
        return LaneValue(packed=self.assign(call)) if node.type.shape else LaneValue([call])

    def _without_signs(self, x: Node) -> list[str]:
        """Return the elements with 0.0 for -0.0: of equals that can be told apart, a network keeps no order."""
        return [f"({a} + 0.0)" for a in self.atoms(x)] if x.type.kind is Kind.REAL else self.atoms(x)

    def _sorted(self, atoms: Sequence[str]) -> list[str]:
        """Return a sorting network (Batcher's odd-even merge sort); nan goes last."""
        names = [self.name() for _ in atoms]
        self.lines.append(f"{', '.join(names)}{',' * (len(names) == 1)} = {tuple_of(atoms)}")
        for i, j in network(len(names)):
            a = names[i]
            b = names[j]
            self.lines.append(f"if not ({a} <= {b} or {b} != {b}): {a}, {b} = {b}, {a}")
        return names

    def _running(self, atoms: Sequence[str]) -> list[str]:
        sums = [atoms[0]]
        for atom in atoms[1:]:
            sums.append(self.assign(f"({self.assign(sums[-1])} + {atom})"))
        return sums

    # -- draws whose distribution depends on the state ------------------------------------------------------------

    def _draw(self, node: Draw) -> LaneValue:
        words = self.words[node.site]
        form = VARIATES[node.base].lane
        if form is not None:
            return LaneValue(form(self, node, words))
        given = tuple_of([self.packed(a) for a in node.args])
        drawn = self.assign(f"{self.constant(one(node))}({given}, {tuple_of(words)})")
        return LaneValue(packed=drawn) if node.type.shape else LaneValue([f"{drawn}[0]"])

    def argument(self, draw: Draw) -> list[str]:
        """Return the first argument of a draw, an expression for each of its elements."""
        atoms = self.atoms(draw.args[0])
        return atoms * draw.type.size if len(atoms) == 1 else atoms


def _shown(roots: Sequence[Node], order: Sequence[Node]) -> set[int]:
    """Return the ids of what is read by something other than comparisons, for which 0.0 is -0.0."""
    users = [n for n in order if not (isinstance(n, Apply) and entry_of(n.op).elements is Elements.RANKED)]
    return {*map(id, roots), *(id(c) for n in users for c in children(n))}
