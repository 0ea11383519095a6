"""Figures of a task, drawn from the task itself: graphs, grids, curves, bars; as SVG, TikZ, PNG, PDF or pixels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Diagnostic, SpecError, raise_if_errors, spec_error
from taskspec.base.files import write_text
from taskspec.exact.model.model import Model, NoModel
from taskspec.exact.soundness.soundness import soundness
from taskspec.language.registry import load
from taskspec.language.task.merge import merge
from taskspec.language.task.parts import DEFAULT, FIGURE_KINDS
from taskspec.language.task.task import Task, TaskLike
from taskspec.show.figures import raster
from taskspec.show.figures.overlays import OVERLAYS as OVERLAYS
from taskspec.show.figures.overlays import PARTS
from taskspec.show.figures.overlays import Overlay as Overlay
from taskspec.show.figures.overlays import overlay as overlay
from taskspec.show.figures.shapes import Label, keyed
from taskspec.show.figures.shapes import Scene as Scene
from taskspec.show.figures.states import not_drawn, state_table
from taskspec.show.figures.vector_formats import svg as svg
from taskspec.show.figures.vector_formats import tikz as tikz
from taskspec.show.figures.vector_formats import tikz_colors
from taskspec.show.printers.tree import Words


def _kinds_beside(name: str) -> str:
    return ", ".join(filter(name.__ne__, FIGURE_KINDS))


HINT = f"{FIGURE_KINDS[DEFAULT].needs}; `figure: {{kind: ...}}` in a spec asks for another figure: {_kinds_beside(DEFAULT)}"
"""The hint for a task without a figure."""


def undrawn(task: TaskLike) -> tuple[Diagnostic, ...]:
    """Return W523 if the figure that a spec asks for cannot be drawn, else nothing."""
    task = load(task)
    if task.annotations.figure is None or _drawn(task.unmodified, Overlay()) is not None:
        return ()
    place = merge(task.source.document, task.source.variant).key_span(("figure",))
    kind = FIGURE_KINDS[task.annotations.figure.kind]
    hint = f"{kind.needs}; other kinds are {_kinds_beside(kind.name)}"
    return (Diagnostic("W523", place, f"no figure of kind `{kind.name}` can be drawn of this task", hint),)


def scene(task: TaskLike, over: Overlay | None = None) -> Scene | None:
    """Return the figure of a task: of the kind that its spec asks for, else a graph, else an episode over time, else None.

    A figure that a spec asks for is never missing: a graph with too many crossings becomes a table, and a figure that does
    not fit at these parameters becomes a frame that says so. It shows the task without its modifiers. Below it there is a
    legend line for each overlay: how it is drawn, or that it is not.
    """
    task = load(task).unmodified
    over = over or Overlay()
    drawn = _drawn(task, over)
    if drawn is None and task.annotations.figure is not None and over.here is None:
        drawn = not_drawn(task, FIGURE_KINDS[task.annotations.figure.kind].needs)
    if drawn is None:
        return None
    return _with_lines(drawn, [line for _, _, line in _each_part(task, over, drawn)])


def layers(task: TaskLike, model: Model | None = None) -> dict[str, Scene]:
    """Return the figure with each overlay alone that it has a place for, by name; none without an exact model.

    The model of the task is worked out if it is not given.
    """
    task = load(task)
    if task.modifiers or task.spec.abstraction is not None or _drawn(task, Overlay()) is None:
        return {}
    wanted: list[tuple[str, ...]] = [PARTS]
    if isinstance(task.annotations.expert, tuple):
        wanted.append(("expert",))
    scenes = {}
    for names in wanted:
        try:
            over = overlay(task, names, model)
        except SpecError:
            return {}
        for part, drawn, line in _each_part(task, over):
            if drawn is not None:
                name = "expert" if names == ("expert",) else part
                scenes[name] = _with_lines(drawn, [line])
    return scenes


def _with_lines(drawn: Scene, lines: list[str]) -> Scene:
    drawn = keyed(drawn)
    if not lines:
        return drawn
    words = []
    for i, line in enumerate(lines):
        words.append(Label((0.0, drawn.height + 0.25 + 0.45 * i), Words(line), 0.26, "start", "muted"))
    return drawn.extended(words, "; ".join((drawn.alt, *lines)))


def _each_part(task: Task, over: Overlay, whole: Scene | None = None) -> Iterator[tuple[str, Scene | None, str]]:
    """Yield each part of an overlay: its name, the figure with it alone if that shows it, and its line of the legend.

    The line says how the part is drawn in the whole figure; unless that is given, in the figure with this part alone.
    """
    if not over.legend:
        return
    bare = _drawn(task, over.only())
    for part, (scale, what) in over.legend.items():
        drawn = _drawn(task, over.only(part)) if part in PARTS else None
        shown = whole or drawn
        how = shown.drawn.get(part) if shown is not None else None
        if drawn is None or how is None or part not in drawn.drawn or drawn.shows(bare):
            yield part, None, f"not drawn: {what}"
        else:
            yield part, drawn, f"{how.format(scale)}: {what}"


def _drawn(task: Task, over: Overlay) -> Scene | None:
    """Return the figure, or None if it cannot be drawn."""
    kinds = [DEFAULT, "series"]
    if task.annotations.figure is not None:
        kinds = [task.annotations.figure.kind]
        if kinds == ["graph"]:
            kinds.append("matrix")
    elif any(getattr(over, part) for part in PARTS) and _of_kind(DEFAULT, task, over.only()) is not None:
        kinds.insert(1, "matrix")  # where what is laid over the graph makes it too crowded
    for name in kinds:
        drawn = _of_kind(name, task, over)
        if drawn is not None:
            return drawn
    return None


def _of_kind(name: str, task: Task, over: Overlay) -> Scene | None:
    module, _, function = FIGURE_KINDS[name].draw.partition(":")
    try:
        drawn: Scene | None = getattr(import_module(module), function)(task, over)
    except NoModel:
        raise_if_errors(soundness(task))
        return None
    return drawn


@dataclass(frozen=True)
class ShownFigure:
    """A task's figure in memory, as notebooks show it; `svg` is its text, None if none can be drawn."""

    svg: str | None = field(repr=False)

    def _repr_svg_(self) -> str | None:
        return self.svg


