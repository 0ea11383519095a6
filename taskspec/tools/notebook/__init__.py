"""Notebooks: tasks, results and exams as HTML, and a widget that shows values on the figure and plays an episode.

`InNotebooks` of `taskspec.base.display` leads here. anywidget and traitlets are imported in `widget`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from taskspec.base.diagnostics import SpecError
from taskspec.base.display import decimal, html_table
from taskspec.base.extras import need
from taskspec.exact import Results
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.exam.card import Card, card
from taskspec.learn.exam.card_picture import picture
from taskspec.show.figures import chart, drawing
from taskspec.show.pages import page

if TYPE_CHECKING:
    from taskspec.tools.notebook.widget import Explorer

__all__ = ["explore"]

RETURNS = ("optimal", "expert", "random", "worst")


def explore(task: TaskLike, seed: int = 0) -> Explorer:
    """Return a widget that shows values and policies of a task on its figure, and plays an episode of it.

    Args:
        task: what to show.
        seed: of the episode.

    Returns:
        The widget, for the last line of a cell.

    Raises:
        SpecError: E705 without the extra `notebook`; any mistake in the spec.
    """
    need("anywidget", "notebook", "the widget")
    from taskspec.tools.notebook.widget import Explorer

    return Explorer(task, seed)


def html(thing: Any) -> str:
    """Return what a notebook shows of a task, of results or of an exam."""
    match thing:
        case Task():
            return "".join(_of_task(thing))
        case Results():
            return "".join(_of_results(thing))
        case _:
            return _of_exam(card(thing))


def _of_task(task: Task) -> Iterator[str]:
    """Yield what the task has, its figure and its mathematics; without what cannot be made."""
    rows: list[tuple[object, ...]] = [("parameter", p.name, p.value, p.doc or "") for p in task.parameters]
    rows += [("state", c.name, c.type, c.doc or "") for c in task.state]
    rows += [("action", c.name, c.type, c.doc or "") for c in task.action]
    rows += [("horizon", "", task.horizon, ""), ("observations", "", task.observation_space, "")]
    rows += [("modifier", modifier, "", "") for modifier in task.modifiers]
    yield html_table(f"{task.id}: {task.summary}", (), rows)
    yield from _figure(task)
    if not task.modifiers:
        try:
            yield page(task)._repr_html_()
        except SpecError:
            return


def _of_results(results: Results) -> Iterator[str]:
    rows = []
    for name in RETURNS:
        value = getattr(results, name)
        if value is not None:
            rows.append((name, decimal(value.value, 10), value.status))
    yield html_table(
        f"{results.task.instance_id}: {results.why_not or 'from an exact model'}", ("return", "value", "status"), rows
    )
    if results.model is not None:
        yield from _figure(results.task, "values", "policy")


def _of_exam(shown: Card) -> str:
    """Return the card of an exam as a chart; without matplotlib, its scores as a table."""
    if chart.is_available():
        return chart.svg(picture(shown))
    rows = [(row.name, row.printed.words, row.grade or "") for row in shown.rows]
    return html_table(f"{shown.learner}: {shown.lead}", ("task", "score", "verdict"), rows)


def _figure(task: Task, *overlays: str) -> Iterator[str]:
    try:
        yield drawing(task, overlays).svg or ""
    except SpecError:
        return
