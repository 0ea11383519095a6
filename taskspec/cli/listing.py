"""`taskspec list`: the tasks there are, by what they isolate."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.cli import failures
from taskspec.cli.options import Json, Targets

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.task.task import Task

WIDE = 110
"""From this width on, a row has room for everything."""
ROOM = 40
"""With less room than this, summaries are left out."""


def list_tasks(targets: Targets = None, json: Json = False) -> None:
    """List tasks with their parameters, size and horizon.

    The size is states × actions, and tasks are grouped by the capability that they isolate.
    """
    from taskspec.targets import files_of, tasks_in

    tasks: list[Task] = []
    problems: list[Diagnostic] = []
    for found in tasks_in(files_of(targets or [])):
        if isinstance(found, SpecError):
            problems += found.diagnostics
        else:
            tasks.append(found)
    _print_json(tasks) if json else _print(_grouped(tasks))
    if problems:
        failures.fail(problems)


def _grouped(tasks: list[Task]) -> list[Task]:
    """Return tasks that isolate the same thing side by side, in order of first mention."""
    order: dict[str, int] = {}
    for task in tasks:
        order.setdefault(_words(task, "capability"), len(order))
    return sorted(tasks, key=lambda task: order[_words(task, "capability")])


def _print_json(tasks: list[Task]) -> None:
    from taskspec.cli.console import write_json
    from taskspec.task.record import record

    write_json([record(task) for task in tasks])


def _print(tasks: list[Task]) -> None:
    from taskspec.cli.console import console

    out = console(wide=True)
    out.print(_wide(tasks, out.width) if out.width >= WIDE else _narrow(tasks))
    if out.is_terminal:
        files = len({task.document.origin.name for task in tasks})
        out.print(f"\n{len(tasks)} tasks in {files} specs; `taskspec show ID` shows one", style="quiet")


def _wide(tasks: list[Task], width: int) -> Table:
    """Return one row a task, with as much of its summary as there is room for."""
    from rich.cells import cell_len

    from taskspec.cli.console import VisibleText, columns
    from taskspec.task.record import horizon, settings, size

    headers = ("task", "isolates", "parameters", "size", "horizon")
    rows = [(task.id, _words(task, "capability"), settings(task), size(task), horizon(task)) for task in tasks]
    used = sum(2 + max(map(cell_len, column)) for column in zip(headers, *rows, strict=True))
    room = width - used
    table = columns(*headers, *(["summary"] if room >= ROOM else []), right=(3, 4), fold=(2,))
    table.columns[0].style = "name"
    for task, row in zip(tasks, rows, strict=True):
        summary = VisibleText(_words(task, "summary"), style="quiet")
        summary.truncate(max(room, 1), overflow="ellipsis")
        table.add_row(*row, *([summary] if room >= ROOM else []))
    return table


def _words(task: Task, key: str) -> str:
    from taskspec.base.display import visible

    return visible(getattr(task.spec, key) or "")


def _narrow(tasks: list[Task]) -> Table:
    """For 80 columns: the capability is a heading, so that rows have room."""
    from taskspec.cli.console import VisibleText, columns
    from taskspec.task.record import horizon, settings, size

    table = columns("task", "parameters", "size", "horizon", right=(2, 3), fold=(1,))
    for title, members in groupby(tasks, lambda task: _words(task, "capability") or "other"):
        table.add_row(VisibleText(title, style="title"))
        for task in members:
            table.add_row(VisibleText(f"  {task.id}", style="name"), settings(task), size(task), horizon(task))
    return table
