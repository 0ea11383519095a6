"""`taskspec diff`: what changed in meaning between two specs."""

from __future__ import annotations

import dataclasses
import subprocess
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from taskspec.base.columns import Columns
from taskspec.base.diagnostics import spec_error
from taskspec.base.display import decimal
from taskspec.base.terminal import console, line
from taskspec.cli import options
from taskspec.cli.console import misuse, write_json
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.exact.abstraction.difference import TaskRelation
    from taskspec.language.task.task import Task

GIT = "git:"
Side = Annotated[
    str,
    Argument(
        metavar="TASK", autocompletion=options.complete_targets,
        help="An id, the path of a spec, either with values behind it ([cyan]x.yaml?L=5[/]), or a path at a revision, "
        "[cyan]git:REV:PATH[/].",
    ),
]  # fmt: skip


def diff(
    first: Side,
    second: Side,
    variant: Annotated[
        list[str] | None,
        Option("--variant", "-v", metavar="NAME", help="A variant of both specs; given twice, of each of them."),
    ] = None,
    json: options.Json = False,
) -> None:
    """Say what changed in meaning between two tasks.

    Nothing; names alone; a reward that is scaled or shaped; or the first step at which they differ, with the shortest actions
    that show it. Finite tasks are compared exactly, others in episodes. Of two versions of one task it says whether the
    version in the id must rise. The exit status is 1 if episodes differ.
    """
    from taskspec.exact.abstraction.difference import compare

    named = variant or []
    if len(named) > 2:
        raise misuse("--variant is given once for both tasks, or twice")
    with progress("comparing"):
        one = _task(first, named[0] if named else None)
        other = _task(second, named[-1] if named else None)
        found = compare(one, other)
    if json:
        write_json(dataclasses.asdict(found))
    else:
        if first != second:
            names = (first, second)
        else:
            names = (one.name, other.name)
        _print(found, *names)
    if found.relation not in ("identical", "same task", "no difference found"):
        raise typer.Exit(1)


def _task(target: str, variant: str | None) -> Task:
    if not target.startswith(GIT):
        from taskspec.language.registry import load

        return load(target, variant)
    from pathlib import Path

    from taskspec.language.registry import suite_of
    from taskspec.language.source import read_text
    from taskspec.language.task.build import build

    revision, _, path = target.removeprefix(GIT).partition(":")
    if not revision or not path or revision.startswith("-"):
        raise spec_error("E713", f"'{target}' is not of the form git:REV:PATH", "git:HEAD~1:tasks/my.yaml")
    try:
        found = subprocess.run(["git", "show", f"{revision}:./{path}"], capture_output=True, text=True, check=True)
    except FileNotFoundError:
        raise spec_error("E711", "git is not installed") from None
    except subprocess.CalledProcessError as error:
        raise spec_error("E711", f"git cannot show '{target}': {error.stderr.strip()}") from None
    return build(read_text(found.stdout, path), variant, {}, suite_of(Path(path)))


def _print(found: TaskRelation, first: str, second: str) -> None:
    out = console()
    if found.relation in ("identical", "same task"):
        style = "good"
    else:
        style = "warn"
    out.print(line((found.relation, style), f": {found.words}"))
    part = found.difference
    if part is not None:
        table = Columns("", "", styles=("quiet",), fold=(1,))
        table.add_row("  time", f"t = {part.t}")
        for name, words in (("state", part.state), ("action", part.action)):
            if words:
                table.add_row(f"  {name}", words)
        if part.actions:
            table.add_row("  shown by", "; ".join(part.actions))
        table.add_row(f"  {first}", part.first)
        table.add_row(f"  {second}", part.second)
        out.print(table)
    if found.returns:
        one, other = (decimal(value, 6) for value in found.returns.values())
        out.print(f"optimal returns: {one} and {other}")
    if found.new_version is not None:
        out.print("the version in the id must rise" if found.new_version else "the version in the id can stay")
