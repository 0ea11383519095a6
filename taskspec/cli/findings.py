"""`taskspec report --findings`: what becomes of a source's findings on the results of several learners."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec.cli.failures import misuse
from taskspec.cli.targets import near

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.exam import Exam
    from taskspec.exam.findings import FindingsResult

STYLES = {"confirmed": "good", "refuted": "bad", "undecided": "warn", "not run": "quiet"}


def print_findings(suite: str, folders: Sequence[Path], output: Path, json: bool) -> None:
    """Evaluate a suite's findings, show them, and write them as a page and as JSON data."""
    from taskspec.cli.console import console, say, to_json, write_json
    from taskspec.exam.findings import evaluate, html, markdown
    from taskspec.files import write_text

    exams = results_of(folders)
    found, how = evaluate(suite, merged(exams)), setups([exam for *_, exam in exams])
    write_text(output / "findings.md", markdown(found, how))
    write_text(output / "findings.html", html(found, how))
    write_text(output / "findings.json", to_json(found.data) + "\n")
    if json:
        write_json(found.data)
        return
    console(wide=True).print(table_of(found))
    for name in ("findings.md", "findings.html", "findings.json"):
        say(f"wrote {near(output / name)}")


Result = tuple[str, str, "Exam"]
"""The set that an exam belongs to, which is the folder of its folder, what its learner is called there, and the exam."""


def results_of(folders: Sequence[Path]) -> list[Result]:
    """The exams in some folders, and below them."""
    from taskspec.exam import read

    places = list(dict.fromkeys(place.resolve() for folder in folders for place in exams_in(folder)))
    return [(place.parent.name, place.name, read(place)) for place in places]


def exams_in(folder: Path) -> list[Path]:
    """The folders with an exam, where there are some below this one; else this one."""
    from taskspec.exam.results import NAMES

    if not folder.is_dir():
        return [folder.parent]
    below = {path.parent for name in NAMES for path in folder.rglob(name)}
    return sorted(below) or [folder]


def merged(results: Sequence[Result]) -> dict[str, dict[str, dict[str, Any]]]:
    """For each set and learner all scores, where several exams were about different tasks."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for name, learner, exam in results:
        known = found.setdefault(name, {}).setdefault(learner, {"tasks": {}, "scores": []})
        twice = next(iter(known["tasks"].keys() & exam["tasks"].keys()), None)
        if twice is not None:
            raise misuse(f"two exams of {name}/{learner} are about {twice}")
        known["tasks"] |= exam["tasks"]
        known["scores"] += exam["scores"]
    return found


def setups(exams: Sequence[Exam]) -> list[str]:
    """How results were obtained, in lines: one for each that differs."""
    from taskspec.exam.report.told import duration

    commands = dict.fromkeys(exam["command"] for exam in exams if exam["command"])
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
        *(f"by `{each}`" for each in commands),
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
