"""`taskspec list`: the suites and tasks there are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from taskspec.base.diagnostics import spec_error, suggest
from taskspec.base.display import plural, visible
from taskspec.cli import options
from taskspec.cli.console import fail, write_json
from taskspec.show.terminal.styled_text import Columns, VisibleText, console

if TYPE_CHECKING:
    from rich.console import Console

    from taskspec.language.task.build import Outline
    from taskspec.language.task.task import Task

    Listed = Task | Outline

ONE_LINE = 150  # from this width on, a task takes one line; in a pipe as well
PADDED = 40  # the width to which names are padded at most


def list_(
    targets: options.Targets = None,
    capability: Annotated[str | None, Option("--capability", help="Only tasks that isolate this.")] = None,
    json: options.Json = False,
) -> None:
    """List the suites, or the tasks of some of them.

    Without arguments, suites and capabilities with the number of their tasks. With a suite, a folder or a capability, its tasks
    with size, horizon, parameters and summary. The size is states × actions.
    """
    from taskspec.show.record import record
    from taskspec.tools.targets import all_in, files_of, outline_in, task_in

    tasks: list[Any]
    read_task: Any = task_in if json else outline_in
    tasks, problems = all_in(files_of(targets or []), read_task)
    if capability is not None:
        tasks = _isolating(capability, tasks)
    if json:
        write_json(list(map(record, tasks)))
    elif targets or capability is not None:
        _print_tasks(tasks)
    else:
        _print_suites(tasks)
    if problems:
        fail(problems)


def _isolating(capability: str, tasks: Sequence[Listed]) -> list[Listed]:
    chosen = [task for task in tasks if _capability(task).startswith(capability)]
    if not chosen:
        known = sorted(set(map(_capability, tasks)) - {""})
        hint = suggest(capability, known) or f"there are {', '.join(known)}"
        raise spec_error("E701", f"no task isolates '{capability}'", hint)
    return chosen


def _capability(task: Listed) -> str:
    return visible(task.capability or "")


def _print_suites(tasks: Sequence[Listed]) -> None:
    """Print a row for each suite, the capabilities, and how to see their tasks."""
    from taskspec.show.record import SUITES

    out = console()
    of_suite: dict[str, list[Listed]] = {}
    for task in tasks:
        of_suite.setdefault(task.id.rpartition("/")[0], []).append(task)
    names = [*filter(of_suite.__contains__, SUITES), *sorted(of_suite.keys() - SUITES.keys())]
    table = Columns("suite", "tasks", "", right=(1,), styles=("name", "", "quiet"), fold=(2,), names=0)
    for name in names:
        line = SUITES[name].line if name in SUITES else _counted(of_suite[name])
        table.add_row(name, str(len(of_suite[name])), line)
    out.print(table)
    out.print(VisibleText(f"\ncapabilities: {_counted(tasks)}"))
    out.print("\n`taskspec list SUITE` or `--capability NAME` lists tasks; `taskspec show ID` shows one", style="quiet")


def _counted(tasks: Iterable[Listed]) -> str:
    """Return capabilities with the number of their tasks, the most frequent first: `memory 10, planning 3`."""
    counts = Counter(_capability(task) or "other" for task in tasks)
    return ", ".join(f"{name} {count}" for name, count in counts.most_common())


def _print_tasks(tasks: Sequence[Listed]) -> None:
    """Print tasks, those that isolate the same thing side by side, in order of first mention."""
    order: dict[str, int] = {}
    for task in tasks:
        order.setdefault(_capability(task), len(order))
    ordered = sorted(tasks, key=lambda task: order[_capability(task)])
    out = console(wide=True)
    if out.width < ONE_LINE:
        _print_groups(out, ordered)
    else:
        _print_table(out, ordered)
    if out.is_terminal:
        out.print(f"\n{plural(len(tasks), 'task')}; `taskspec show ID` shows one", style="quiet")


def _print_table(out: Console, tasks: Sequence[Listed]) -> None:
    from taskspec.show.record import horizon, settings, size

    table = Columns(
        "task", "isolates", "parameters", "size", "horizon", "summary", right=(3, 4), fold=(2, 5),
        styles=("name", "", "", "", "", "quiet"), names=0,
    )  # fmt: skip
    for task in tasks:
        summary = visible(task.summary)
        table.add_row(task.id, _capability(task), settings(task), size(task), horizon(task), summary)
    out.print(table)


def _print_groups(out: Console, tasks: Sequence[Listed]) -> None:
    """Print each task on two lines, its name above its summary; a capability is the heading of its tasks."""
    from rich.padding import Padding

    from taskspec.show.record import horizon, settings, size

    rows = [("task", "size", "horizon", "parameters")]
    rows += [(f"  {task.id}", size(task), horizon(task), settings(task)) for task in tasks]
    padded = [min(max(len(row[i]) for row in rows), PADDED) for i in range(3)]

    def print_row(row: tuple[str, str, str, str], style: str = "") -> None:
        name, size_of, steps, values = row
        numbers = f"  {size_of:>{padded[1]}}  {steps:>{padded[2]}}"
        start = VisibleText().append(f"{name:<{padded[0]}}", style or "name").append(numbers, style)
        if start.cell_len + 2 + len(values) <= out.width:
            out.print(start.append(f"  {values}".rstrip(), style))
        else:
            out.print(start)
            out.print(Padding(VisibleText(values), (0, 0, 0, 4)))

    print_row(rows[0], "title")
    each_row = iter(rows[1:])
    for title, members in groupby(tasks, lambda task: _capability(task) or "other"):
        if any(map(_capability, tasks)):
            out.print(VisibleText(title, style="title"))
        for task in members:
            print_row(next(each_row))
            if task.summary:
                out.print(Padding(VisibleText(task.summary, style="quiet"), (0, 0, 0, 4)))
