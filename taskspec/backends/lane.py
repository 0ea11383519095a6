"""The lane form: core nodes as straight-line scalar Python for one environment, one assignment per shared node.

Small vectors become one expression per element ("atoms"); larger ones are packed in one tuple or list. What an operator
looks like comes from the operator table; how elements are arranged is decided here.
"""

from __future__ import annotations

import marshal
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taskspec.backends.source import literal, tuple_of
from taskspec.draws import thresholds
from taskspec.draws.layout import poisson_bound, row_table
from taskspec.lang.arrays import network
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, plain, walk
from taskspec.lang.ops import OPS, Op
from taskspec.lang.structure import strided
from taskspec.lang.types import Kind

UNROLLED = 16
"""Vectors up to this many elements become one expression for each."""
CHAINED = 64
"""Sums up to this many terms are written out."""
_ATOM = re.compile(r"-?[\w.]+(\[\d+\])?")


@dataclass(slots=True)
class Value:
    """The source of a value: one expression per element, or the name of a flat sequence, or both."""

    atoms: list[str] | None = None
    packed: str | None = None

    @property
    def text(self) -> str:
        assert self.atoms is not None
        return self.atoms[0]


@dataclass
class Lane:
    """Emits statements for nodes.

    Subclasses emit for other targets; with `unrolled` large enough, every element is an expression of its own.
    `names` gives the source of every read; `words` the names of the random words of every draw, by site. `certain`
    gives bounds of a node (`Builder.certain`); `constants` collects the arrays that the statements refer to.
    """

    names: Mapping[tuple[Role, str], Value]
    words: Mapping[int, Sequence[str]]
    certain: Callable[[Node], tuple[float, float]]
    constants: dict[str, Any] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    values: dict[int, Value] = field(default_factory=dict)
    fresh: int = 0
    unrolled: int = UNROLLED

    def emit(self, roots: Iterable[Node]) -> list[Value]:
        """Statements for the roots are appended to `lines`; the values refer to them."""
        roots = tuple(roots)
        order = list(walk(roots))
        uses: dict[int, int] = {}
        for node in (*roots, *(c for n in order for c in children(n))):
            uses[id(node)] = uses.get(id(node), 0) + 1
        for node in order:
            value = self._node(node)
            self.values[id(node)] = self._shared(value) if uses[id(node)] > 1 else value
        return [self.values[id(root)] for root in roots]

    # -- sources --------------------------------------------------------------------------------------------------

    def name(self) -> str:
        self.fresh += 1
        return f"v{self.fresh}"

    def assign(self, text: str) -> str:
        """A name for an expression; atoms need none."""
        return text if _ATOM.fullmatch(text) else self.named(text)

    def named(self, text: str) -> str:
        """A new name for an expression."""
        name = self.name()
        self.lines.append(f"{name} = {text}")
        return name

    def constant(self, value: Any) -> str:
        """The name of a value that is kept outside the function; tuples of the same numbers are kept once."""
        for name, known in self.constants.items():
            if known is value or _identical(known, value):
                return name
        name = f"C{len(self.constants)}"
        self.constants[name] = value
        return name

    def _shared(self, value: Value) -> Value:
        if value.atoms is not None:
            value.atoms = [self.assign(a) for a in value.atoms]
        return value

    def atoms(self, node: Node) -> list[str]:
        """One expression per element, row-major."""
        value = self.values[id(node)]
        if value.atoms is None:
            assert value.packed is not None
            names = [self.name() for _ in range(node.type.size)]
            self.lines.append(f"{', '.join(names)}{',' * (len(names) == 1)} = {value.packed}")
            value.atoms = names
        return value.atoms

    def packed(self, node: Node) -> str:
        """The name of a flat sequence of the elements."""
        value = self.values[id(node)]
        if value.packed is None:
            value.packed = self.assign(tuple_of(self.atoms(node)))
        return value.packed

    def scalar(self, node: Node) -> str:
        return self.atoms(node)[0]

    # -- nodes ----------------------------------------------------------------------------------------------------

    def _node(self, node: Node) -> Value:
        match node:
            case Const():
                return self._const(node)
            case Read(role=role, name=name):
                return self.names[role, name]
            case Draw():
                return self._draw(node)
            case Apply(op=op) if op in OPS:
                entry = OPS[op]
                return self._elementwise(node, entry) if entry.elementwise else self._reduction(node)
            case Apply(op=op):
                return self._structure(node)

    def _structure(self, node: Apply) -> Value:
        return _STRUCTURE[node.op](self, node)

    def _const(self, node: Const) -> Value:
        flat = [plain(v) for v in node.flat]
        if node.type.size <= self.unrolled:
            return Value([literal(v) for v in flat])
        return Value(packed=self.constant(tuple(flat)))

    def _elementwise(self, node: Apply, entry: Op) -> Value:
        template = self._template(node, entry)
        if node.type.size <= self.unrolled or all(self.values[id(a)].atoms is not None for a in node.args):
            columns = [self.atoms(a) if a.type.shape else [self.scalar(a)] * node.type.size for a in node.args]
            if node.type.shape:
                columns = [
                    c if a.type.shape else [self.assign(c[0])] * len(c) for c, a in zip(columns, node.args, strict=True)
                ]
            return Value([self._fill(template, row) for row in zip(*columns, strict=True)])
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
        return Value(packed=self.assign(f"[{body} {loop}]"))

    def _template(self, node: Apply, entry: Op) -> str:
        if entry.lane_divides is not None and self._never_zero(node.args[1]):
            return entry.lane_divides
        real = any(a.type.kind is Kind.REAL for a in node.args)
        return entry.real_lane if real and entry.real_lane else entry.lane

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

    def _reduction(self, node: Apply) -> Value:
        (x,) = node.args
        chain = _CHAINS.get(node.op)
        if chain is not None and x.type.size <= CHAINED:
            atoms = self.atoms(x) or [chain[1]]
            if node.op == "count":
                atoms = [f"(1 if {a} else 0)" for a in atoms]
            return Value([f"({chain[0].join(atoms)})"])
        if node.op == "sort" and x.type.size <= self.unrolled:
            return Value(self._sorted(self._without_signs(x)))
        if node.op == "cumsum" and x.type.size <= self.unrolled:
            return Value(self._running(self.atoms(x)))
        name = _WHOLE.get(node.op) if x.type.kind is not Kind.REAL else None
        call = f"{name or _HELPERS[node.op]}({self.packed(x)})"
        return Value(packed=self.assign(call)) if node.type.shape else Value([call])

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

    # -- structure ------------------------------------------------------------------------------------------------

    def _vector(self, node: Apply) -> Value:
        if node.type.size <= self.unrolled:
            return Value([atom for arg in node.args for atom in self.atoms(arg)])
        parts = [f"*{self.packed(a)}" if a.type.size > self.unrolled else ", ".join(self.atoms(a)) for a in node.args]
        return Value(packed=self.assign(tuple_of(parts)))

    def _slice(self, node: Apply) -> Value:
        start, count, step = node.static
        row = strided(node.args[0].type.shape)
        value = self.values[id(node.args[0])]
        places = [(start + k * step) * row + i for k in range(count) for i in range(row)]
        if value.atoms is not None:
            return Value([value.atoms[p] for p in places])
        if row == 1 or step == 1:
            stop: int | None = (start + count * step) * row
            stop = None if stop is not None and stop < 0 else stop
            return Value(
                packed=self.assign(
                    f"{value.packed}[{start * row}:{'' if stop is None else stop}:{step if row == 1 else 1}]"
                )
            )
        return Value(packed=self.assign(tuple_of([f"{value.packed}[{p}]" for p in places])))

    def _element(self, node: Apply) -> Value:
        row = node.type.size
        first = node.static[0] * row
        value = self.values[id(node.args[0])]
        if value.atoms is not None:
            return Value(value.atoms[first : first + row])
        if not node.type.shape:
            return Value([f"{value.packed}[{first}]"])
        return Value(packed=self.assign(f"{value.packed}[{first}:{first + row}]"))

    def _fill_shape(self, node: Apply) -> Value:
        atom = self.assign(self.scalar(node.args[0]))
        if node.type.size <= self.unrolled:
            return Value([atom] * node.type.size)
        return Value(packed=self.assign(f"({atom},) * {node.type.size}"))

    def _index(self, node: Apply) -> Value:
        x, i = node.args
        row = strided(x.type.shape)
        picked = [self._row(x, index, row) for index in self.atoms(i)]
        if len(picked) == 1:
            return picked[0]
        if all(p.atoms is not None for p in picked):
            return Value([a for p in picked for a in p.atoms or ()])
        return Value(packed=self.assign(f"({', '.join(f'*{p.packed}' for p in picked)})"))

    def _row(self, x: Node, index: str, row: int) -> Value:
        """One row of x: an expression when it is a single element."""
        if row == 1:
            return Value([f"{self._sequence(x)}[{index}]"])
        if isinstance(x, Const):
            flat = [plain(v) for v in x.flat]
            rows = tuple(tuple(flat[k : k + row]) for k in range(0, len(flat), row))
            return Value(packed=self.assign(f"{self.constant(rows)}[{index}]"))
        index = self.assign(index)
        return Value(packed=self.assign(f"{self.packed(x)}[{index} * {row}:{index} * {row} + {row}]"))

    def _sequence(self, x: Node) -> str:
        """A flat sequence to index; a constant one is kept outside the step."""
        if isinstance(x, Const):
            return self.constant(tuple(plain(v) for v in x.flat))
        value = self.values[id(x)]
        if value.packed is None and len(value.atoms or ()) <= self.unrolled:
            return tuple_of(self.atoms(x))
        return self.packed(x)

    def _put(self, node: Apply) -> Value:
        x, i, value = node.args
        row = value.type.size
        name = self.name()
        self.lines.append(f"{name} = list({self.packed(x)})")
        if row == 1:
            self.lines.append(f"{name}[{self.scalar(i)}] = {self.scalar(value)}")
        else:
            at = self.assign(self.scalar(i))
            self.lines.append(f"{name}[{at} * {row}:{at} * {row} + {row}] = {self.packed(value)}")
        return Value(packed=name)

    def _swap(self, node: Apply) -> Value:
        x, i, j = node.args
        row = strided(x.type.shape)
        name, a, b = self.name(), self.assign(self.scalar(i)), self.assign(self.scalar(j))
        self.lines.append(f"{name} = list({self.packed(x)})")
        if row == 1:
            self.lines.append(f"{name}[{a}], {name}[{b}] = {name}[{b}], {name}[{a}]")
        else:
            p, q = (f"{name}[{k} * {row}:{k} * {row} + {row}]" for k in (a, b))
            self.lines.append(f"{p}, {q} = {q}, {p}")
        return Value(packed=name)

    # -- draws whose distribution depends on the state ------------------------------------------------------------

    def _draw(self, node: Draw) -> Value:
        words = self.words[node.site]
        size = node.type.size
        if node.base == "categorical":
            return Value([self._outcome(node, word) for word in words[:size]])
        ps = self.atoms(node.args[0])
        ps = ps * size if len(ps) == 1 else ps
        match node.base:
            case "bernoulli":
                return Value([f"bernoulli({w}, {p})" for w, p in zip(words, ps, strict=True)])
            case "index":
                return Value([f"({w} * {n} >> 32)" for w, n in zip(words, ps, strict=True)])
            case "dirichlet":
                return Value(packed=self.assign(f"dirichlet({tuple_of(words)}, {self.packed(node.args[0])})"))
            case _:
                step = len(words) // size
                groups = [tuple_of(words[k : k + step]) for k in range(0, len(words), step)]
                return Value([f"poisson({g}, {p}, {poisson_bound(node)!r})" for g, p in zip(groups, ps, strict=True)])

    def _outcome(self, node: Draw, word: str) -> str:
        """A word against the thresholds of the present row, or against weights known only now."""
        looked_up = row_table(node.args[0])
        if looked_up is None:
            return f"weighted_categorical({word}, {self.packed(node.args[0])})"
        table, row = looked_up
        k = table.type.shape[-1]
        rows = tuple(thresholds(table.flat[i : i + k]) for i in range(0, len(table.flat), k))
        at = self.scalar_of(row)
        if k == 2:
            return f"(0 if {word} < {self.constant(tuple(r[0] for r in rows))}[{at}] else 1)"
        return f"bisect_right({self.constant(rows)}[{at}], {word})"

    def scalar_of(self, node: Node) -> str:
        """The source of a node that may not be a direct argument; it was emitted with the others."""
        value = self.values[id(node)]
        value.atoms = [self.assign(a) for a in self.atoms(node)]
        return value.atoms[0]


