"""The parts of a task: components, observations, claims, parameters, figures. Plain immutable data."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from math import prod
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np

from taskspec.base.named import entries_by_name
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.ir import Node, Read, draws
from taskspec.language.expressions.scope import ClampedIndex, Scope, Value
from taskspec.language.expressions.types import INT_WIDEST, Domain, Expression, Kind, Role, Shape, Type

__all__ = ["Component", "Parameter"]

T = TypeVar("T")

# ---------- parameters
# Values of parameters: as callers give them, and as grids for claims; options of environments.


@dataclass(frozen=True)
class Varying:
    """Given for a parameter: it is left open, and read where the task runs. Messages show the value."""

    value: Any


def convert(value: Any, kind: str) -> Any:
    """Convert a value to the kind of a parameter; None for another kind, no number, or a too large one."""
    if isinstance(value, np.generic):
        value = value.item()
    if kind == "bool":
        if isinstance(value, bool):
            return value
        return None
    is_nan = isinstance(value, float) and math.isnan(value)
    if isinstance(value, bool) or not isinstance(value, int | float | Fraction) or is_nan:
        return None
    if kind == "int":
        if -INT_WIDEST <= value <= INT_WIDEST and value == int(value):
            return int(value)
        return None
    try:
        if kind == "real":
            return float(value)
        return None
    except OverflowError:
        return None


def article(kind: str) -> str:
    known = {"int": "an int", "real": "a real number", "bool": "true or false"}
    return known.get(kind, f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}")


def brief(value: Any) -> str:
    """Show a value from Python in a few words; ints may be longer than Python is willing to print."""
    if isinstance(value, int) and abs(value) > INT_WIDEST:
        return f"one of {value.bit_length()} bits"
    return reprlib.repr(value)


# Parameter values that a claim or an example is about: a list of choices, or a grid of values, `{L: [1, 2], K: [3, 4]}`.

Grid: TypeAlias = Mapping[str, Any] | Sequence[Mapping[str, Any]] | None


def cases(grid: Grid) -> Iterator[dict[str, Any]]:
    """Yield every choice of values, the first parameter changing slowest; none without a grid."""
    for entry in _entries(grid):
        for values in product(*map(as_list, entry.values())):
            yield dict(zip(entry, values, strict=True))


def size(grid: Grid) -> int:
    """Count the choices, without listing them."""
    return sum(prod(len(as_list(value)) for value in entry.values()) for entry in _entries(grid))


def _entries(grid: Grid) -> Sequence[Mapping[str, Any]]:
    if isinstance(grid, Mapping):
        return [grid]
    return grid or ()


def as_list(value: Any) -> list[Any]:
    if isinstance(value, list):
        return value
    return [value]


# Options of environments that a task's own methods take as well.

Ending: TypeAlias = Literal["terminate", "absorb"]
"""Treatment of terminal states: the episode ends, or they absorb until the horizon."""
RenderMode: TypeAlias = Literal["ansi", "rgb_array", "rgb_array_list", "human"]
"""Results of `render`: text, pixels, the pixels of all states since the last call, or a window."""


# ---------- parts
# The parts of a task: components, observations, claims, examples, parameters, figures. Plain immutable data.

FINITE_SPACES = ("discrete", "multi_discrete", "one_hot")
"""Spaces of observations that hold finite components only."""
SpaceKind = Literal["auto", "box", "dict", "one_hot", "multi_discrete", "discrete"]
COUNTABLE = 2**52


@dataclass(frozen=True)
class Component:
    """A part of the state, the action or the observation.

    `low` and `high` are inclusive bounds, one for each element in row-major order; for a choice they bound the index of
    the label. `node` is what is observed (None for state and action components).
    """

    name: str
    type: Type
    low: tuple[float, ...]
    high: tuple[float, ...]
    domain: Domain | None = None
    symbol: str | None = None
    doc: str | None = None

    @property
    def is_finite(self) -> bool:
        """True where it takes finitely many values, few enough to be counted without rounding."""
        kept = self.type.kind is not Kind.REAL or not self.type.size
        return kept and all(abs(v) <= COUNTABLE for v in (*self.low, *self.high))

    @property
    def least(self) -> float:
        """The lower end of the widest range of an element; 0 where there is none."""
        return min(self.low, default=0.0)

    @property
    def most(self) -> float:
        """The upper end of the widest range of an element; 0 where there is none."""
        return max(self.high, default=0.0)

    @property
    def counts(self) -> tuple[int, ...]:
        """For a finite component, how many values each element takes."""
        counts = [int(h - b) + 1 for b, h in zip(self.low, self.high, strict=True)]
        return tuple(counts)

    @property
    def read(self) -> tuple[Role, str]:
        return (Role.STATE, self.name)

    @property
    def value(self) -> Expression:
        """Its present value in a state."""
        return Read(Role.STATE, self.name, self.type, self.least, self.most)


def by_name(components: Iterable[Component], values: Iterable[T]) -> dict[str, T]:
    return {c.name: value for c, value in zip(components, values, strict=True)}


def by_read(role: Role, components: Iterable[Component], values: Iterable[T]) -> dict[tuple[Role, str], T]:
    """Key one value for each component by the component's read in a role."""
    return {(role, c.name): value for c, value in zip(components, values, strict=True)}


