"""`taskspec list`: the tasks there are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from taskspec.base.columns import Columns
from taskspec.base.diagnostics import SpecError, spec_error, suggest
from taskspec.base.display import plural, visible
from taskspec.base.terminal import VisibleText, console
from taskspec.cli import options
from taskspec.cli.console import fail, write_json

if TYPE_CHECKING:
    from taskspec.language.task.build import Outline
    from taskspec.language.task.task import Task

    Listed = Task | Outline

WIDE = 110  # from this width on, rows have room for the capability, which is a heading otherwise
WIDEST = 150  # from this width on, rows have room for a summary


def list_(
    targets: options.Targets = None,
    capability: Annotated[str | None, Option("--capability", help="Only tasks that isolate this.")] = None,
    json: options.Json = False,
) -> None:
    """List tasks with their parameters, size and horizon.

    The size is states × actions, and tasks are grouped by the capability that they isolate.
    """
    from taskspec.language.targets import files_of, outlines_in, tasks_in
    from taskspec.language.task.record import record

    files = files_of(targets or [])
    found = list(tasks_in(files) if json else outlines_in(files))
    tasks: list[Any] = [each for each in found if not isinstance(each, SpecError)]
    problems = [problem for each in found if isinstance(each, SpecError) for problem in each.diagnostics]
    if capability is not None:
        tasks = _isolating(capability, tasks)
    if json:
        write_json(list(map(record, tasks)))
    else:
        _print_tasks(tasks)
    if problems:
        fail(problems)


def _isolating(capability: str, tasks: Sequence[Listed]) -> list[Listed]:
    found = [task for task in tasks if _capability(task).startswith(capability)]
    if not found:
        known = sorted(set(map(_capability, tasks)) - {""})
        hint = suggest(capability, known) or f"there are {', '.join(known)}"
        raise spec_error("E701", f"no task isolates '{capability}'", hint)
    return found


def _capability(task: Listed) -> str:
    return visible(task.capability or "")


def _print_tasks(tasks: Sequence[Listed]) -> None:
    """Print a row for each task, those that isolate the same thing side by side, in order of first mention."""
    from taskspec.language.task.record import horizon, settings, size

    order: dict[str, int] = {}
    for task in tasks:
        order.setdefault(_capability(task), len(order))
    ordered = sorted(tasks, key=lambda task: order[_capability(task)])
    out = console(wide=True)
    if out.width < WIDE:
        table = Columns("task", "parameters", "size", "horizon", right=(2, 3), fold=(1,), names=0, spare=(3,))
        for title, members in groupby(ordered, lambda task: _capability(task) or "other"):
            table.add_row(VisibleText(title, style="title"))
            for task in members:
                table.add_row(VisibleText(f"  {task.id}", style="name"), settings(task), size(task), horizon(task))
    else:
        table = Columns(
            "task", "isolates", "parameters", "size", "horizon", "summary", right=(3, 4), fold=(2, 5),
            styles=("name", "", "", "", "", "quiet"), names=0, spare=(5,),
        )  # fmt: skip
        for task in ordered:
            summary = visible(task.summary) * (out.width >= WIDEST)
            table.add_row(task.id, _capability(task), settings(task), size(task), horizon(task), summary)
    out.print(table)
    if out.is_terminal:
        out.print(f"\n{plural(len(tasks), 'task')}; `taskspec show ID` shows one", style="quiet")