def drawing(task: TaskLike, overlays: Iterable[str] = ()) -> ShownFigure:
    """Return a task's figure in memory; `figure` writes it to a file.

    Args:
        task: what to draw.
        overlays: names of `OVERLAYS`.

    Returns:
        The figure, which notebooks display; its `svg` is None if none can be drawn.

    Raises:
        SpecError: E713 for an unknown overlay, or one that needs an exact model.
    """
    task = load(task)
    drawn = scene(task, overlay(task, overlays))
    if drawn is None:
        return ShownFigure(None)
    return ShownFigure(svg(drawn))


def figure(task: TaskLike, path: Path | str, overlays: Iterable[str] = ()) -> Path:
    """Write a task's figure to a file.

    Args:
        task: what to draw.
        path: ends in `.svg`, `.tex` (TikZ), `.png` or `.pdf`.
        overlays: names of `OVERLAYS`.

    Returns:
        The path.

    Raises:
        SpecError: if the task has no figure, the ending is unknown, or an extra is missing.
    """
    task = load(task)
    path = Path(path)
    drawn = scene(task, overlay(task, overlays))
    if drawn is None:
        raise spec_error("E713", f"{task.id} has no figure that can be drawn", HINT)
    return save(drawn, path)


def save(scene: Scene, path: Path) -> Path:
    """Write a scene to a file that ends in `.svg`, `.tex` (TikZ), `.png` or `.pdf`; the same scene gives the same bytes."""
    match path.suffix:
        case ".svg":
            write_text(path, svg(scene) + "\n")
        case ".tex" | ".tikz":
            write_text(path, f"{tikz_colors()}\n{tikz(scene)}\n")
        case ".png" | ".pdf":
            raster.save(scene, path, path.suffix[1:])
        case other:
            message = f"'{other}' is not a format of figures"
            raise spec_error("E726", message, "use .svg, .tex, .png or .pdf")
    return path


def render_frame(
    task: TaskLike,
    state: Mapping[str, Any],
    title: str = "",
    size: tuple[int, int] = (640, 480),
    seen: Mapping[int, Mapping[str, Any]] | None = None,
) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Draw one state as a picture; every task has one.

    Args:
        task: the task.
        state: values by component; labels or their indices for choices.
        title: lines of text above, such as the step.
        size: width and height in pixels, the same for all frames of an episode.
        seen: states of the episode by time, ending with this one; figures over time need them.

    Returns:
        Red, green and blue of each pixel, uint8 (height, width, 3).
    """
    task = load(task)
    over = Overlay(here=state, seen=seen or {})
    drawn = scene(task, over) or state_table(task, state)
    return raster.pixels(drawn, size, title)
