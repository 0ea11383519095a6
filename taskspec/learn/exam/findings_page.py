"""Findings of a paper on results of exams, as Markdown, HTML and text on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from taskspec.base.columns import Columns
from taskspec.base.display import duration, visible_json
from taskspec.base.files import write_text
from taskspec.base.terminal import VisibleText
from taskspec.exact.rules.score_rules import short_name
from taskspec.learn.exam.findings import SLACK, FindingResult, FindingsResult, Outcome
from taskspec.learn.exam.results import Exam
from taskspec.show.pages.render.html import page_of

STYLES: dict[Outcome, str] = {"confirmed": "good", "refuted": "bad", "undecided": "warn", "not run": "quiet"}
SIGNS: dict[Outcome, str] = {"confirmed": "✓", "refuted": "✗", "undecided": "?", "not run": "·"}
LEGEND = (
    "A finding is confirmed if its condition holds everywhere in the 95 % intervals (in brackets), refuted if nowhere. Behind "
    "them is how many of its comparisons it rests on; where these are not all k, they hold in intervals of 1 − 5 % / k. It is "
    "sensitive to what would give another outcome: the best actions of policies instead of drawn ones (or the other way round), "
    f"and thresholds of scores that are {SLACK} easier or harder to meet."
)


def write(found: FindingsResult, exams: Sequence[Exam], folder: Path) -> list[Path]:
    """Write findings as Markdown, HTML and JSON.

    Args:
        found: the findings with their outcomes.
        exams: whose results they are of.
        folder: made if need be.

    Returns:
        The files written.
    """
    origin = setups(exams)
    texts = {"md": markdown(found, origin), "html": html(found, origin), "json": visible_json(found.data) + "\n"}
    paths = []
    for suffix, content in texts.items():
        paths.append(folder / f"findings.{suffix}")
        write_text(paths[-1], content)
    return paths


def markdown(found: FindingsResult, origin: Sequence[str] = ()) -> str:
    """Return a page in Markdown: the number of findings with each outcome, a table of all of them, and how it was run.

    Args:
        origin: lines about the origin of the results: machine, versions, command.
    """
    described = found.described
    lines = [f"# {described.title or 'Findings'}", ""]
    for name in found.sets:
        counts = ", ".join(f"**{count} {outcome}**" for outcome, count in found.counts(name).items() if count)
        strip = "".join(SIGNS[each.outcome(name)] for each in found.results)
        lines += [f"- {name}: {counts}", f"  `{strip}`"]
    signs = ", ".join(f"{sign} {outcome}" for outcome, sign in SIGNS.items())
    lines += ["", f"Each sign is one finding, in the order of the table below: {signs}. {LEGEND}", ""]
    if described.doc:
        lines += [described.doc, ""]
    rows = [_row(each, found.sets) for each in found.results]
    lines += _table(["", "the paper says", *found.sets, "sensitive to"], rows)
    if origin:
        lines += ["", "## How it was run", "", *(f"- {line}" for line in origin)]
    return "\n".join(lines) + "\n"


def html(found: FindingsResult, origin: Sequence[str] = ()) -> str:
    """Return the same page as HTML that stands alone."""
    described = found.described
    findings = [
        {
            "name": each.name, "says": each.entry.says, "where": each.entry.where, "note": each.entry.note,
            "holds": " ".join(each.entry.holds.split()), "outcomes": [_outcome(each, name) for name in found.sets],
        }
        for each in found.results
    ]  # fmt: skip
    return page_of(
        "findings.html", title=described.title or "Findings", doc=described.doc or "", origin=origin, findings=findings,
        tallies={name: found.counts(name) for name in found.sets}, legend=LEGEND,
    )  # fmt: skip


def _outcome(each: FindingResult, name: str) -> dict[str, Any]:
    outcome = each.outcome(name)
    deciding = each.deciding(name)
    if deciding is not None and outcome != "not run":
        evidence = str(deciding)
    else:
        evidence = ""
    number = sum(not comparison.is_missing for comparison in each.truths[name].evidence)
    return {
        "set": name, "outcome": outcome, "evidence": evidence, "number": number,
        "of": each.comparisons[name], "sensitivity": _sensitivity(each, name),
    }  # fmt: skip


def _sensitivity(each: FindingResult, name: str) -> str:
    """Return what gives other outcomes, in words: `best actions (refuted)`."""
    return ", ".join(f"{how} ({outcome})" for how, outcome in each.sensitivity(name).items())


def _row(each: FindingResult, sets: Sequence[str]) -> list[str]:
    entry = each.entry
    says = f"{entry.says} *({entry.where})* `{' '.join(entry.holds.split())}`"
    if entry.note:
        says += f" {entry.note}"
    outcomes = [_outcome(each, name) for name in sets]
    sensitive = [f"{o['set']}: {o['sensitivity']}" for o in outcomes if o["sensitivity"]]
    return [each.name, says, *map(_cell, outcomes), "; ".join(sensitive)]


def _cell(found: Mapping[str, Any]) -> str:
    outcome: Outcome = found["outcome"]
    if not found["evidence"]:
        return SIGNS[outcome]
    compared, sign, value = found["evidence"].partition(" = ")
    if found["of"] > 1:
        number = f" ({found['number']} of {found['of']})"
    else:
        number = ""
    return f"**{outcome}**: `{compared}`{sign}{value}{number}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [list(header), ["---"] * len(header), *map(list, rows)]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]


def text(found: FindingsResult) -> Columns:
    """Return findings with their outcomes, and how many there are of each, as a table on the terminal."""
    table = Columns("", "the paper says", *found.sets, fold=(1,), styles=("name",), names=1)
    for each in found.results:
        outcomes = [each.outcome(name) for name in found.sets]
        table.add_row(each.name, each.entry.says, *(VisibleText(word, style=STYLES[word]) for word in outcomes))
    counts = [found.counts(name) for name in found.sets]
    for outcome, style in STYLES.items():
        numbers = [str(count[outcome]) for count in counts]
        table.add_row("", VisibleText(outcome, style=style), *numbers)
    return table


def setups(exams: Sequence[Exam]) -> list[str]:
    """Return how results were obtained, in lines: one for each that differs."""
    seeds = ", ".join(str(n) for n in sorted({len(exam["seeds"]) for exam in exams}))
    steps = ", ".join(f"{n:,}" for n in sorted({exam["steps"] for exam in exams}))
    spent = duration(sum(exam["cost"].get("seconds", 0.0) for exam in exams))
    lines = [f"{len(exams)} exams, of {seeds} seeds and {steps} steps each; {spent} of training"]
    lines += [f"tasks: {', '.join(map(short_name, exam['tasks']))}" for exam in exams]
    lines += _commands(exams)
    lines += [f"with {_listed(exam['versions'])}" for exam in exams]
    lines += [f"on {_listed(exam['machine'])}" for exam in exams]
    return list(dict.fromkeys(lines))


def _commands(exams: Sequence[Exam]) -> list[str]:
    """Return a line for each command; one for all that differ by the name of the learner alone."""
    learners: dict[str, list[str]] = {}
    for exam in exams:
        if exam["command"]:
            command = exam["command"].replace(exam["learner"], "LEARNER")
            learners.setdefault(command, []).append(exam["learner"])
    lines = []
    for command, names in learners.items():
        if len(names) > 1 and "LEARNER" in command:
            lines.append(f"by `{command}` for {', '.join(names)}")
        else:
            lines.append(f"by `{command.replace('LEARNER', names[0])}`")
    return lines


def _listed(facts: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in facts.items())
