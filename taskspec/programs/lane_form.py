"""The lane form: core nodes as straight-line scalar Python for one environment.

Small vectors become one expression per element ("atoms"); larger ones are packed in one tuple or list. The form of an operator
is in the operator table.
"""

from __future__ import annotations

import marshal
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taskspec.language.expressions.batch import network
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, children, walk
from taskspec.language.expressions.operators import OPERATORS, Elements, Operator, entry_of
from taskspec.language.expressions.operators.vectors import strided
from taskspec.language.expressions.types import Kind, Role
from taskspec.language.expressions.variates import VARIATES, one
from taskspec.programs import literal, tuple_of, without_unused

UNROLLED = 16
"""Vectors up to this many elements become one expression for each."""
CHAINED = 64
"""Sums up to this many terms are written out."""
_ATOM = re.compile(r"-?[\w.]+(\[\d+\])?")


@dataclass(slots=True)
class LaneValue:
    """The source of a value: one expression per element, or the name of a flat sequence, or both."""

    atoms: list[str] | None = None
    packed: str | None = None


@dataclass()
class LaneEmitter:
    """Emits statements for nodes; subclasses do for other targets.

    Values may need statements of their own whenever they are asked for (`atoms`, `packed`), so the statements are handed out
    once, by `finish`, after everything that refers to them is known.

    Attributes:
        names: the source of every read.
        words: the names of the random words of every draw, by site.
        certain: bounds of a node (`Builder.certain`).
        constants: what the statements refer to.
        values: of the nodes so far, by id.
        unrolled: vectors up to this many elements become one expression for each.
    """

    names: Mapping[tuple[Role, str], LaneValue]
    words: Mapping[int, Sequence[str]]
    certain: Callable[[Node], tuple[float, float]]
    constants: dict[str, Any] = field(default_factory=dict)
    values: dict[int, LaneValue] = field(default_factory=dict)
    unrolled: int = UNROLLED
    fresh: int = 0
    _lines: list[str] = field(default_factory=list)
    _is_finished: bool = False
    _signed: set[int] = field(default_factory=set)  # ids of nodes whose zeros may show a sign

    def emit(self, roots: Iterable[Node]) -> list[LaneValue]:
        """Append the statements for the roots; return values that refer to them."""
        roots = tuple(roots)
        order = list(walk(roots))
        self._signed.update(map(id, roots))
        uses: dict[int, int] = {}
        for root in roots:
            uses[id(root)] = uses.get(id(root), 0) + 1
        for node in order:
            ranked = isinstance(node, Apply) and entry_of(node.op).elements is Elements.RANKED
            for child in children(node):
                uses[id(child)] = uses.get(id(child), 0) + 1
                if not ranked:  # for comparisons, 0.0 is -0.0
                    self._signed.add(id(child))
        for node in order:
            value = self._node(node)
            if value.atoms is not None and uses[id(node)] > 1:
                value.atoms = list(map(self.assign, value.atoms))
            self.values[id(node)] = value
        return [self.values[id(root)] for root in roots]

    def finish(self, after: Sequence[str] = (), results: Iterable[str] = ()) -> list[str]:
        """List all statements, and those `after` them, without assignments that neither these nor the `results` read.

        Raises:
            AssertionError: when a statement is appended later, which would be lost.
        """
        self._is_finished = True
        return without_unused([*self._lines, *after], results)

    def append(self, statement: str) -> None:
        assert not self._is_finished, f"a statement after the last one: {statement}"
        self._lines.append(statement)

    def name(self) -> str:
        self.fresh += 1
        return f"v{self.fresh}"

    def assign(self, text: str) -> str:
        """Assign an expression to a variable; atoms stay inline."""
        if _ATOM.fullmatch(text):
            return text
        return self.named(text)

    def named(self, text: str) -> str:
        """Assign an expression to a new variable."""
        name = self.name()
        self.append(f"{name} = {text}")
        return name

    def constant(self, value: Any) -> str:
        """Name a value that is kept outside the function; tuples of the same numbers are kept once."""
        for name, known in self.constants.items():
            if known is value:
                return name
            same = isinstance(known, tuple) and isinstance(value, tuple) and known == value
            # (1, 0) equals (True, False), and 0.0 equals -0.0; version 2 knows no references.
            if same and marshal.dumps(known, 2) == marshal.dumps(value, 2):
                return name
        name = f"C{len(self.constants)}"
        self.constants[name] = value
        return name

    def unpack(self, count: int, source: str) -> list[str]:
        """Unpack a sequence into new variables, one for each element."""
        names = [self.name() for _ in range(count)]
        self.append(f"{', '.join(names)}{',' * (count == 1)} = {source}")
        return names

    def atoms(self, node: Node) -> list[str]:
        """One expression per element, row-major."""
        value = self.values[id(node)]
        if value.atoms is None:
            value.atoms = self.unpack(node.type.size, str(value.packed))
        return value.atoms

    def packed(self, node: Node) -> str:
        """Variable of a flat sequence of the elements."""
        value = self.values[id(node)]
        if value.packed is None:
            value.packed = self.assign(tuple_of(self.atoms(node)))
        return value.packed

    def scalar(self, node: Node) -> str:
        return self.atoms(node)[0]

    def scalar_of(self, node: Node) -> str:
        """Variable of a number that may not be a direct argument; it was emitted with the others."""
        value = self.values[id(node)]
        value.atoms = list(map(self.assign, self.atoms(node)))
        return value.atoms[0]

    def argument(self, draw: Draw) -> list[str]:
        """First argument of a draw, an expression for each of its elements."""
        atoms = self.atoms(draw.args[0])
        if len(atoms) == 1:
            return atoms * draw.type.size
        return atoms

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
                if entry.elementwise:
                    return self._elementwise(node, entry)
                return self._reduction(node, entry)
            case Apply():
                return self._structure(node)

    def _structure(self, node: Apply) -> LaneValue:
        return STRUCTURE[node.op](self, node)

    def _const(self, node: Const) -> LaneValue:
        if node.type.size <= self.unrolled:
            return LaneValue(list(map(literal, node.numbers)))
        return LaneValue(packed=self.constant(node.numbers))

    def _elementwise(self, node: Apply, entry: Operator) -> LaneValue:
        template = self._template(node, entry)
        if node.type.size > self.unrolled and any(self.values[id(a)].atoms is None for a in node.args):
            return self._loop(node, template)
        columns = list(map(self.atoms, node.args))
        for i, arg in enumerate(node.args):
            if node.type.shape and not arg.type.shape:
                columns[i] = [self.assign(columns[i][0])] * node.type.size
        return LaneValue([self._fill(template, row) for row in zip(*columns, strict=True)])

    def _loop(self, node: Apply, template: str) -> LaneValue:
        sources: dict[str, str] = {}
        fills = []
        for i, arg in enumerate(node.args):
            if arg.type.shape:
                sources[f"x{i}"] = self.packed(arg)
                fills.append(f"x{i}")
            else:
                fills.append(self.assign(self.scalar(arg)))
        items = ", ".join(sources)
        source = ", ".join(sources.values())
        if len(sources) > 1:
            source = f"zip({source})"
        return LaneValue(packed=self.assign(f"[{template.format(*fills)} for {items} in {source}]"))

    def _template(self, node: Apply, entry: Operator) -> str:
        form = entry.scalar
        if form.divides is not None and self._never_zero(node.args[1]):
            return form.divides
        real = any(a.type.kind is Kind.REAL for a in node.args)
        return (real and form.real) or form.template

    def _never_zero(self, divisor: Node) -> bool:
        match divisor:
            case Const():
                return all(v and math.isfinite(v) for v in divisor.flat)
            case Apply(op="to_real", args=(whole,)):
                divisor = whole
        low, high = self.certain(divisor)
        return low > 0 or high < 0

    def _fill(self, template: str, args: Sequence[str]) -> str:
        named = list(args)
        for i, arg in enumerate(args):
            if template.count(f"{{{i}}}") > 1:
                named[i] = self.assign(arg)
        text = template.format(*named)
        if len(text) > 110:
            return self.assign(text)
        return text

    def _reduction(self, node: Apply, entry: Operator) -> LaneValue:
        (x,) = node.args
        chain = entry.scalar.chain
        if chain is not None and x.type.size <= CHAINED:
            atoms = self.atoms(x) or [chain[1]]
            if node.op == "count":
                atoms = [f"(1 if {a} else 0)" for a in atoms]
            return LaneValue([f"({chain[0].join(atoms)})"])
        if node.op == "sort" and x.type.size <= self.unrolled:
            return LaneValue(self._sorted(x, id(node) in self._signed))
        if node.op == "cumsum" and x.type.size <= self.unrolled:
            return LaneValue(self._running(self.atoms(x)))
        template = entry.scalar.template
        if x.type.kind is not Kind.REAL:
            template = entry.scalar.whole or template
        call = template.format(self.packed(x))
        if node.type.shape:
            return LaneValue(packed=self.assign(call))
        return LaneValue([call])

    def _sorted(self, x: Node, signed: bool) -> list[str]:
        """Write a sorting network (Batcher's odd-even merge sort); nan goes last."""
        atoms = self.atoms(x)
        if signed and x.type.kind is Kind.REAL:  # of equals that can be told apart, a network keeps no order
            atoms = [f"({a} + 0.0)" for a in atoms]
        names = self.unpack(len(atoms), tuple_of(atoms))
        for i, j in network(len(names)):
            a = names[i]
            b = names[j]
            self.append(f"if not ({a} <= {b} or {b} != {b}): {a}, {b} = {b}, {a}")
        return names

    def _running(self, atoms: Sequence[str]) -> list[str]:
        sums = [atoms[0]]
        for atom in atoms[1:]:
            sums.append(self.assign(f"({self.assign(sums[-1])} + {atom})"))
        return sums

    def _draw(self, node: Draw) -> LaneValue:
        words = self.words[node.site]
        form = VARIATES[node.base].lane
        if form is not None:
            return LaneValue(form(self, node, words))
        given = tuple_of(list(map(self.packed, node.args)))
        drawn = self.assign(f"{self.constant(one(node))}({given}, {tuple_of(words)})")
        if node.type.shape:
            return LaneValue(packed=drawn)
        return LaneValue([f"{drawn}[0]"])


