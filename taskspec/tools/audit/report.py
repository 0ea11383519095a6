"""The report of an audit: everything that was looked for, and returns, as data and as text on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.base.display import decimal, estimate, plural
from taskspec.base.limits import tell
from taskspec.exact.scores.returns import Return
from taskspec.show.terminal.styled_text import Columns, console, line
from taskspec.tools.audit.evidence import Evidence
from taskspec.tools.audit.findings import CHECKS, AuditCheck, AuditFinding
from taskspec.tools.audit.subject import Subject, first_difference, shown


@dataclass(frozen=True)
class Reported:
    """A check with its finding; `trace` is the text that shows it."""

    check: AuditCheck
    finding: AuditFinding
    trace: str


@dataclass(frozen=True)
class Audit:
    """The result of an audit.

    Attributes:
        size: the number of states and actions, or why there is no table.
        values: returns by name, in words.
        entries: the findings.
        numbers: the same returns as numbers.
    """

    name: str
    size: str
    values: tuple[tuple[str, str], ...]
    entries: tuple[Reported, ...]
    numbers: dict[str, Any]

    def of(self, kind: str) -> list[Reported]:
        return [entry for entry in self.entries if entry.check.kind == kind]

    @property
    def faults(self) -> list[Reported]:
        return self.of("fault")

    def record(self) -> dict[str, Any]:
        """Return the audit as plain data."""
        findings = []
        for e in self.entries:
            about = {"kind": e.check.kind, "name": e.check.name, "words": e.finding.words, "trace": e.trace or None}
            findings.append(about)
        return {"environment": self.name, "size": self.size, **self.numbers, "findings": findings}


def examined(subject: Subject, seconds: float) -> Audit:
    """Look for everything in `CHECKS`."""
    x = Evidence(subject, seconds)
    entries = []
    for check in CHECKS:
        tell(check.name)
        try:
            finding = check.look(x)
            if finding is None:
                continue
            entries.append(Reported(check, finding, subject.text(finding.trace or ())))
            x.findings[check.name] = finding
        except Exception as error:  # of an object that does what none should
            x.unexamined.append(f"{check.name} ({type(error).__name__}: {error})")
    values, numbers = _values(x)
    return Audit(subject.name, _size(x), tuple(values), tuple(entries), numbers)


def _size(x: Evidence) -> str:
    horizon = f"{x.horizon:,} steps" if x.horizon is not None else "no time limit seen"
    if x.table is None:
        return f"sampled, since {x.why_not}; {horizon}"
    chance = ", chance estimated" if x.table.is_estimated else ""
    return f"{plural(x.entered, 'state')}, {plural(len(x.table.actions), 'action')}, {horizon}{chance}"


def _values(x: Evidence) -> tuple[list[tuple[str, str]], dict[str, Any]]:
    """Return returns in words and as numbers: those of the table, or else means of episodes with their intervals."""
    words = []
    numbers, sampled = _returns(x)
    about = ""
    if x.table is not None and x.table.is_estimated:
        about = "about "
    for name, value in numbers.items():
        words.append((name, about + decimal(value)))
    for name, returns in sampled.items():
        if not returns:
            words.append((name, "no whole episode in this time"))
            continue
        sample = Return.estimated(returns)
        mean, half = estimate(sample.value, sample.half)
        words.append((name, f"{mean} ± {half} (95 %, {plural(sample.episodes, 'episode')})"))
        numbers[name] = {"mean": sample.value, "interval": list(sample.interval()), "episodes": sample.episodes}
    if x.unexamined:
        words.append(("not examined", "; ".join(x.unexamined)))
    if x.after_the_end:
        words.append(("after the end", x.after_the_end))
    return words, {"is_estimated": bool(about), "returns": numbers, "after_the_end": x.after_the_end}


def _returns(x: Evidence) -> tuple[dict[str, Any], dict[str, list[float]]]:
    numbers: dict[str, Any] = {}
    sampled: dict[str, list[float]] = {}
    if x.solved is None or x.table is None:
        for name, returns in x.returns.items():
            if name != "random":
                name = f"action {name}"
            sampled[name] = returns
    elif x.table.by_time is not None:
        numbers["optimal, if rewards were those of the first visit"] = x.solved.best
        sampled = {"random": x.returns["random"]}
    else:
        numbers = {"optimal": x.solved.best, "random": x.solved.random, "worst": x.solved.worst}
        numbers["best single action"] = max(x.solved.constant)
        if x.table.drawn:
            sampled = {"the policy found optimal": x.checked}
    return numbers, sampled


# -- on the terminal ----------------------------------------------------------------------------------------------------


def print_audit(report: Audit) -> None:
    """Print the results of an audit, and its faults and facts with their traces."""
    out = console()
    out.print(line((report.name, "name"), (f"  {report.size}", "quiet")))
    table = Columns("", "", styles=("quiet",), fold=(1,))
    for name, words in report.values:
        table.add_row(f"  {name}", words)
    out.print(table)
    for kind, style in (("fault", "bad"), ("fact", "value")):
        for entry in report.of(kind):
            out.print(line((f"{kind} ", style), (f"{entry.check.name}: ", "title"), entry.finding.words))
            if entry.trace:
                out.print(f"  --replay '{entry.trace}'", soft_wrap=True)
    if report.faults:
        out.print(line((plural(len(report.faults), "fault"), "bad")))
    else:
        out.print(line(("no faults", "good")))


def print_steps(steps: Sequence[Any], again: Sequence[Any]) -> None:
    """Print the steps of a trace, and whether a second run gives the same."""
    table = Columns("action", "observation", "reward", "end", fold=(1,))
    for step in steps:
        ends = []
        if step.terminated:
            ends.append("terminated")
        if step.truncated:
            ends.append("truncated")
        action = "reset"
        if step.action is not None:
            action = shown(step.action)
        table.add_row(action, step.error or shown(step.observation, 200), decimal(step.paid), " ".join(ends))
    out = console()
    out.print(table)
    t = first_difference(steps, again)
    if t is None:
        out.print("a second run gives the same")
    else:
        out.print(f"a second run differs at line {t + 1}: {again[t]}")