def counts_of(components: Iterable[Component]) -> list[int]:
    """Count the values of each element of finite components, one component after the other."""
    counts: list[int] = []
    for c in components:
        counts += c.counts
    return counts


def are_finite(components: Iterable[Component]) -> bool:
    return all(c.is_finite for c in components)


@dataclass(frozen=True)
class Observation:
    """The agent's observation: components with their expressions, and the kind of space that holds them."""

    components: tuple[Component, ...]
    nodes: tuple[Node, ...]
    space: SpaceKind = "auto"
    is_state: bool = False  # nothing was declared: the state itself is observed

    @property
    def is_random(self) -> bool:
        """True if two observations of one state may differ."""
        return bool(draws(self.nodes))


@dataclass(frozen=True)
class ExpertMemory:
    """The memory of the expert: components, with nodes for their first and their next values.

    `initial` and `next` read NEXT, what is then observed, by its name; `next` also reads STATE, which is the memory itself,
    ACTION and TIME, the steps taken before. Both draw nothing. An int is moved to the nearest end of its range, and
    `raw_initial` and `raw_next` are as written, as in `Task`. The last components, `seen` in number, are observations that the
    expert reads, under their names: they hold what is seen now.
    """

    components: tuple[Component, ...]
    initial: tuple[Node, ...]
    next: tuple[Node, ...]
    raw_initial: tuple[Node, ...]
    raw_next: tuple[Node, ...]
    seen: int = 0

    @property
    def nodes(self) -> tuple[Node, ...]:
        """All values, as they are and as written."""
        return (*self.initial, *self.next, *self.raw_initial, *self.raw_next)

    def only(self, kept: Sequence[int]) -> ExpertMemory:
        """Keep some components of the memory, by number."""

        def chosen(column: Sequence[T]) -> tuple[T, ...]:
            return tuple(column[i] for i in kept)

        return ExpertMemory(
            chosen(self.components), chosen(self.initial), chosen(self.next),
            chosen(self.raw_initial), chosen(self.raw_next), len(kept) - len(self.declared),
        )  # fmt: skip

    @property
    def declared(self) -> tuple[Component, ...]:
        """The components that the spec declares."""
        return self.components[: len(self.components) - self.seen]

    @property
    def lines(self) -> tuple[Node, ...]:
        """All values as declared, a first and a next one in turn."""
        nodes: list[Node] = []
        for first, later, _ in zip(self.raw_initial, self.raw_next, self.declared, strict=False):
            nodes += (first, later)
        return tuple(nodes)


