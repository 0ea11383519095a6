"""`taskspec list`: the tasks there are, by what they isolate."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

from taskspec.cli import failures
from taskspec.cli.options import Json, Targets
from taskspec.diagnostics import Diagnostic, SpecError

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.spec.task import Task

WIDE = 110
"""From this width on, a row has room for everything."""


def list_tasks(targets: Targets = None, json: Json = False) -> None:
    """List tasks with their parameters, size and horizon.

    The size is states × actions, and the order is by the capability that tasks isolate.
    """
    tasks: list[Task] = []
    problems: list[Diagnostic] = []
    for found in _tasks(targets or []):
        if isinstance(found, SpecError):
            problems += found.diagnostics
        else:
            tasks.append(found)
    _print_json(tasks) if json else _print(tasks)
    if problems:
        failures.fail(problems)


def _tasks(targets: list[str]) -> Iterator[Task | SpecError]:
    """The tasks, and what is wrong with specs that define none."""
    from taskspec.cli.specs import task_in, variants_of
    from taskspec.cli.targets import files_of

    for file in files_of(targets):
        try:
            for variant in variants_of(file):
                yield task_in(file, variant)
        except SpecError as error:
            yield error


def _print_json(tasks: list[Task]) -> None:
    from taskspec.cli.console import write_json
    from taskspec.cli.records import record

    write_json([record(task) for task in tasks])


def _print(tasks: list[Task]) -> None:
    from taskspec.cli.console import console

    out = console(wide=True)
    out.print(_wide(tasks) if out.width >= WIDE else _narrow(tasks))
    if out.is_terminal:
        files = len({task.document.origin.name for task in tasks})
        out.print(f"\n{len(tasks)} tasks in {files} specs; `taskspec show ID` shows one", style="quiet")


def _wide(tasks: list[Task]) -> Table:
    """One row a task, with everything in it."""
    from taskspec.cli.console import clean, columns
    from taskspec.cli.records import defaults, horizon, size

    table = columns("task", "isolates", "parameters", "size", "horizon", "summary", right=(3, 4))
    table.columns[5].overflow = "ellipsis"
    for task in tasks:
        data = task.surface.data
        table.add_row(
            f"{task.id}", clean(str(data.get("capability") or "")), defaults(task), size(task), horizon(task),
            clean(str(data.get("summary") or "")), style=_style(task),
        )  # fmt: skip
    table.columns[5].style = "quiet"
    table.columns[0].style = "name"
    return table


def _narrow(tasks: list[Task]) -> Table:
    """For 80 columns: the capability is a heading, so that rows have room."""
    from rich.text import Text

    from taskspec.cli.console import clean, columns
    from taskspec.cli.records import defaults, horizon, size

    table = columns("task", "parameters", "size", "horizon", right=(2, 3))
    capability = lambda task: str(task.surface.data.get("capability") or "other")  # noqa: E731
    for title, members in groupby(tasks, capability):
        table.add_row(Text(clean(title), style="title"))
        for task in members:
            table.add_row(Text(f"  {task.id}", style="name"), defaults(task), size(task), horizon(task))
    return table


def _style(task: Task) -> str:
    return "quiet" if task.variant == "seals" else ""
