"""Values moved out of the steps of a program: those of an episode, and those that depend on draws alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from taskspec.base.records import dataclass
from taskspec.draws import NEVER
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Draw, Node, Read, Role, children, reads, rewrite, walk
from taskspec.lang.types import INT
from taskspec.lang.variates import VARIATES, WordLayout, words_of
from taskspec.lang.variates.choices import row_table
from taskspec.task.task import Task


def everywhere(roots: Sequence[Node], own: Callable[[Node], bool]) -> dict[int, bool]:
    """For every node, by id, whether `own` is true of it and of all nodes below it."""
    found: dict[int, bool] = {}
    for node in walk(roots):
        found[id(node)] = own(node) and all(found[id(c)] for c in children(node))
    return found


def maximal(roots: Sequence[Node], inside: dict[int, bool], wanted: Callable[[Node], bool]) -> list[Node]:
    """Return the wanted nodes inside (by id) that are roots or arguments of nodes outside, in the order of the roots."""
    outside = [node for node in walk(roots) if not inside[id(node)]]
    referred = [*roots, *(c for node in outside for c in children(node))]
    return list({id(n): n for n in referred if inside[id(n)] and wanted(n)}.values())


# -- values that stay the same for a whole episode: functions of components that no step changes ------------------


@dataclass(frozen=True)
class Invariants:
    """The invariants of a task's steps.

    `nodes` read the state; `at_reset` are the same over the first state; `names` are the variables that hold them.
    `observation` says that the whole observation is one.
    """

    nodes: tuple[Node, ...]
    at_reset: tuple[Node, ...]
    names: tuple[str, ...]
    observation: bool

    @classmethod
    def of(cls, task: Task, rows: bool) -> Invariants:
        """`rows`: whether observations are float32 arrays, which can be kept and copied."""
        roots = (*task.next, task.reward, task.terminal)
        fixed = _fixed((*roots, *task.next_observation), frozen_components(task))
        # What is seen at the reset may be something else: `x'` may be the same in every step, and not be `x`.
        observed = (
            rows
            and all(fixed[id(n)] for n in task.next_observation)
            and _at_reset(task, task.next_observation) == task.first_observation
        )
        seen = () if observed else task.next_observation
        nodes = tuple(_maximal_fixed((*roots, *seen), fixed))
        return cls(nodes, _at_reset(task, nodes), tuple(f"k{i}" for i in range(len(nodes))), observed)

    def replaced(self, task: Task, roots: Sequence[Node]) -> tuple[Node, ...]:
        """Return roots that read the variables instead of computing the invariants."""
        names = {id(n): name for n, name in zip(self.nodes, self.names, strict=True)}

        def leaf(node: Node) -> Node | None:
            name = names.get(id(node))
            return None if name is None else task.builder.read(Role.VARIABLE, name, node.type)

        return rewrite(roots, leaf, task.builder.remake)


def _at_reset(task: Task, nodes: Sequence[Node]) -> tuple[Node, ...]:
    """Return nodes as functions of the first state."""
    first = {c.name: n for c, n in zip(task.state, task.initial, strict=True)}

    def leaf(node: Node) -> Node | None:
        return first[node.name] if isinstance(node, Read) and node.role is Role.STATE else None

    return rewrite(nodes, leaf, task.builder.remake_late)


WIDE = 32
"""Vectors above this are handled as arrays: thousands of Python numbers waiting for their turn would miss the cache."""


def cold_components(task: Task, roots: Sequence[Node]) -> frozenset[str]:
    """Return wide components that no step changes and no root reads: they are not kept, since a reset can be replayed."""
    read = reads(roots)
    frozen = frozen_components(task)
    return frozenset(c.name for c in task.state if c.name in frozen and c.type.size > WIDE and c.read not in read)


def changing(task: Task, roots: Sequence[Node]) -> list[Node]:
    """Return roots of a step without those of frozen components."""
    n = len(task.state)
    frozen = frozen_components(task)
    moving = [r for r, c in zip(roots[:n], task.state, strict=True) if c.name not in frozen]
    return [*moving, *roots[n:]]


def frozen_components(task: Task) -> frozenset[str]:
    """Return names of the state components that no step changes."""
    pairs = zip(task.state, task.next, strict=True)
    return frozenset(c.name for c, n in pairs if isinstance(n, Read) and n.role is Role.STATE and n.name == c.name)


def _fixed(roots: Sequence[Node], frozen: frozenset[str]) -> dict[int, bool]:
    """For every node, by id, whether it draws nothing and reads frozen components only."""

    def own(node: Node) -> bool:
        if isinstance(node, Read):
            return node.role is Role.STATE and node.name in frozen
        return not isinstance(node, Draw)

    return everywhere(roots, own)


def _maximal_fixed(roots: Sequence[Node], fixed: dict[int, bool]) -> list[Node]:
    """Return the largest fixed operations that the rest refers to; a bare read or constant is not worth a variable.

    Rows of a table that a draw looks up stay as they are: their probabilities are exact only while they are known as such.
    """
    rows = {id(d.args[0]) for d in walk(roots) if isinstance(d, Draw) and d.args and row_table(d.args[0])}
    outside = dict.fromkeys(rows, False)
    return maximal(roots, fixed | outside, lambda node: isinstance(node, Apply))


# -- values that depend on draws alone ----------------------------------------------------------------------------
#
# Nodes are rewritten into nodes, so that every backend gains: a draw becomes a read of a variable with certain bounds.


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
        return {name: first[site] + k for site, names in self.words.items() for k, name in enumerate(names)}


def hoist(b: Builder, roots: Sequence[Node], layout: WordLayout, bias: int = 0) -> Hoisted:
    """Replace values that depend on draws alone by reads of variables, and other draws by comparisons if possible."""
    free = everywhere(roots, lambda node: not isinstance(node, Read))
    values = maximal_draws(roots, free)
    names = {id(n): f"h{i}" for i, n in enumerate(values)}

    def leaf(node: Node) -> Node | None:
        if id(node) not in names:
            return None
        low, high = b.certain(node)
        return b.read(Role.VARIABLE, names[id(node)], node.type, low, high)

    rest = rewrite(roots, leaf, b.remake)
    left = {d.site: word_names(d) for d in walk(rest) if isinstance(d, Draw)}
    lowered = compared(b, rest, bias)
    return Hoisted(lowered, tuple(values), tuple(names.values()), left, layout)


def compared(b: Builder, roots: Sequence[Node], bias: int = 0) -> tuple[Node, ...]:
    """Return roots with finite draws of known probabilities as comparisons of words with thresholds.

    A word is read as the int variable of `word_names`, less `bias` (2**31 where ints have 32 bits).
    """

    def leaf(node: Node) -> Node | None:
        return _comparison(b, node, bias) if isinstance(node, Draw) else None

    before = tuple(roots)
    found = rewrite(roots, leaf, b.remake)
    while found != before:  # arguments of draws may hold draws
        before = found
        found = rewrite(found, leaf, b.remake)
    return found


def word_names(draw: Draw) -> tuple[str, ...]:
    return tuple(f"w{draw.site}_{k}" for k in range(words_of(draw)))


def maximal_draws(roots: Sequence[Node], free: dict[int, bool]) -> list[Node]:
    """Return the largest free nodes that hold a draw."""
    drawless = everywhere(roots, lambda node: not isinstance(node, Draw))
    return maximal(roots, free, lambda node: not drawless[id(node)])


# -- draws as comparisons -----------------------------------------------------------------------------------------


def _comparison(b: Builder, draw: Draw, bias: int) -> Node | None:
    words = [b.read(Role.VARIABLE, n, INT, -bias, NEVER - 1 - bias) for n in word_names(draw)]
    elements = VARIATES[draw.base].compared(b, draw, words, bias)
    if elements is None or draw.type.is_scalar:
        return None if elements is None else elements[0]
    return b.structure("reshape", [b.structure("vector", elements)], draw.type.shape)
