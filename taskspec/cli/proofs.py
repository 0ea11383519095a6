"""What can be proved of a task: soundness, sense and claims, with how each was found out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from taskspec.diagnostics import Diagnostic

if TYPE_CHECKING:
    from taskspec.exact import Verdict
    from taskspec.spec.task import Task


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found about one task. `method` says how soundness was decided."""

    diagnostics: tuple[Diagnostic, ...]
    method: str
    cases: int = 0  # other parameter values that were tried
    proved: int = 0  # claims that hold by the exact model
    supported: int = 0  # claims that simulation did not contradict
    skipped: str | None = None

    @property
    def summary(self) -> str:
        """Everything that was done, in a line."""
        cases = f"{self.cases} more parameter {'value' if self.cases == 1 else 'values'}" if self.cases else ""
        return "; ".join(part for part in (self.method, cases, self._claims, self.skipped) if part)

    @property
    def _claims(self) -> str:
        parts = [f"{n} {what}" for n, what in ((self.proved, "proved"), (self.supported, "not contradicted")) if n]
        if not parts:
            return ""
        return f"claims: {', '.join(parts)}"


def examine(task: Task, ranges: bool = True, claims: bool = True) -> Finding:
    """Everything that is wrong with a well-formed task.

    Args:
        ranges: whether the ends of its parameters' ranges are tried as well.
        claims: whether sense and claims are looked at.
    """
    from taskspec import exact

    report = exact.check(task, ranges=ranges, with_sense=claims, claims=claims)
    statuses = [verdict.status for verdict in _held(report.verdicts)]
    return Finding(
        report.diagnostics, str(report.method), len(report.cases), statuses.count("proved"), statuses.count("supported"),
        report.skipped,
    )  # fmt: skip


def _held(verdicts: Iterable[Verdict]) -> Iterable[Verdict]:
    return (verdict for verdict in verdicts if verdict.holds)
