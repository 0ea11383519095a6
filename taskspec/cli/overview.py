"""`taskspec list`, `show` and `explain`: the tasks there are, one of them, and what a code means."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from taskspec.base.codes import Code, classes, codes
from taskspec.base.columns import Columns
from taskspec.base.diagnostics import SpecError, spec_error, suggest
from taskspec.base.display import plural, visible
from taskspec.base.terminal import VisibleText, colored, console, line, terminal_width
from taskspec.cli import options
from taskspec.cli.console import fail, say, write_json, write_records

if TYPE_CHECKING:
    from taskspec.language.task.build import Outline
    from taskspec.language.task.task import Task

    Listed = Task | Outline

CODE_FIELDS = ("code", "slug", "severity", "title", "explanation")
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


def show(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    source: Annotated[bool, Option("--source", help="The code generated for its environment.")] = False,
    json: options.Json = False,
) -> None:
    """Show a task as a page, or the code generated from it."""
    from taskspec.cli.page import print_page
    from taskspec.language.targets import tasks_of
    from taskspec.language.task.record import constants, record
    from taskspec.programs.scalar import compile_scalar

    found = tasks_of(task, variant, parameters or [], modifiers or [])
    records: list[dict[str, Any]] = []
    for each in found:
        if source:
            code = compile_scalar(each).source
            records.append({"id": each.id, "language": "python", "source": code})
            if not json:
                _print_source(code)
        elif json:
            records.append({**record(each), "constants": constants(each), "spec": each.written})
        else:
            print_page(each, console())
    if json:
        write_records(records)


def _print_source(code: str) -> None:
    if not colored():
        say(code, nl=not code.endswith("\n"))
        return
    from rich.syntax import Syntax

    console(wide=True).print(Syntax(code, "python", theme="ansi_dark", background_color="default", word_wrap=True))


CodeArgument = Annotated[str | None, Argument(metavar="[CODE]", help="A code or its name; lists all if omitted.")]


def explain(code: CodeArgument = None, json: options.Json = False) -> None:
    """Explain an error or a warning, such as E302, with an example."""
    found = list(codes().values()) if code is None else [_find(code)]
    if json:
        write_json([{name: getattr(each, name) for name in CODE_FIELDS} for each in found])
    elif code is None:
        table = Columns("", "", "", fold=(2,), styles=("name", "", "quiet"))
        for prefix, members in groupby(found, lambda each: each.code[:2]):
            subject = VisibleText(classes().get(prefix, ""), style="title")
            table.add_row(VisibleText(prefix + "xx", style="bold default"), subject)
            for each in members:
                table.add_row(f"  {each.code}", each.slug, each.title)
        console(wide=True).print(table)
    else:
        _explain(found[0])


def _find(text: str) -> Code:
    wanted = text.strip("[]").split(" ")[0].lower()
    for code in codes().values():
        if wanted in (code.code.lower(), code.slug):
            return code
    near = suggest(wanted.upper(), codes()) or suggest(wanted, [c.slug for c in codes().values()])
    raise spec_error("E713", f"there is no code '{text}'", near or "`taskspec explain` lists them all")


def _explain(code: Code) -> None:
    out = console()
    style = "bad" if code.severity == "error" else "warn"
    out.print(line((f"{code.severity}[{code.code} {code.slug}]", style), f": {code.title}\n"))
    if colored():
        from rich.markdown import Markdown

        out.print(Markdown(code.explanation, code_theme="ansi_dark"))
    elif terminal_width() is None:
        say(code.explanation)
    else:
        parts = []
        for i, part in enumerate(code.explanation.split("```")):
            if i % 2:
                parts.append(f"```{part}```")
            else:
                parts += [" ".join(paragraph.split()) for paragraph in part.split("\n\n") if paragraph.strip()]
        out.print("\n\n".join(parts))