@dataclass(frozen=True)
class Symmetry:
    """Another way to see and to steer the task, in which every policy has one that earns the same.

    `components` and `observation` are what is seen then, over NEXT, what the task shows by the names of `seen`; `action` has, in
    the order of the task's action, what does then what an action, read as ACTION, did. None of them draws. Where one of the two
    is empty, that stays as it is. Whether they are one-to-one is not known yet: `exact.abstraction.abstraction` finds out.
    """

    name: str
    doc: str | None = None
    seen: tuple[Component, ...] = ()
    components: tuple[Component, ...] = ()
    observation: tuple[Node, ...] = ()
    action: tuple[Node, ...] = ()

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both maps."""
        return (*self.observation, *self.action)


@dataclass(frozen=True)
class Soft:
    """The Boltzmann-rational expert at inverse temperature `beta`."""

    beta: float


@dataclass(frozen=True)
class Claim:
    """A statement about exact results: surface syntax, the parameter values to try, and how closely to test it."""

    expr: s.Expr
    text: str
    cases: tuple[Mapping[str, Any], ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Followed:
    """One consequence that an example states: its section, the entry there, and the expected value."""

    section: str
    name: str | None
    expr: s.Expr


@dataclass(frozen=True)
class Example:
    """A worked example in surface syntax: what is given, what follows, and the parameter values that it is about."""

    place: s.Place
    given: Mapping[tuple[Role, str], s.Expr]
    follows: tuple[Followed, ...]
    t: int = 0
    probability: s.Expr | None = None
    cases: tuple[Mapping[str, Any], ...] = ()

    @property
    def acts(self) -> bool:
        """True where an action is taken, so that what is observed is observed after it."""
        return any(role is Role.ACTION for role, _ in self.given)

    @property
    def steps(self) -> bool:
        """True where it is about a step, and not about a state alone."""
        return self.acts or any(f.section in ("next", "reward", "terminal", "truncated") for f in self.follows)

    @property
    def starts(self) -> bool:
        """True where it is about the first state."""
        return any(f.section == "initial" for f in self.follows)


@dataclass(frozen=True)
class Parameter:
    """A parameter: its bound value, and how it was declared. Callers may give it under its `alias` as well."""

    name: str
    kind: str
    value: Any
    default: Any
    low: float | None = None
    high: float | None = None
    values: tuple[Any, ...] | None = None
    symbol: str | None = None
    doc: str | None = None
    alias: str | None = None

    @property
    def ends(self) -> tuple[float, float]:
        """Its bounds, infinite where there are none."""
        low = -math.inf
        if self.low is not None:
            low = self.low
        high = math.inf
        if self.high is not None:
            high = self.high
        return low, high


@dataclass(frozen=True)
class Modifier:
    """A change that a task was given, by its name in the table of modifiers, with its arguments in the order of that table.

    Written as on the command line: `sticky=0.25`, `distractors=3,kind=normal`, or the name alone.
    """

    name: str
    arguments: tuple[tuple[str, Any], ...] = ()

    def __str__(self) -> str:
        if not self.arguments:
            return self.name
        (_, first), *others = self.arguments
        return ",".join([f"{self.name}={_argument(first)}", *(f"{key}={_argument(value)}" for key, value in others)])


def _argument(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)


@dataclass(frozen=True)
class Figure:
    """The figure of the task: the kind, and what it shows as nodes over STATE.

    `at` is a place, two numbers or one vector of two, on a grid maybe with two more for the way that the agent faces; so are the
    places of `objects`, which are drawn as words; `curve` a function of its first number; `values` the vector that bars show.
    `highlight` has conditions, places or indices by the name of their colour, `map` the rows of a grid of letters.
    """

    kind: str
    at: tuple[Node, ...] = ()
    curve: Node | None = None
    values: Node | None = None
    highlight: Mapping[str, Node] = field(default_factory=dict)
    map: tuple[str, ...] = ()
    objects: Mapping[str, tuple[Node, ...]] = field(default_factory=dict)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """All that it shows."""
        single = []
        for node in (self.curve, self.values):
            if node is not None:
                single.append(node)
        places: list[Node] = []
        for at in self.objects.values():
            places += at
        return (*self.at, *places, *single, *self.highlight.values())


@dataclass(frozen=True)
class Surface:
    """The parsed sections, for the printers and for whoever asks what the author wrote."""

    sections: Mapping[str, Any]  # section -> expression, or name -> expression
    scopes: Mapping[str, Scope] = field(default_factory=dict, repr=False)  # names visible per section
    moved: tuple[ClampedIndex, ...] = ()  # indices that may lie outside their vectors
    meanings: Mapping[tuple[str, int], tuple[s.Expr, Value]] = field(default_factory=dict, repr=False)
    shapes: Mapping[str, Shape] = field(default_factory=dict, repr=False)  # of definitions and of noise
    argument_axes: Mapping[tuple[str, str], int] = field(default_factory=dict, repr=False)  # by definition and argument
    expressions: int = 0  # that sections came to, each as often as it is written out: what the build cost

    def meaning(self, section: str, part: s.Expr) -> Value | None:
        """Value of a part of a section when the task was built; None for one in a comprehension or a definition."""
        value = self.meanings.get((section, id(part)))
        if value is None:
            return None
        return value[1]


# The kinds of figures. `taskspec.show.figures` imports the module that an entry names when it draws a figure of that kind.


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A kind of figure.

    `draw` names a function (`module:name`) from a task and an `Overlay` to a scene, or None where it cannot be drawn.
    `keys` are those keys of the section `figure` without which it means nothing; `doc` says which keys it reads, for the
    reference of the language; `needs` says which tasks it can draw, for messages.
    """

    name: str
    draw: str
    doc: str
    needs: str
    keys: tuple[str, ...] = ()