# -- operators that only move elements ----------------------------------------------------------------------------


def _vector(lane: LaneEmitter, node: Apply) -> LaneValue:
    if node.type.size <= lane.unrolled:
        atoms = []
        for arg in node.args:
            atoms += lane.atoms(arg)
        return LaneValue(atoms)
    parts = []
    for a in node.args:
        if a.type.size > lane.unrolled:
            parts.append(f"*{lane.packed(a)}")
        else:
            parts.append(", ".join(lane.atoms(a)))
    return LaneValue(packed=lane.assign(tuple_of(parts)))


def _slice(lane: LaneEmitter, node: Apply) -> LaneValue:
    start, count, step = node.static
    row = strided(node.args[0].type.shape)
    value = lane.values[id(node.args[0])]
    places = []
    for k in range(count):
        for i in range(row):
            places.append((start + k * step) * row + i)
    if value.atoms is not None:
        return LaneValue([value.atoms[p] for p in places])
    if row != 1 and step != 1:
        return LaneValue(packed=lane.assign(tuple_of([f"{value.packed}[{p}]" for p in places])))
    stop = (start + count * step) * row
    end = stop if stop >= 0 else ""
    return LaneValue(packed=lane.assign(f"{value.packed}[{start * row}:{end}:{step}]"))


def _element(lane: LaneEmitter, node: Apply) -> LaneValue:
    row = node.type.size
    first = node.static[0] * row
    value = lane.values[id(node.args[0])]
    if value.atoms is not None:
        return LaneValue(value.atoms[first : first + row])
    if not node.type.shape:
        return LaneValue([f"{value.packed}[{first}]"])
    return LaneValue(packed=lane.assign(f"{value.packed}[{first}:{first + row}]"))


