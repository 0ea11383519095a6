"""Rewrite expressions before code is generated: values out of the steps, draws as comparisons, and tables of small functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.draws import NEVER
from taskspec.language.expressions import batch
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, children, draws, reads, rewrite, walk
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.types import INT, Kind, Role, Type
from taskspec.language.expressions.variates import VARIATES, WordLayout, words_of
from taskspec.language.expressions.variates.choices import row_table
from taskspec.language.task.parts import by_read
from taskspec.language.task.task import Task

# -- values out of the steps ----------------------------------------------------------------------------------------
#
# Those of an episode, and those that depend on draws alone. Nodes are rewritten into nodes, so that every backend gains.


def everywhere(roots: Sequence[Node], own: Callable[[Node], bool]) -> dict[int, bool]:
    """For every node, by id, whether `own` is true of it and of all nodes below it."""
    known: dict[int, bool] = {}
    for node in walk(roots):
        known[id(node)] = own(node) and all(known[id(c)] for c in children(node))
    return known


def _maximal(roots: Sequence[Node], inside: dict[int, bool], wanted: Callable[[Node], bool]) -> list[Node]:
    """Wanted nodes inside (by id) that are roots or arguments of nodes outside, in the order of the roots."""
    referred = list(roots)
    for node in walk(roots):
        if not inside[id(node)]:
            referred += children(node)
    chosen = {}
    for n in referred:
        if inside[id(n)] and wanted(n):
            chosen[id(n)] = n
    return list(chosen.values())


def maximal_draws(roots: Sequence[Node], free: dict[int, bool]) -> list[Node]:
    """Largest free nodes that contain a draw."""
    drawless = everywhere(roots, lambda node: not isinstance(node, Draw))
    return _maximal(roots, free, lambda node: not drawless[id(node)])


@dataclass(frozen=True)
class Invariants:
    """Values of a task's steps that stay the same for a whole episode: functions of components that no step changes.

    `nodes` read the state; `at_reset` are the same over the first state; `names` are the variables that hold them.
    `observation` says that the whole observation is one.
    """

    nodes: tuple[Node, ...]
    at_reset: tuple[Node, ...]
    names: tuple[str, ...]
    observation: bool

    @classmethod
    def of(cls, b: Builder, task: Task, rows: bool) -> Invariants:
        """`rows`: whether observations are float32 arrays, which can be kept and copied."""
        frozen = frozen_components(task)
        roots = task.process.step_roots
        everything = (*roots, *task.next_observation)

        def is_fixed(node: Node) -> bool:
            if isinstance(node, Read):
                return node.role is Role.STATE and node.name in frozen
            return not isinstance(node, Draw)

        fixed = everywhere(everything, is_fixed)
        # The first observation may be another: `x'` may be the same in every step, and not be `x`.
        observed = rows and all(fixed[id(n)] for n in task.next_observation)
        observed = observed and _at_reset(b, task, task.next_observation) == task.first_observation
        shown = roots if observed else everything
        # Rows of a table that a draw looks up stay: their probabilities are exact only while they are known as such.
        for node in walk(shown):
            if isinstance(node, Draw) and node.args and row_table(node.args[0]):
                fixed[id(node.args[0])] = False
        # A bare read or constant is not worth a variable.
        nodes = tuple(_maximal(shown, fixed, lambda node: isinstance(node, Apply)))
        return cls(nodes, _at_reset(b, task, nodes), tuple(f"k{i}" for i in range(len(nodes))), observed)

    def replaced(self, b: Builder, roots: Sequence[Node]) -> tuple[Node, ...]:
        """Read the variables instead of computing the invariants."""
        variables: dict[int, Node] = {}
        for node, name in zip(self.nodes, self.names, strict=True):
            variables[id(node)] = b.read(Role.VARIABLE, name, node.type)
        return rewrite(roots, variables, b.remake)


def _at_reset(b: Builder, task: Task, nodes: Sequence[Node]) -> tuple[Node, ...]:
    return b.substitute(nodes, by_read(Role.STATE, task.state, task.process.initial))


WIDE = 32
"""Vectors above this are handled as arrays: thousands of Python numbers waiting for their turn would miss the cache."""


def cold_components(task: Task, roots: Sequence[Node]) -> frozenset[str]:
    """Wide components that no step changes and no root reads: they are not kept, since a reset can be replayed.

    `roots` are the roots of a step; that a component is its own next value does not count.
    """
    frozen = frozen_components(task)
    n = len(task.state)
    moving = [r for r, c in zip(roots[:n], task.state, strict=True) if c.name not in frozen]
    read = reads([*moving, *roots[n:]])
    cold = set()
    for c in task.state:
        if c.name in frozen and c.type.size > WIDE and c.read not in read:
            cold.add(c.name)
    return frozenset(cold)


def frozen_components(task: Task) -> frozenset[str]:
    """Names of the state components that no step changes."""
    frozen = set()
    for c, n in zip(task.state, task.process.next, strict=True):
        if isinstance(n, Read) and (n.role, n.name) == c.read:
            frozen.add(c.name)
    return frozenset(frozen)


@dataclass(frozen=True)
class Hoisted:
    """Roots of a phase whose draws are reads of variables.

    `values` are nodes that need draws and nothing else, read as the variables `names`. `words` gives, for every draw
    that is left (it depends on the state), the variable that holds each of its words; `layout` numbers the words.
    """

    roots: tuple[Node, ...]
    values: tuple[Node, ...]
    names: tuple[str, ...]
    words: dict[int, tuple[str, ...]]
    layout: WordLayout

    @property
    def word_numbers(self) -> dict[str, int]:
        """The number within the phase of every word that is read by name."""
        first = self.layout.first
        numbers = {}
        for site, names in self.words.items():
            for k, name in enumerate(names):
                numbers[name] = first[site] + k
        return numbers


def hoist(b: Builder, roots: Sequence[Node], layout: WordLayout) -> Hoisted:
    """Replace values that depend on draws alone by reads of variables, and other draws by comparisons if possible."""
    free = everywhere(roots, lambda node: not isinstance(node, Read))
    values = maximal_draws(roots, free)
    names = tuple(f"h{i}" for i in range(len(values)))
    variables: dict[int, Node] = {}
    for node, name in zip(values, names, strict=True):
        variables[id(node)] = b.read(Role.VARIABLE, name, node.type, *b.certain(node))
    rest = rewrite(roots, variables, b.remake)
    left = {d.site: word_names(d) for d in walk(rest) if isinstance(d, Draw)}
    return Hoisted(compared(b, rest), tuple(values), names, left, layout)


def compared(b: Builder, roots: Sequence[Node], bias: int = 0) -> tuple[Node, ...]:
    """Replace finite draws of known probabilities by comparisons of words with thresholds.

    A word is read as the int variable of `word_names`, less `bias` (2**31 where ints have 32 bits).
    """
    before: tuple[Node, ...] = ()
    rewritten = tuple(roots)
    while rewritten != before:  # arguments of draws may hold draws
        before = rewritten
        comparisons: dict[int, Node] = {}
        for draw in draws(before):
            words = [b.read(Role.VARIABLE, n, INT, -bias, NEVER - 1 - bias) for n in word_names(draw)]
            elements = VARIATES[draw.base].compared(b, draw, words, bias)
            if elements is not None and draw.type.is_scalar:
                comparisons[id(draw)] = elements[0]
            elif elements is not None:
                vector = b.structure("vector", elements)
                comparisons[id(draw)] = b.structure("reshape", [vector], draw.type.shape)
        rewritten = rewrite(before, comparisons, b.remake)
    return rewritten


def word_names(draw: Draw) -> tuple[str, ...]:
    return tuple(f"w{draw.site}_{k}" for k in range(words_of(draw)))


# -- expressions over few finite values become tables: one look-up instead of a chain of operations -----------------
#
# Array code pays for every operation on every lane, and twice for the call where lanes are few, so that a transition
# of a small finite task is cheapest as a look-up. The tables are worked out by the array forms of the operators.

CELLS = 8192
"""Largest table: 64 KiB of 8-byte numbers, which a second-level cache holds beside the lanes."""


def tabulate(b: Builder, roots: Sequence[Node], cells: int = CELLS) -> tuple[Node, ...]:
    """Replace the largest scalar parts over at most `cells` combinations of finite reads by look-ups."""
    roots = folded(b, roots)
    finite: dict[int, frozenset[Read] | None] = {}
    for node in walk(roots):
        finite[id(node)] = _finite_reads(finite, node, cells)
    tables: dict[int, Node] = {}
    stack = list(roots)
    seen = set[int]()
    while stack:
        node = stack.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        finite_reads = finite[id(node)]
        if (
            finite_reads
            and isinstance(node, Apply)
            and node.type.is_scalar
            and sum(isinstance(n, Apply) for n in walk([node])) > 2 * len(finite_reads)
        ):
            # The index of a table takes an operation or two for every read but the first.
            tables[id(node)] = _table(b, node, finite_reads)
        else:
            stack.extend(children(node))
    return folded(b, rewrite(roots, tables, b.remake))


def _finite_reads(finite: dict[int, frozenset[Read] | None], node: Node, cells: int) -> frozenset[Read] | None:
    """List the reads below a node; None where they have too many values, or something is drawn."""
    if isinstance(node, Draw):
        return None
    reads = {node} if isinstance(node, Read) else set[Read]()
    for child in children(node):
        below = finite[id(child)]
        if below is None:
            return None
        reads |= below
    if isinstance(node, Read) and not node.type.is_scalar:
        return None
    if math.prod(map(_count, reads)) <= cells:
        return frozenset(reads)
    return None


def _count(read: Read) -> float:
    if read.type.kind is Kind.BOOL:
        return 2
    if read.type.kind is Kind.INT:
        return read.high - read.low + 1
    return math.inf


def _table(b: Builder, node: Node, variables: frozenset[Read]) -> Node:
    """Write a node as a look-up; the reads are the digits of the place, the last one fastest."""
    reads = sorted(variables, key=lambda r: (r.role.value, r.name))
    counts = [int(_count(r)) for r in reads]
    places = np.indices(counts).reshape(len(reads), -1)
    points: dict[tuple[Role, str], Array] = {}
    place: Node = b.scalar(0)
    for read, count, digits in zip(reads, counts, places, strict=True):
        low = 0
        if read.type.kind is not Kind.BOOL:
            low = int(read.low)
        points[read.role, read.name] = (digits + low).astype(np.bool_ if read.type.kind is Kind.BOOL else np.int64)
        digit = b.apply("sub", b.cast(read, Kind.INT), b.scalar(low))
        place = b.apply("add", b.apply("mul", place, b.scalar(count)), digit)
    (values,) = batch.evaluate([node], points)
    cells = np.broadcast_to(values, places.shape[1:]).tolist()
    if len(set(map(repr, cells))) == 1:
        return b.const(cells[0], node.type)
    return b.structure("index", [b.const(cells, Type(node.type.kind, (len(cells),))), place])


def folded(b: Builder, roots: Sequence[Node]) -> tuple[Node, ...]:
    """Apply operations on looked-up elements to the constant table."""
    done: dict[int, Node] = {}
    for node in walk(roots):
        args = tuple(done[id(c)] for c in children(node))
        same = all(a is c for a, c in zip(args, children(node), strict=True))
        done[id(node)] = _fold(b, node if same else b.remake(node, args))
    return tuple(done[id(root)] for root in roots)


def _fold(b: Builder, node: Node) -> Node:
    match node:
        case Apply(op="index", args=(Apply(op="index", args=(Const() as table, row)), column)) if _is_matrix(
            table, row
        ):
            k = table.type.shape[1]
            flat = b.const(table.flat, Type(table.type.kind, (table.type.size,)))
            place = b.apply("add", b.apply("mul", row, b.scalar(k)), column)
            return b.structure("index", [flat, place])
        case Apply(op="element", args=(Apply(op="index", args=(Const() as table, row)),), static=(k,)) if _is_matrix(
            table, row
        ):
            width = table.type.shape[1]
            column = b.const(table.flat[k::width], Type(table.type.kind, (table.type.shape[0],)))
            return b.structure("index", [column, row])
        case Apply(op="index", args=(Const() as table, Apply(op="index", args=(Const() as inner, place)))):
            if len(table.type.shape) == 1 and len(inner.type.shape) == 1:
                picked = b.const([table.flat[i] for i in inner.flat], Type(table.type.kind, inner.type.shape))
                return b.structure("index", [picked, place])
            return node
        case Apply(op=op) if op in OPERATORS and OPERATORS[op].elementwise and node.type.is_scalar:
            return _fold_function(b, node)
        case _:
            return node


def _is_matrix(table: Const, row: Node) -> bool:
    return len(table.type.shape) == 2 and row.type.is_scalar


def _fold_function(b: Builder, node: Apply) -> Node:
    variable = [a for a in node.args if not isinstance(a, Const)]
    if len(set(map(id, variable))) != 1:
        return node
    match variable[0]:
        case Apply(op="index", args=(Const() as table, place)) as inner:
            if len(table.type.shape) != 1 or not place.type.is_scalar:
                return node
            args = tuple(b.held(table if a is inner else a) for a in node.args)  # fractions end where the task runs
            cells = b.remake(Apply(node.op, args, Type(node.type.kind, table.type.shape)), args)
            if isinstance(cells, Const):
                return b.structure("index", [cells, place])
            return node
    return node
