"""The report of an audit: what is known of an environment, and what was found, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from taskspec.audit.evidence import Evidence
from taskspec.audit.findings import CHECKS, AuditCheck, Found
from taskspec.audit.subject import Subject
from taskspec.base.display import decimal, estimate, plural
from taskspec.base.limits import tell
from taskspec.scores.returns import Return


@dataclass(frozen=True)
class Reported:
    """A check that found something; `trace` is the text that shows it."""

    check: AuditCheck
    found: Found
    trace: str


@dataclass(frozen=True)
class Audit:
    """The result of an audit.

    Attributes:
        size: the number of states and actions, or why there is no table.
        values: returns by name, in words.
        entries: what was found.
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
        found = [
            {"kind": e.check.kind, "name": e.check.name, "words": e.found.words, "trace": e.trace or None}
            for e in self.entries
        ]
        return {"environment": self.name, "size": self.size, **self.numbers, "findings": found}


def examined(subject: Subject, seconds: float) -> Audit:
    """Look for everything in `CHECKS`."""
    x = Evidence(subject, seconds)
    entries = []
    for check in CHECKS:
        tell(check.name)
        try:
            found = check.look(x)
            if found is not None:
                entries.append(Reported(check, found, subject.text(found.trace) if found.trace else ""))
                x.found[check.name] = found
        except Exception as error:  # of an object that does what none should
            x.unexamined.append(f"{check.name} ({type(error).__name__}: {error})")
    values, numbers = _values(x)
    return Audit(subject.name, _size(x), tuple(values), tuple(entries), numbers)


def _size(x: Evidence) -> str:
    horizon = "no time limit seen" if x.horizon is None else f"{x.horizon:,} steps"
    if x.table is None:
        return f"sampled, since {x.why_not}; {horizon}"
    chance = ", chance estimated" if x.table.is_estimated else ""
    return f"{plural(x.entered, 'state')}, {plural(len(x.table.actions), 'action')}, {horizon}{chance}"


def _values(x: Evidence) -> tuple[list[tuple[str, str]], dict[str, Any]]:
    """Return returns in words and as numbers: those of the table, or else means of episodes with their intervals."""
    words = []
    numbers: dict[str, Any] = {}
    sampled: dict[str, list[float]] = {}
    if x.solved is None or x.table is None:
        sampled = {name if name == "random" else f"action {name}": found for name, found in x.returns.items()}
    elif x.table.by_time is not None:
        numbers["optimal, if rewards were those of the first visit"] = x.solved.best
        sampled = {"random": x.returns["random"]}
    else:
        numbers = {"optimal": x.solved.best, "random": x.solved.random, "worst": x.solved.worst}
        numbers["best single action"] = max(x.solved.constant)
        if x.table.drawn:
            sampled = {"the policy found optimal": x.checked}
    about = "about " if x.table is not None and x.table.is_estimated else ""
    words = [(name, about + decimal(value)) for name, value in numbers.items()]
    for name, returns in sampled.items():
        if not returns:
            words.append((name, "no whole episode in this time"))
            continue
        found = Return.estimated(returns)
        mean, half = estimate(found.value, found.half)
        words.append((name, f"{mean} ± {half} (95 %, {plural(found.episodes, 'episode')})"))
        numbers[name] = {"mean": found.value, "interval": list(found.interval()), "episodes": found.episodes}
    if x.unexamined:
        words.append(("not examined", "; ".join(x.unexamined)))
    if x.after_the_end:
        words.append(("after the end", x.after_the_end))
    return words, {"is_estimated": bool(about), "returns": numbers, "after_the_end": x.after_the_end}