def _reshape(lane: LaneEmitter, node: Apply) -> LaneValue:
    return lane.values[id(node.args[0])]


def _fill(lane: LaneEmitter, node: Apply) -> LaneValue:
    atom = lane.assign(lane.scalar(node.args[0]))
    if node.type.size <= lane.unrolled:
        return LaneValue([atom] * node.type.size)
    return LaneValue(packed=lane.assign(f"({atom},) * {node.type.size}"))


def _index(lane: LaneEmitter, node: Apply) -> LaneValue:
    x, i = node.args
    row = strided(x.type.shape)
    picked = [_row(lane, x, index, row) for index in lane.atoms(i)]
    if len(picked) == 1:
        return picked[0]
    if all(p.atoms is not None for p in picked):
        atoms: list[str] = []
        for p in picked:
            atoms += p.atoms or ()
        return LaneValue(atoms)
    return LaneValue(packed=lane.assign(f"({', '.join(f'*{p.packed}' for p in picked)})"))


def _row(lane: LaneEmitter, x: Node, index: str, row: int) -> LaneValue:
    """One row of x: an expression when it is a single element; constants are kept outside the step."""
    flat = None
    if isinstance(x, Const):
        flat = x.numbers
    if row != 1 and flat is not None:
        rows = tuple(flat[k : k + row] for k in range(0, len(flat), row))
        return LaneValue(packed=lane.assign(f"{lane.constant(rows)}[{index}]"))
    if row != 1:
        index = lane.assign(index)
        return LaneValue(packed=lane.assign(f"{lane.packed(x)}[{index} * {row}:{index} * {row} + {row}]"))
    if flat is not None:
        return LaneValue([f"{lane.constant(flat)}[{index}]"])
    value = lane.values[id(x)]
    short = value.packed is None and len(value.atoms or ()) <= lane.unrolled
    if short:
        sequence = tuple_of(lane.atoms(x))
    else:
        sequence = lane.packed(x)
    return LaneValue([f"{sequence}[{index}]"])


