"""The kinds of figures: one entry for each, with the keys that a spec must give, its documentation, and what draws it.

Nothing is imported here: `taskspec.figures` imports the module that an entry names when it draws a figure of that kind.
"""

from __future__ import annotations

from dataclasses import dataclass


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
_VECTOR = "bars need a vector: `values: v`"

_ENTRIES = (
    FigureKind(
        "graph", "taskspec.figures.graph:graph", _TRANSITIONS,
        "transition graphs need a finite task with few states and few crossing arrows that fits on a page",
    ),
    FigureKind(
        "matrix", "taskspec.figures.matrix:matrix", _TRANSITIONS,
        "tables of transitions need a finite task with at most 300 states visited",
    ),
    FigureKind(
        "grid", "taskspec.figures.grid:grid",
        "`at: [column, row]`, two expressions or one vector, or `[column, row, dx, dy]` with the direction that the agent faces; "
        "`map`, the name of a constant grid of letters, in which `#` is a wall, or of a matrix of conditions (walls) or digits, "
        "which may be drawn per instance; `objects`, other objects, as `word: [column, row]`, with or without a direction; "
        "anything outside the grid is not drawn",
        "columns and rows are two integers of the state, up to 5,000", keys=("at",),
    ),
    FigureKind(
        "curve", "taskspec.figures.plane:curve", "`at: [x, y]`, `curve`, an expression of the first",
        "a curve needs a component of the state: `at: [x, y]`", keys=("at", "curve"),
    ),
    FigureKind("bars", "taskspec.figures.bars:bars", "`values`, the vector", _VECTOR),
    FigureKind("swaps", "taskspec.figures.bars:bars", "`values`, the vector", _VECTOR),
    FigureKind("vector", "taskspec.figures.bars:bars", "`values`, the vector", _VECTOR),
    FigureKind(
        "portrait", "taskspec.figures.plane:portrait",
        "`at: [x, v]`, two bounded components: a phase portrait, and an episode of the expert",
        "phase portraits need two bounded numbers of the state, `at: [x, v]`, and steps without draws", keys=("at",),
    ),
    FigureKind(
        "series", "taskspec.figures.series:series",
        "`values`, a number or a vector, or else the components of the state: an episode of the expert over time; "
        "in videos, the episode so far",
        "a series needs an expert given by expressions, no draws and finite numbers",
    ),
    FigureKind(
        "arm", "taskspec.figures.plane:arm", "`values`, the angles of the links, each measured from hanging straight down",
        "an arm has up to 30 finite angles: `values: [a, a + b]`", keys=("values",),
    ),
)  # fmt: skip
FIGURE_KINDS: dict[str, FigureKind] = {entry.name: entry for entry in _ENTRIES}
DEFAULT = "graph"
"""The kind of the figure of a task whose spec asks for none."""
