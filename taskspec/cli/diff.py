"""`taskspec diff`: what changed in meaning between two specs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from taskspec.base.display import decimal
from taskspec.cli import options
from taskspec.cli.completions import complete_targets
from taskspec.cli.console import misuse, progress, write_json
from taskspec.show.terminal.styled_text import Columns, console, line

if TYPE_CHECKING:
    from taskspec.tools.difference.relation import TaskRelation

Side = Annotated[
    str,
    Argument(
        metavar="TASK", autocompletion=complete_targets,
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
    from taskspec.tools.difference.relation import compare
    from taskspec.tools.targets import task_at

    variants: Sequence[str | None] = variant or [None]
    if len(variants) > 2:
        raise misuse("--variant is given once for both tasks, or twice")
    with progress("comparing"):
        one = task_at(first, variants[0])
        other = task_at(second, variants[-1])
        relation = compare(one, other)
    if json:
        write_json(dataclasses.asdict(relation))
    elif first != second:
        _print(relation, first, second)
    else:
        _print(relation, one.name, other.name)
    if relation.relation not in ("identical", "same task", "no difference found"):
        raise typer.Exit(1)


def _print(relation: TaskRelation, first: str, second: str) -> None:
    out = console()
    style = "good" if relation.relation in ("identical", "same task") else "warn"
    out.print(line((relation.relation, style), f": {relation.words}"))
    part = relation.difference
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
    if relation.returns:
        one, other = (decimal(value, 6) for value in relation.returns.values())
        out.print(f"optimal returns: {one} and {other}")
    if relation.new_version is not None:
        verb = "must rise" if relation.new_version else "can stay"
        out.print(f"the version in the id {verb}")
