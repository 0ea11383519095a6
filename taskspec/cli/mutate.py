"""`taskspec mutate`: changes a spec in every small way, and says what notices."""

from __future__ import annotations

import os
from collections import Counter
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from taskspec.base.diagnostics import spec_error
from taskspec.base.limits import tell
from taskspec.cli.console import console, line, write_json
from taskspec.cli.options import Jobs, Json, Targets, checked_choice
from taskspec.cli.progress import progress
from taskspec.cli.tables import Columns

if TYPE_CHECKING:
    from pathlib import Path

    from taskspec.tools.mutation.judge import Judgement
    from taskspec.tools.mutation.mutants import Mutant

    Judged = tuple[Path, Mutant, Judgement]

ALWAYS = "silent"  # the class whose mutants are always listed: nothing has noticed them
Listed = Annotated[
    list[str] | None, Option("--list", metavar="CLASS", help="Also list the changes of this class; may be repeated.")
]


def mutate(
    targets: Targets = None,
    listed: Listed = None,
    jobs: Jobs = None,
    strict: Annotated[bool, Option("--strict", help="Exit with status 1 if some change is not noticed.")] = False,
    json: Json = False,
) -> None:
    """Find out which mistakes in specs the checks would not notice.

    Every small change of the given specs (an operator, a number off by one, a name of the same type, a prime, a label, a
    row, a bound left out) is put through the whole check. Changes that no error, warning, claim or example notices show
    which mistakes could stay undetected.
    """
    from taskspec.language.source import read_file
    from taskspec.language.targets import files_of
    from taskspec.tools.mutation.judge import CLASSES, judgements
    from taskspec.tools.mutation.mutants import mutants

    classes = [ALWAYS, *(checked_choice("--list", name, tuple(CLASSES)) for name in listed or ())]
    files = files_of(targets or [])
    for file in files:
        if file.parameters or file.modifiers:
            message = "`mutate` changes specs as they are written, without values of parameters and modifiers"
            raise spec_error("E713", message, f"taskspec mutate {file.path}")
    total = sum(1 for file in files for _ in mutants(read_file(file.path)))
    judged: list[Judged] = []
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        tell(f"changing {done}/{total}", done / total)

    with progress("changing"):
        for file in files:
            found = judgements(file.path, jobs or os.cpu_count() or 1, advance)
            judged += [(file.path, mutant, judgement) for mutant, judgement in found]
    if json:
        records = []
        for path, m, j in judged:
            change = {"path": str(path), "line": m.place.line, "column": m.place.column, "section": m.section}
            change |= {"before": m.before, "after": m.after}
            records.append(change | {"class": j.kind, "code": j.code, "message": j.message})
        write_json(records)
    else:
        _print(judged, classes)
    if strict and any(judgement.kind == ALWAYS for _, _, judgement in judged):
        raise typer.Exit(1)


def _print(judged: list[Judged], classes: list[str]) -> None:
    """Print how many changes there are of each class, spec by spec, and the changes of some classes."""
    from taskspec.tools.mutation.judge import CLASSES

    counts: dict[Path, Counter[str]] = {}
    total: Counter[str] = Counter()
    for path, _, judgement in judged:
        counts.setdefault(path, Counter())[judgement.kind] += 1
        total[judgement.kind] += 1
    rows = [(path.name, count) for path, count in counts.items()]
    if len(rows) > 1:
        rows.append(("", total))
    kinds = [kind for kind in CLASSES if total[kind] or kind == "silent"]
    table = Columns("", "changes", *kinds, right=range(1, len(kinds) + 2), styles=("title",), names=0)
    for name, count in rows:
        table.add_row(name, f"{count.total():,}", *(f"{count[kind]:,}" for kind in kinds))
    out = console(wide=True)
    out.print(table)
    for path, mutant, judgement in judged:
        if judgement.kind in classes:
            place = f"{path}:{mutant.place.line}:{mutant.place.column}"
            noticed = f"  {judgement.code} {judgement.message}" * bool(judgement.code)
            change = f"{mutant.section}: {mutant.before or '(nothing)'} → {mutant.after}"
            out.print(line((place, "name"), "  ", (judgement.kind, "warn"), f"  {change}", (noticed, "quiet")))
