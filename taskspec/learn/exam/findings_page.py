"""Findings of a paper on results of exams, as Markdown, HTML and text on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from taskspec.base.display import duration, listed, visible_json
from taskspec.base.files import write_text
from taskspec.learn.exam.card import listed_facts
from taskspec.learn.exam.findings import SLACK, FindingResult, FindingsResult, Outcome
from taskspec.learn.exam.results import Exam
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart
from taskspec.show.pages.render.html import page_of
from taskspec.show.terminal.styled_text import Columns, VisibleText

SIGNS: dict[Outcome, str] = {"confirmed": "✓", "refuted": "✗", "undecided": "?", "not run": "·"}
TINTS: dict[Outcome, str] = {
    "confirmed": chart.TINT_MASTERS, "refuted": chart.TINT_FAILS, "undecided": chart.TINT_UNSURE, "not run": chart.TINT_NONE,
}  # fmt: skip
KEPT = "\N{NO-BREAK SPACE}"
"""Keeps a sign and its word on one line."""
SQUARE = (0.46, 0.24)
"""Width and height of the square of a finding, in inches."""
LEFT = 0.85
"""Room for the names of sets, in inches."""
GAP = 0.35
"""Space between families, as a part of a square."""


def outcomes(findings: FindingsResult) -> Chart:
    """Draw the outcome of every finding, by the learners that it is about and by the set of results."""
    families: dict[str, list[FindingResult]] = {}
    for each in findings.results:
        families.setdefault(each.entry.about or "all", []).append(each)
    columns = max(map(len, families.values()))
    rows = (1 + len(findings.sets) + GAP) * len(families) + 1
    width, height = SQUARE
    with chart.style():
        figure = chart.figure(LEFT + columns * width, rows * height)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(-LEFT / width, columns)
        axes.set_ylim(rows, 0)
        axes.axis("off")
        y = 0.0
        for family, members in families.items():
            axes.text(-LEFT / width, y + 0.5, family, va="center", weight="bold")
            y += 1
            for name in findings.sets:
                axes.text(-0.2, y + 0.5, name, va="center", ha="right", color=chart.MUTED)
                for x, each in enumerate(members):
                    outcome = each.outcome(name)
                    axes.bar(x + 0.5, 1, 1, bottom=y, color=TINTS[outcome], edgecolor=chart.PAPER, clip_on=False)
                    axes.text(x + 0.5, y + 0.5, f"{each.name} {SIGNS[outcome]}", ha="center", va="center", fontsize=7)
                y += 1
            y += GAP
        key = ",  ".join(f"{sign} {outcome}" for outcome, sign in SIGNS.items())
        axes.text(-LEFT / width, y + 0.5, key, va="center", color=chart.MUTED)
    return Chart(figure, _described(findings))


def _described(findings: FindingsResult) -> str:
    parts = []
    for name in findings.sets:
        parts.append(f"{name}: {', '.join(_counted(findings, name))}")
    return f"Outcomes of {len(findings.results)} findings by learners. {'; '.join(parts)}"


def _counted(findings: FindingsResult, name: str) -> list[str]:
    return [f"{count} {outcome}" for outcome, count in findings.counts(name).items() if count]


STYLES: dict[Outcome, str] = {"confirmed": "good", "refuted": "bad", "undecided": "warn", "not run": "quiet"}
RULE = (
    "A statement is confirmed if its condition holds everywhere in the 95 % intervals, and refuted if it holds nowhere."
)
EVIDENCE = (
    "Each condition is followed by the comparison that comes closest to another outcome, with its interval. In parentheses: the "
    "number of comparisons that decide; where these are not all k, they hold in intervals of 1 − 5 % / k. The last column lists "
    "changes that would alter the outcome: the best actions of policies instead of drawn ones (or the other way round), and "
    f"thresholds of scores that are {SLACK} easier or harder to meet."
)
DETAILS = "Conditions, the comparisons that decide, and changes that would alter outcomes are in `findings.html`."
PICTURE = "findings.svg"


def write(findings: FindingsResult, exams: Sequence[Exam], folder: Path) -> list[Path]:
    """Write findings as Markdown, HTML and JSON.

    Args:
        findings: the findings with their outcomes.
        exams: whose results they are of.
        folder: made if need be.

    Returns:
        The files written.
    """
    origin = setups(exams)
    drawn = chart.is_available()
    texts = {
        "md": markdown(findings, origin, PICTURE if drawn else ""),
        "html": html(findings, origin),
        "json": visible_json(findings.data) + "\n",
    }
    paths = []
    for suffix, content in texts.items():
        paths.append(folder / f"findings.{suffix}")
        write_text(paths[-1], content)
    if drawn:
        paths.append(chart.save(outcomes(findings), folder / PICTURE))
    return paths


def markdown(findings: FindingsResult, origin: Sequence[str] = (), picture: str = "") -> str:
    """Return a page in Markdown: the result, a picture, and a table in words.

    Args:
        findings: the findings with their outcomes.
        origin: lines about the origin of the results: machine, versions, command.
        picture: the address of the chart of outcomes; none without.
    """
    described = findings.described
    lines = [f"# {described.title or 'Findings'}", "", result(findings), ""]
    if described.doc:
        lines += [described.doc, ""]
    if picture:
        alt = "The outcome of each statement, by the learners that it is about"
        lines += [f"![{alt}]({picture})", ""]
    in_words = [_in_words(each, findings.sets) for each in findings.results]
    lines += _table(["", "the paper says", *findings.sets], in_words)
    lines += ["", DETAILS]
    if origin:
        lines += ["", "## How it was run", "", *(f"- {line}" for line in origin)]
    return "\n".join(lines) + "\n"


def result(findings: FindingsResult) -> str:
    """Return the result in a paragraph: `Of 35 statements, 12 are confirmed with paper, ...`."""
    parts = []
    for name in findings.sets:
        parts.append(f"with `{name}`, {listed(_counted(findings, name))}")
    return f"Of {len(findings.results)} statements: {'; '.join(parts)}. {RULE}"


def html(shown: FindingsResult, origin: Sequence[str] = ()) -> str:
    """Return a page in HTML that stands alone, with conditions and their evidence, too."""
    described = shown.described
    findings = []
    for each in shown.results:
        findings.append({
            "name": each.name, "says": each.entry.says, "where": each.entry.where, "note": each.entry.note,
            "holds": " ".join(each.entry.holds.split()), "outcomes": [_outcome(each, name) for name in shown.sets],
        })  # fmt: skip
    picture = ""
    if chart.is_available():
        picture = Markup(chart.svg(outcomes(shown)))
    return page_of(
        "findings.html", title=described.title or "Findings", doc=described.doc or "", origin=origin, findings=findings,
        tallies={name: shown.counts(name) for name in shown.sets}, legend=f"{RULE} {EVIDENCE}", picture=picture,
    )  # fmt: skip


def _outcome(each: FindingResult, name: str) -> dict[str, Any]:
    outcome = each.outcome(name)
    deciding = each.deciding(name)
    evidence = ""
    if deciding is not None and outcome != "not run":
        evidence = str(deciding)
    sensitivity = ", ".join(f"{how} ({other})" for how, other in each.sensitivity(name).items())
    number = sum(not comparison.is_missing for comparison in each.truths[name].evidence)
    return {
        "set": name, "outcome": outcome, "evidence": evidence, "number": number,
        "of": each.comparisons[name], "sensitivity": sensitivity,
    }  # fmt: skip


def _in_words(each: FindingResult, sets: Sequence[str]) -> list[str]:
    """Return a row without code: the statement, a note, and the outcomes."""
    entry = each.entry
    says = f"{entry.says} *({entry.where})*"
    if entry.note:
        says += f" {entry.note}"
    row = [each.name, says]
    for outcome in map(each.outcome, sets):
        row.append(f"{SIGNS[outcome]}{KEPT}{outcome}")
    return row


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = []
    for row in (header, ["---"] * len(header), *rows):
        cells = [cell.replace("|", "\\|") for cell in row]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def text(findings: FindingsResult) -> Columns:
    """Return findings with their outcomes, and how many there are of each, as a table on the terminal."""
    table = Columns("", "the paper says", *findings.sets, fold=(1,), styles=("name",), names=1)
    for each in findings.results:
        words = []
        for outcome in map(each.outcome, findings.sets):
            words.append(VisibleText(outcome, style=STYLES[outcome]))
        table.add_row(each.name, each.entry.says, *words)
    for outcome, style in STYLES.items():
        numbers = [str(findings.counts(name)[outcome]) for name in findings.sets]
        table.add_row("", VisibleText(outcome, style=style), *numbers)
    return table


def setups(exams: Sequence[Exam]) -> list[str]:
    """Return how results were obtained, in lines: one for each that differs."""
    seeds = sorted({len(exam["seeds"]) for exam in exams})
    steps = sorted({exam["steps"] for exam in exams})
    terms = f"{', '.join(map(str, seeds))} seeds and {', '.join(map('{:,}'.format, steps))} steps"
    spent = duration(sum(exam["cost"].get("seconds", 0.0) for exam in exams))
    lines = [f"{len(exams)} exams, of {terms} each; {spent} of training"]
    lines += _commands(exams)
    lines += [f"with {listed_facts(exam['versions'])}" for exam in exams]
    lines += [f"on {listed_facts(exam['machine'])}" for exam in exams]
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
