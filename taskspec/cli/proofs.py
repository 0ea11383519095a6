"""What can be proved of a task: soundness, sanity checks and claims, with how each was found out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from taskspec.diagnostics import Diagnostic

if TYPE_CHECKING:
    from taskspec.exact import Accepted, Report, Verdict
    from taskspec.exact.abstraction.symmetries import Kept
    from taskspec.exact.simulation.points import Method
    from taskspec.task.task import Task


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found about one task.

    `how` says in a few words how soundness was decided, `method` in full. `cases` counts the other parameter values that
    were tried, `proved` and `tested` the claims of these statuses (`exact.statuses`), which `verdicts` has one by one.
    `accepted` are the warnings that the spec gives a reason for, which are not among the `diagnostics`.
    """

    diagnostics: tuple[Diagnostic, ...]
    how: str = ""
    method: str = ""
    cases: int = 0
    claims: int = 0
    proved: int = 0
    tested: int = 0
    skipped: str | None = None
    accepted: tuple[Accepted, ...] = ()
    examples: int = 0
    wrong_examples: int = 0
    verdicts: tuple[Verdict, ...] = ()
    symmetries: tuple[Kept, ...] = ()

    @property
    def claims_words(self) -> str:
        """`8 proved`, or what became of them otherwise; `3 (2 tested)` are three of which one is proved."""
        return _words(self.claims, self.proved, self.tested)

    @property
    def symmetries_words(self) -> str:
        """The same of symmetries."""
        proved = sum(each.is_proved for each in self.symmetries)
        tested = sum(each.problem is None for each in self.symmetries) - proved
        return _words(len(self.symmetries), proved, tested)

    @property
    def examples_words(self) -> str:
        """How many examples hold, or how many do not."""
        return f"{self.wrong_examples} wrong" if self.wrong_examples else f"{self.examples}" if self.examples else ""


def _words(count: int, proved: int, tested: int) -> str:
    if count > proved + tested:
        return f"{count - proved - tested} failed"
    if proved and tested:
        return f"{count} ({tested} tested)"
    return f"{proved} proved" if proved else f"{tested} tested" if tested else ""


def examine(task: Task, sense: bool = True, defaults: bool = True) -> Finding:
    """Everything that is wrong with a well-formed task.

    Args:
        sense: whether sanity checks and claims are looked at, beyond soundness.
        defaults: whether its parameters have their defaults: claims speak of these, and ranges are looked at
            from there.
    """
    return finding(reported(task, sense, defaults), len(task.examples) if sense and defaults else 0)


def reported(task: Task, sense: bool = True, defaults: bool = True) -> Report:
    """The same with the results that it rests on, which may be large."""
    from taskspec import exact
    from taskspec.appendix import undrawn

    wanted = sense and defaults
    return exact.check(task, ranges=wanted, with_sense=sense, claims=wanted, beside=undrawn if sense else None)


def finding(report: Report, examples: int) -> Finding:
    """What is told of a report in which so many examples were looked at."""
    statuses = [verdict.status for verdict in report.verdicts]
    return Finding(
        report.diagnostics, _how(report.method), str(report.method), len(report.cases), len(statuses),
        statuses.count("proved"), statuses.count("tested"), report.skipped, report.accepted,
        examples, len(report.wrong_examples), report.verdicts, report.symmetries,
    )  # fmt: skip


def _how(method: Method) -> str:
    if not method.exact:
        return f"{method.points:,} samples"
    return f"all {method.points:,} points" if method.points else "bounds"
