"""The lane form for compiled kernels: an expression for every element, selects instead of branches, narrow integers.

Subclasses the emitter of the scalar program; what differs is the target: all values are named scalars, both sides of a
condition are worked out, and small tables are chains of selects, so that a loop over lanes turns into vector code.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from taskspec.language.expressions.batch import network
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, walk
from taskspec.language.expressions.operators import Operator
from taskspec.language.expressions.operators.vectors import strided
from taskspec.language.expressions.types import INT_MAX, Kind, total_size
from taskspec.language.expressions.variates import VARIATES
from taskspec.language.task.task import Task
from taskspec.programs import literal
from taskspec.programs.lane_form import LaneEmitter, LaneValue

EVERYTHING = 10**9
CHAIN = 24
"""Tables up to this many rows are chains of selects; larger ones are looked up in memory."""
ELEMENTS = 600
"""Tasks with more elements in all their values compile for more than five seconds or so, and are left to NumPy."""
WIDE = 64
"""Largest vector that is permuted, ordered or indexed at run time."""


def suits(task: Task) -> bool:
    """Test whether a kernel of the task compiles in reasonable time."""
    roots = (*task.reset_roots, *task.step_roots)
    nodes = []
    for n in walk(roots):
        if not isinstance(n, Const):
            nodes.append(n)
    quadratic = ("argsort", "swap", "put", "index", "argmin", "argmax")
    wide = []
    for n in nodes:
        if isinstance(n, Apply) and n.op in quadratic and not isinstance(n.args[0], Const):
            wide.append(n)
    wide_draws = []
    for n in nodes:
        if isinstance(n, Draw) and VARIATES[n.base].sorts:
            wide_draws.append(n)
    largest = max([n.args[0].type.size for n in wide] + [n.type.shape[-1] for n in wide_draws], default=0)
    looped = sum(n.type.size - 1 for n in nodes if isinstance(n, Draw) and VARIATES[n.base].loop)
    return total_size(nodes) - looped <= ELEMENTS and largest <= WIDE


class KernelLane(LaneEmitter):
    """Emits statements whose values are all named scalars; `words` names words, `reals` what is made of them beforehand."""

    reals: dict[int, Sequence[str]]

    def is_narrow(self, node: Node) -> bool:
        """Test whether every element is an int that fits 32 bits."""
        low, high = self.certain(node)
        return node.type.kind is Kind.INT and low >= -INT_MAX and high <= INT_MAX

    def _const(self, node: Const) -> LaneValue:
        if node.type.size > 4096:
            return LaneValue()  # a table, which is looked up by the node itself
        return LaneValue(list(map(literal, node.numbers)))

    def _template(self, node: Apply, entry: Operator) -> str:
        real = any(a.type.kind is Kind.REAL for a in node.args)
        form = entry.kernel
        template = (form.real if real else form.whole) or form.template or entry.scalar.template
        if node.op in ("floordiv", "mod") and not real:
            sign = "//" if node.op == "floordiv" else "%"  # division without signs vectorises
            (a_low, a_high), (b_low, b_high) = map(self.certain, node.args)
            if a_low >= 0 and b_low > 0 and a_high <= INT_MAX and b_high <= INT_MAX:
                template = f"(u32({{0}}) {sign} u32({{1}}))"
        if self.is_narrow(node) and node.op != "to_int":
            return f"i32({template})"
        return template

    def _fill(self, template: str, args: Sequence[str]) -> str:
        """Fill a template, with a variable for every operation: the compiler folds the shorter ones."""
        return self.assign(template.format(*list(map(self.assign, args))))

    def _reduction(self, node: Apply, entry: Operator) -> LaneValue:
        atoms = list(map(self.assign, self.atoms(node.args[0])))
        match node.op:
            case "sum" | "prod" | "any" | "all":
                return LaneValue(self._fold(node, atoms, *_FOLDS[node.op]))
            case "count":
                return LaneValue(self._fold(node, [f"i32({a})" for a in atoms], "+", "0"))
            case "min" | "max" | "argmin" | "argmax":
                sign = ">"
                if node.op.endswith("min"):
                    sign = "<"
                return LaneValue(self._best(node, atoms, sign, place=node.op.startswith("arg")))
            case "sort":
                return LaneValue(self._network(node, atoms))
            case "argsort":
                return LaneValue(self.order(atoms, node.args[0].type.kind is Kind.REAL))
            case _:
                return LaneValue(self._running(atoms))

    def _fold(self, node: Apply, atoms: Sequence[str], join: str, none: str) -> list[str]:
        total = atoms[0] if atoms else none
        for atom in atoms[1:]:
            text = f"({total} {join} {atom})"
            total = self.assign(f"i32({text})" if self.is_narrow(node) else text)
        return [total]

    def _best(self, node: Apply, atoms: Sequence[str], sign: str, place: bool) -> list[str]:
        """Best element or its place: a later one must be better, or the first that is a number."""
        real = node.args[0].type.kind is Kind.REAL
        best = atoms[0]
        at = "0"
        for k, atom in enumerate(atoms[1:], 1):
            better = f"({atom} {sign} {best})"
            if real:
                better = f"({better} | (({best} != {best}) & ({atom} == {atom})))"
            won = self.assign(better)
            if place:
                at = self.assign(f"select({won}, {k}, {at})")
            best = self.assign(f"select({won}, {atom}, {best})")
        return [f"i32({at})" if place else best]

    def order(self, atoms: Sequence[str], real: bool) -> list[str]:
        """Places that sort: the rank of every element, then the element of each rank."""
        n = len(atoms)
        ranks = ["0"] * n
        for i in range(n):
            for j in range(i + 1, n):
                later = f"({atoms[j]} < {atoms[i]})"
                if real:  # nan comes last
                    later = f"({later} | (({atoms[i]} != {atoms[i]}) & ({atoms[j]} == {atoms[j]})))"
                moved = self.assign(f"i32({later})")
                ranks[i] = self.assign(f"i32({ranks[i]} + {moved})")
                ranks[j] = self.assign(f"i32({ranks[j]} + (1 - {moved}))")
        order_of_places = []
        for k in range(n):
            place = "0"
            for i in range(1, n):
                place = self.assign(f"select(({ranks[i]} == {k}), {i}, {place})")
            order_of_places.append(place)
        return order_of_places

    def _network(self, node: Apply, atoms: Sequence[str]) -> list[str]:
        real = node.type.kind is Kind.REAL
        rows = list(atoms)
        if real:  # no -0.0
            rows = [self.assign(f"({a} + 0.0)") for a in atoms]
        for i, j in network(len(rows)):
            a = rows[i]
            b = rows[j]
            kept = self.assign(f"(({a} <= {b}) | ({b} != {b}))" if real else f"({a} <= {b})")
            rows[i], rows[j] = self.assign(f"select({kept}, {a}, {b})"), self.assign(f"select({kept}, {b}, {a})")
        return rows

    def _structure(self, node: Apply) -> LaneValue:
        match node.op:
            case "index":
                return self._index(node)
            case "put":
                return self._put(node)
            case "swap":
                return self._swap(node)
            case _:
                return super()._structure(node)

    def _index(self, node: Apply) -> LaneValue:
        x, i = node.args
        row = strided(x.type.shape)
        rows = x.type.shape[0]
        out: list[str] = []
        for index in self.atoms(i):
            at = self.assign(index)
            for column in range(row):
                out.append(self._element_at(x, at, column, row, rows))
        return LaneValue(out)

    def _element_at(self, x: Node, at: str, column: int, row: int, rows: int) -> str:
        if isinstance(x, Const):
            cells = x.numbers[column::row]
            if rows > CHAIN:
                return self.assign(f"{self.table(cells, x.type.kind)}[u64({at})]")
            return self._chain(list(map(literal, cells)), at)
        return self._chain(list(map(self.assign, self.atoms(x)[column::row])), at)

    def _chain(self, cells: Sequence[str], at: str) -> str:
        """Cell at a place, by selects; the commonest constant needs none."""
        common = max(dict.fromkeys(cells), key=lambda c: (cells.count(c), c == cells[-1]))
        picked = common
        for k, cell in enumerate(cells):
            if cell != common:
                picked = self.assign(f"select({at} == {k}, {cell}, {picked})")
        return picked

    def table(self, cells: Sequence[Any], kind: Kind) -> str:
        dtype: Any = {Kind.BOOL: np.bool_, Kind.REAL: np.float64}.get(kind)
        if dtype is None:
            dtype = np.int64
            if all(abs(v) <= INT_MAX for v in cells):
                dtype = np.int32
        return self.array(np.array(cells, dtype))

    def array(self, array: Any) -> str:
        for name, known in self.constants.items():
            if known.dtype == array.dtype and known.tobytes() == array.tobytes():  # 0.0 is not -0.0
                return name
        name = f"T{len(self.constants)}"
        self.constants[name] = array
        return name

    def _put(self, node: Apply) -> LaneValue:
        x, i, value = node.args
        at = self.assign(self.scalar(i))
        row = strided(x.type.shape)
        new = list(map(self.assign, self.atoms(value)))
        old = list(map(self.assign, self.atoms(x)))
        cells = []
        for k, a in enumerate(old):
            cells.append(self.assign(f"select({at} == {k // row}, {new[k % row]}, {a})"))
        return LaneValue(cells)

    def _swap(self, node: Apply) -> LaneValue:
        x, i, j = node.args
        row = strided(x.type.shape)
        a = self.assign(self.scalar(i))
        b = self.assign(self.scalar(j))
        old = list(map(self.assign, self.atoms(x)))
        at_a = [self._chain(old[c::row], a) for c in range(row)]
        at_b = [self._chain(old[c::row], b) for c in range(row)]
        made = []
        for k, v in enumerate(old):
            kept = self.assign(f"select({b} == {k // row}, {at_a[k % row]}, {v})")
            made.append(self.assign(f"select({a} == {k // row}, {at_b[k % row]}, {kept})"))
        return LaneValue(made)

    def _draw(self, node: Draw) -> LaneValue:
        entry = VARIATES[node.base]
        if entry.loop is not None:
            return LaneValue([f"f64({r})" for r in self.reals[node.site][: node.type.size]])
        assert entry.kernel is not None, node.base
        return LaneValue(list(map(self.assign, entry.kernel(self, node, self.words[node.site]))))

    def argument(self, draw: Draw) -> list[str]:
        atoms = list(map(self.assign, self.atoms(draw.args[0])))
        if len(atoms) == 1:
            return atoms * draw.type.size
        return atoms


_FOLDS = {"sum": ("+", "0"), "prod": ("*", "1"), "any": ("|", "False"), "all": ("&", "True")}
"""Operator between the elements of a reduction, and its value where there are none."""
