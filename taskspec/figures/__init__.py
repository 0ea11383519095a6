"""Figures of a task, drawn from the task itself: graphs, grids, curves, bars; as SVG, TikZ, PNG, PDF or pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Diagnostic, SpecError, raise_if_errors
from taskspec.base.files import write_text
from taskspec.figures import raster
from taskspec.figures.bars import bars, table
from taskspec.figures.curve import curve
from taskspec.figures.graph import graph
from taskspec.figures.grid import grid
from taskspec.figures.marks import keyed
from taskspec.figures.matrix import matrix
from taskspec.figures.motion import MOST_LINKS, arm, portrait
from taskspec.figures.overlays import OVERLAYS as OVERLAYS
from taskspec.figures.overlays import PARTS
from taskspec.figures.overlays import Overlay as Overlay
from taskspec.figures.overlays import overlay as overlay
from taskspec.figures.scene import Scene as Scene
from taskspec.figures.scene import stated, with_legend
from taskspec.figures.series import followed, series
from taskspec.figures.svg import svg as svg
from taskspec.figures.tikz import colors as tikz_colors
from taskspec.figures.tikz import tikz as tikz
from taskspec.model.model import NoModel
from taskspec.registry import load
from taskspec.soundness.soundness import soundness
from taskspec.task.merge import merge
from taskspec.task.task import Task, TaskLike

KINDS: dict[str, Callable[[Task, Overlay], Scene | None]] = {
    "graph": graph, "matrix": matrix, "grid": grid, "curve": curve, "bars": bars, "swaps": bars, "vector": bars,
    "portrait": portrait, "series": series, "arm": arm,
}  # fmt: skip

NEEDED = {
    "graph": "transition graphs need a finite task with few states and few crossing arrows that fits on a page",
    "matrix": "tables of transitions need a finite task with at most 300 states visited",
    "grid": "columns and rows are two integers of the state, up to 5,000",
    "portrait": "phase portraits need two bounded numbers of the state, `at: [x, v]`, and steps without draws",
    "series": "a series needs an expert given by expressions, no draws and finite numbers",
    "arm": f"an arm has up to {MOST_LINKS} finite angles: `values: [a, a + b]`",
    "curve": "a curve needs a component of the state: `at: [x, y]`",
}
"""What a figure of some kind needs; the others show a vector."""
NEEDED_OTHERWISE = "bars need a vector: `values: v`"
HINT = (
    f"{NEEDED['graph']}; `figure: {{kind: ...}}` in a spec asks for another figure: "
    + ", ".join(k for k in KINDS if k != "graph")
)  # fmt: skip


def undrawn(task: TaskLike) -> tuple[Diagnostic, ...]:
    """W523 where the figure that a spec asks for cannot be drawn."""
    task = load(task)
    if task.figure is None or _drawn(task.unmodified, Overlay()) is not None:
        return ()
    place = merge(task.document, task.variant).key_span(("figure",))
    hint = NEEDED.get(task.figure.kind, NEEDED_OTHERWISE)
    return (Diagnostic("W523", place, f"no figure of kind `{task.figure.kind}` can be drawn of this task", hint),)


def scene(task: TaskLike, over: Overlay | None = None) -> Scene | None:
    """The figure of a task: the kind its spec asks for, else a graph where one can be drawn; None where none can.

    A figure that a spec asks for is never missing: a knot of arrows becomes a table, and what has no room at these
    parameters becomes a frame that says so. It shows the task as its spec has it: modifiers change none. What is laid
    over it is told below it: how it is drawn, or else what is known of the state that the figure shows.
    """
    task, over = load(task).unmodified, over or Overlay()
    found = _drawn(task, over)
    if found is None and task.figure is not None and over.here is None:
        found = stated(task, NEEDED.get(task.figure.kind, NEEDED_OTHERWISE))
    return found if found is None else with_legend(keyed(found), tuple(_legend(task, found, over)))


def _legend(task: Task, found: Scene, over: Overlay) -> Iterator[str]:
    """Of each result that is laid over the figure how it is drawn; or in words; or that it is not."""
    if not over.legend:
        return
    bare = _drawn(task, over.only(None))
    known = {} if found.state is None or over.told is None else over.told(found.state)
    for part, (scale, what) in over.legend.items():
        laid = _drawn(task, over.only(part)) if part in PARTS else None
        if laid is not None and not laid.shows(bare):
            yield f"{laid.drawn[part].format(scale)}: {what}"
        elif part in known:
            yield f"{what}, from the first state shown: {known[part]}"
        else:
            yield f"not drawn: {what}"


def _drawn(task: Task, over: Overlay) -> Scene | None:
    """The figure, or None where it cannot be drawn.

    Raises:
        SpecError: with the mistakes of a task that is not sound, where they are why it cannot be drawn.
    """
    kind = "graph" if task.figure is None else task.figure.kind
    try:
        found = KINDS[kind](task, over)
        is_knot = found is None and task.figure is not None and kind == "graph"
        return matrix(task, over) if is_knot else found
    except NoModel:
        raise_if_errors(soundness(task))
        return None


@dataclass(frozen=True)
class ShownFigure:
    """A task's figure in memory, as notebooks show it; `svg` is its text, None where none can be drawn."""

    svg: str | None

    def _repr_svg_(self) -> str | None:
        return self.svg


def drawing(task: TaskLike, overlays: Iterable[str] = ()) -> ShownFigure:
    """A task's figure in memory; `figure` writes it to a file. `overlays` are names of `OVERLAYS`.

    Raises:
        SpecError: E713 for another overlay, or one that needs an exact model.
    """
    task = load(task)
    found = scene(task, overlay(task, overlays))
    return ShownFigure(None if found is None else svg(found))


def figure(task: TaskLike, path: Path | str, overlays: Iterable[str] = ()) -> Path:
    """Draw a task's figure to a file: `.svg`, `.tex` (TikZ), `.png` or `.pdf`; `overlays` are names of `OVERLAYS`.

    Raises:
        SpecError: when the task has no figure, the ending is another, or an extra is missing.
    """
    task, path = load(task), Path(path)
    found = scene(task, overlay(task, overlays))
    if found is None:
        raise SpecError((Diagnostic("E713", None, f"{task.id} has no figure that can be drawn", HINT),))
    match path.suffix:
        case ".svg":
            write_text(path, svg(found) + "\n")
        case ".tex" | ".tikz":
            write_text(path, f"{tikz_colors()}\n{tikz(found)}\n")
        case ".png" | ".pdf":
            raster.save(found, path, path.suffix[1:])
        case other:
            message = f"'{other}' is not a format of figures"
            raise SpecError((Diagnostic("E713", None, message, "use .svg, .tex, .png or .pdf"),))
    return path


def render_frame(
    task: TaskLike,
    state: Mapping[str, Any],
    title: str = "",
    size: tuple[int, int] = (640, 480),
    seen: Mapping[int, Mapping[str, Any]] | None = None,
) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """One state as a picture (height, width, 3) of uint8; every task has one.

    Args:
        task: the task.
        state: values by component; labels or their indices for choices.
        title: lines of text above, such as the step.
        size: width and height in pixels; frames of an episode are all alike in it.
        seen: states of the episode by time, this one the last: what is drawn over time needs them.
    """
    task, over = load(task), Overlay(here=state, seen=seen or {})
    found = scene(task, over) or followed(task.unmodified, over) or table(task, state)
    return raster.pixels(found, size, title)