def _put(lane: LaneEmitter, node: Apply) -> LaneValue:
    x, i, value = node.args
    row = value.type.size
    name = lane.name()
    lane.append(f"{name} = list({lane.packed(x)})")
    if row == 1:
        lane.append(f"{name}[{lane.scalar(i)}] = {lane.scalar(value)}")
    else:
        at = lane.assign(lane.scalar(i))
        lane.append(f"{name}[{at} * {row}:{at} * {row} + {row}] = {lane.packed(value)}")
    return LaneValue(packed=name)


def _swap(lane: LaneEmitter, node: Apply) -> LaneValue:
    x, i, j = node.args
    row = strided(x.type.shape)
    name = lane.name()
    a = lane.assign(lane.scalar(i))
    b = lane.assign(lane.scalar(j))
    lane.append(f"{name} = list({lane.packed(x)})")
    if row == 1:
        lane.append(f"{name}[{a}], {name}[{b}] = {name}[{b}], {name}[{a}]")
    else:
        p, q = (f"{name}[{k} * {row}:{k} * {row} + {row}]" for k in (a, b))
        lane.append(f"{p}, {q} = {q}, {p}")
    return LaneValue(packed=name)


STRUCTURE: dict[str, Callable[[LaneEmitter, Apply], LaneValue]] = {
    "vector": _vector,
    "concat": _vector,
    "slice": _slice,
    "element": _element,
    "reshape": _reshape,
    "fill": _fill,
    "index": _index,
    "put": _put,
    "swap": _swap,
}
"""The value of a node of `lang.operators.structure`, whose arguments have theirs."""