_TRANSITIONS = "none; a graph with too many states or crossing arrows is drawn as a matrix of transition probabilities"
_VECTOR = "bars need a vector, `values: v`, or a matrix of at most 24 rows and columns"

_ENTRIES = (
    FigureKind(
        "graph", "taskspec.show.figures.graph:graph", _TRANSITIONS,
        "transition graphs need a finite task with few states and few crossing arrows that fits on a page",
    ),
    FigureKind(
        "matrix", "taskspec.show.figures.machine:matrix", _TRANSITIONS,
        "tables of transitions need a finite task with at most 300 states visited",
    ),
    FigureKind(
        "grid", "taskspec.show.figures.grid:grid",
        "`at: [column, row]`, two expressions or one vector, or `[column, row, dx, dy]` with the direction that the agent faces; "
        "`map`, the name of a constant grid of letters, in which `#` is a wall, or of a matrix of conditions (walls) or digits, "
        "which may be drawn per instance; `objects`, other objects, as `word: [column, row]`, with or without a direction; "
        "anything outside the grid is not drawn",
        "columns and rows are two integers of the state, up to 5,000", keys=("at",),
    ),
    FigureKind(
        "curve", "taskspec.show.figures.plane:curve", "`at: [x, y]`, `curve`, an expression of the first",
        "a curve needs a component of the state: `at: [x, y]`", keys=("at", "curve"),
    ),
    FigureKind("bars", "taskspec.show.figures.bars:bars", "`values`, the vector", _VECTOR),
    FigureKind("swaps", "taskspec.show.figures.bars:bars", "`values`, the vector", _VECTOR),
    FigureKind(
        "vector", "taskspec.show.figures.bars:bars", "`values`, the vector, or a matrix, which is drawn as a board", _VECTOR,
    ),
    FigureKind(
        "portrait", "taskspec.show.figures.plane:portrait",
        "`at: [x, v]`, two bounded components: a phase portrait, and an episode of the expert",
        "phase portraits need two bounded numbers of the state, `at: [x, v]`, and steps without draws", keys=("at",),
    ),
    FigureKind(
        "series", "taskspec.show.figures.series:series",
        "`values`, a number or a vector, or else the components of the state: an episode over time, of the expert where its "
        "actions are expressions, else of random actions; in videos, the episode so far",
        "a series needs finite numbers that change",
    ),
    FigureKind(
        "arm", "taskspec.show.figures.plane:arm", "`values`, the angles of the links, each measured from hanging straight down",
        "an arm has up to 30 finite angles: `values: [a, a + b]`", keys=("values",),
    ),
)  # fmt: skip
FIGURE_KINDS: dict[str, FigureKind] = entries_by_name(_ENTRIES)
DEFAULT = "graph"
"""The kind of the figure of a task whose spec asks for none."""
