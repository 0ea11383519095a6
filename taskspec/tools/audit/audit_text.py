"""Audits, and traces that are played again, as text on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taskspec.base.display import decimal, plural
from taskspec.show.terminal.styled_text import Columns, console, line
from taskspec.tools.audit.findings import Audit
from taskspec.tools.audit.subject import first_difference, shown


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
