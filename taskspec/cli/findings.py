"""`taskspec report --findings`: what becomes of a source's findings on the results of several learners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec.cli.failures import misuse
from taskspec.cli.targets import near

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.exam.findings import FindingsResult

STYLES = {"confirmed": "good", "refuted": "bad", "undecided": "warn", "not run": "quiet"}


def print_findings(suite: str, folders: Sequence[Path], output: Path, json: bool) -> None:
    """Evaluate a suite's findings, show them, and write them as a page and as JSON data."""
    from taskspec.cli.console import console, say, to_json, write_json
    from taskspec.exam.findings import evaluate, html, markdown
    from taskspec.files import write_text

    sets = results_of(folders)
    found = evaluate(suite, sets)
    write_text(output / "findings.md", markdown(found, setups(sets)))
    write_text(output / "findings.html", html(found, setups(sets)))
    write_text(output / "findings.json", to_json(found.data) + "\n")
    if json:
        write_json(found.data)
        return
    console(wide=True).print(table_of(found))
    for name in ("findings.md", "findings.html", "findings.json"):
        say(f"wrote {near(output / name)}")


def results_of(folders: Sequence[Path]) -> dict[str, dict[str, Any]]:
    """Exams by the folder that theirs lie in, and by the learner, which is called as its folder is."""
    from taskspec.exam import read

    found: dict[str, dict[str, Any]] = {}
    for folder in folders:
        place = (folder if folder.is_dir() else folder.parent).resolve()
        own = found.setdefault(place.parent.name, {})
        if place.name in own:
            raise misuse(f"'{folder}' is given twice")
        own[place.name] = read(folder)
    return found


def setups(sets: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """How results were obtained, in lines: one for each that differs."""
    from taskspec.exam.report.told import duration

    exams = [exam for each in sets.values() for exam in each.values()]
    versions = dict.fromkeys(", ".join(f"{k} {v}" for k, v in exam["versions"].items()) for exam in exams)
    machines = dict.fromkeys(", ".join(f"{k} {v}" for k, v in exam["machine"].items()) for exam in exams)
    seeds = sorted({len(exam["seeds"]) for exam in exams})
    steps = sorted({exam["steps"] for exam in exams})
    spent = duration(sum(exam["cost"].get("seconds", 0.0) for exam in exams))
    runs = (
        f"{len(exams)} exams, of {', '.join(map(str, seeds))} seeds and {', '.join(f'{n:,}' for n in steps)} steps each"
    )
    return [
        f"{runs}; {spent} of training",
        *(f"with {each}" for each in versions),
        *(f"on {each}" for each in machines),
    ]


def table_of(found: FindingsResult) -> Table:
    """A row for each finding: what it says, and what became of it with each set of results."""
    from taskspec.cli.console import columns
    from taskspec.cli.terminal import VisibleText

    table = columns("", "the paper says", *found.sets, fold=(1,))
    for each in found.results:
        outcomes = [VisibleText(each.outcome(name), style=STYLES[each.outcome(name)]) for name in found.sets]
        table.add_row(VisibleText(each.name, style="name"), VisibleText(each.entry.says), *outcomes)
    for outcome in STYLES:
        counts = [str(found.counts(name)[outcome]) for name in found.sets]  # type: ignore[index]  # the same words
        table.add_row("", VisibleText(outcome, style=STYLES[outcome]), *counts)
    return table
