"""The lane form: core nodes as straight-line scalar Python for one environment, one assignment per shared node.

Small vectors become one expression per element ("atoms"); larger ones are packed in one tuple or list. What an operator
looks like comes from the operator table; how elements are arranged is decided here and in `lanestructure`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from taskspec.backends.emit.lanestructure import STRUCTURE
from taskspec.backends.emit.lanevalues import LaneValue, LaneValues
from taskspec.backends.emit.source import literal, tuple_of
from taskspec.lang.arrays import network
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, plain, walk
from taskspec.lang.operators import OPERATORS, Operator
from taskspec.lang.types import Kind
from taskspec.lang.variates import VARIATES
from taskspec.lang.variates.sample import one

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
        """Statements for the roots are appended to `lines`; the values refer to them."""
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
        items, sources, fills = [], [], []
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
        """Whether a divisor is finite and not 0, whatever reals come to be."""
        match divisor:
            case Const():
                return all(v and math.isfinite(v) for v in divisor.flat)
            case Apply(op="to_real", args=(whole,)):
                divisor = whole
        low, high = self.certain(divisor)
        return low > 0 or high < 0

    def _fill(self, template: str, args: Sequence[str]) -> str:
        """A template over arguments; one that is named twice gets a name of its own first."""
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
        """The elements with 0.0 for -0.0: of equals that can be told apart, a network keeps no order."""
        return [f"({a} + 0.0)" for a in self.atoms(x)] if x.type.kind is Kind.REAL else self.atoms(x)

    def _sorted(self, atoms: Sequence[str]) -> list[str]:
        """A sorting network (Batcher's odd-even merge sort); nan goes last."""
        names = [self.name() for _ in atoms]
        self.lines.append(f"{', '.join(names)}{',' * (len(names) == 1)} = {tuple_of(atoms)}")
        for i, j in network(len(names)):
            a, b = names[i], names[j]
            self.lines.append(f"if not ({a} <= {b} or {b} != {b}): {a}, {b} = {b}, {a}")
        return names

    def _running(self, atoms: Sequence[str]) -> list[str]:
        sums = [atoms[0]]
        for atom in atoms[1:]:
            sums.append(self.assign(f"({self.assign(sums[-1])} + {atom})"))
        return sums

    # -- draws whose distribution depends on the state ------------------------------------------------------------

    def _draw(self, node: Draw) -> LaneValue:
        words, form = self.words[node.site], VARIATES[node.base].lane
        if form is not None:
            return LaneValue(form(self, node, words))
        given = tuple_of([self.packed(a) for a in node.args])
        drawn = self.assign(f"{self.constant(one(node))}({given}, {tuple_of(words)})")
        return LaneValue(packed=drawn) if node.type.shape else LaneValue([f"{drawn}[0]"])

    def argument(self, draw: Draw) -> list[str]:
        """The first argument of a draw, an expression for each of its elements."""
        atoms = self.atoms(draw.args[0])
        return atoms * draw.type.size if len(atoms) == 1 else atoms


def _shown(roots: Sequence[Node], order: Sequence[Node]) -> set[int]:
    """The ids of what is read by something other than comparisons, for which 0.0 is -0.0."""
    users = [n for n in order if not (isinstance(n, Apply) and n.op in ("eq", "ne", "lt", "le"))]
    return {*map(id, roots), *(id(c) for n in users for c in children(n))}