def _identical(a: Any, b: Any) -> bool:
    """Whether two tuples hold the same numbers of the same types: (1, 0) equals (True, False), and 0.0 equals -0.0."""
    alike = isinstance(a, tuple) and isinstance(b, tuple) and a == b
    return alike and marshal.dumps(a, 2) == marshal.dumps(b, 2)  # of version 2, which knows no references


_STRUCTURE: dict[str, Callable[[Lane, Apply], Value]] = {
    "vector": Lane._vector,
    "concat": Lane._vector,
    "slice": Lane._slice,
    "element": Lane._element,
    "reshape": lambda lane, node: lane.values[id(node.args[0])],
    "fill": Lane._fill_shape,
    "index": Lane._index,
    "put": Lane._put,
    "swap": Lane._swap,
}
_CHAINS = {
    "sum": (" + ", "0"),
    "prod": (" * ", "1"),
    "count": (" + ", "0"),
    "any": (" or ", "False"),
    "all": (" and ", "True"),
}
_WHOLE = {"min": "min", "max": "max", "sort": "sorted"}
"""What Python has for bools and ints."""
_HELPERS = {
    "sum": "sum_", "prod": "prod", "count": "count", "any": "any", "all": "all", "min": "min_", "max": "max_",
    "argmin": "argmin", "argmax": "argmax", "sort": "sort", "argsort": "argsort", "cumsum": "cumsum",
}  # fmt: skip
