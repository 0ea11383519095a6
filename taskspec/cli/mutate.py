"""`taskspec mutate`: changes a spec in every small way, and says what notices."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.cli.console import say
from taskspec.cli.options import Json, Targets

if TYPE_CHECKING:
    from pathlib import Path

    from taskspec.mutation.judge import Judgement
    from taskspec.mutation.mutants import Mutant

    Judged = tuple[Mutant, Judgement]

ALWAYS = ("silent", "slow")
"""Classes whose mutants are always listed: nothing has noticed them."""
Jobs = Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="Processes.", show_default="all processors")]
Shown = Annotated[
    list[str] | None,
    typer.Option("--list", metavar="CLASS", help="Also list the changes of this class; may be repeated."),
]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with status 1 if some change is not noticed.")]


def mutate(
    targets: Targets = None,
    shown: Shown = None,
    jobs: Jobs = None,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Find out which mistakes in specs the checks would not notice.

    Every small change of the given specs (an operator, a number off by one, a name of the same type, a prime, a label, a
    row, a bound left out) is put through the whole check. Changes that no error, warning, claim or example notices show
    which mistakes could stay undetected.
    """
    from taskspec.cli.options import checked_choice
    from taskspec.cli.progress import counter
    from taskspec.mutation.judge import CLASSES, has_timers, judgements
    from taskspec.mutation.mutants import mutants
    from taskspec.source import read_file

    classes = [*ALWAYS, *(checked_choice("--list", name, tuple(CLASSES)) for name in shown or ())]
    paths = _specs(targets or [])
    if not has_timers():
        say("note: this system has no timers: changes that take long are waited for, and none is called slow", err=True)
    total = sum(1 for path in paths for _ in mutants(read_file(path)))
    with counter("changing", total, quiet=json) as advance:
        found = {path: list(judgements(path, jobs or os.cpu_count() or 1, advance)) for path in paths}
    (_print_json if json else _print_text)(found, classes)
    if strict and any(j.kind in ALWAYS for judged in found.values() for _, j in judged):
        raise typer.Exit(1)


def _specs(targets: Sequence[str]) -> list[Path]:
    """Return the specs to change.

    Raises:
        SpecError: E713 for an instance of a task: what is changed is the spec, of which all its instances are made.
    """
    from taskspec.base.diagnostics import spec_error
    from taskspec.targets import files_of

    files = files_of(targets)
    asked = next((file for file in files if file.parameters or file.modifiers), None)
    if asked is not None:
        given = "modifiers" if asked.modifiers else "values of parameters"
        raise spec_error(
            "E713", f"`mutate` changes specs as they are written, without {given}", f"taskspec mutate {asked.path}"
        )
    return [file.path for file in files]


def _print_text(found: Mapping[Path, Sequence[Judged]], classes: Sequence[str]) -> None:
    from taskspec.cli.console import console

    out = console(wide=True)
    out.print(_table(found))
    for path, judged in found.items():
        for mutant, judgement in judged:
            if judgement.kind in classes:
                out.print(_line(path, mutant, judgement))


def _table(found: Mapping[Path, Sequence[Judged]]) -> Any:
    """Return how many changes there are of each class, spec by spec."""
    from taskspec.cli.console import VisibleText, columns
    from taskspec.mutation.judge import CLASSES

    counts = {path: Counter(j.kind for _, j in judged) for path, judged in found.items()}
    kinds = [kind for kind in CLASSES if any(count[kind] for count in counts.values()) or kind == "silent"]
    table = columns("", "changes", *kinds, right=range(1, len(kinds) + 2))
    for path, count in counts.items():
        table.add_row(
            VisibleText(path.name, style="title"), f"{count.total():,}", *(f"{count[kind]:,}" for kind in kinds)
        )
    if len(counts) > 1:
        total = sum(counts.values(), Counter())
        table.add_row("", f"{total.total():,}", *(f"{total[kind]:,}" for kind in kinds))
    return table


def _line(path: Path, mutant: Mutant, judgement: Judgement) -> Any:
    from taskspec.cli.console import line

    place = f"{path}:{mutant.place.line}:{mutant.place.column}"
    told = f"  {judgement.code} {judgement.message}" if judgement.code else ""
    change = f"{mutant.section}: {mutant.before or '(nothing)'} → {mutant.after}"
    return line((place, "name"), "  ", (judgement.kind, "warn"), f"  {change}", (told, "quiet"))


def _print_json(found: Mapping[Path, Sequence[Judged]], classes: Sequence[str]) -> None:
    from taskspec.cli.console import write_json

    write_json([
        {
            "path": str(path), "line": m.place.line, "column": m.place.column, "section": m.section, "before": m.before,
            "after": m.after, "class": j.kind, "code": j.code, "message": j.message,
        }
        for path, judged in found.items() for m, j in judged
    ])  # fmt: skip
