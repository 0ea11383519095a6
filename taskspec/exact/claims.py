"""Claims: statements about exact results, evaluated over the surface syntax by an interpreter of their own.

Numbers are exact where they are (`B**-L` is a fraction) and intervals where they come from
simulation. Two numbers are equal within 1e-9 of their size, or within the claim's `tolerance`; an
interval is equal to what it contains.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.exact.claim_values import Undecidable, Unfit
from taskspec.exact.evaluator import Evaluator, Truth
from taskspec.exact.returns import EPISODES, Results
from taskspec.exact.space import words
from taskspec.lang import syntax as s
from taskspec.spec.build import build
from taskspec.spec.task import Claim, Task

CONFIDENCE = 0.999
Status = Literal["proved", "supported", "false", "contradicted", "undecidable", "broken"]
_CODES: dict[Status, str] = {
    "false": "E601", "contradicted": "E604", "undecidable": "E602", "broken": "E603",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a claim for one choice of parameters.

    `proved` holds by the exact model; `supported` was not contradicted by `episodes` of simulation at
    the stated confidence. The other statuses come with a diagnostic.
    """

    claim: Claim
    parameters: Mapping[str, Any]
    status: Status
    detail: str = ""
    episodes: int = 0
    diagnostic: Diagnostic | None = None

    @property
    def holds(self) -> bool:
        return self.status in ("proved", "supported")


def verdicts(task: Task, results: Results | None = None) -> Iterator[Verdict]:
    """The verdict on every claim of a task, one for each case of its `for:`."""
    known: dict[str, Results | SpecError] = {}
    if results is not None:
        known[repr(sorted(task.values.items(), key=str))] = results
    for claim in task.claims:
        for case in claim.cases or ({},):
            yield _verdict(task, claim, case, known)


def _verdict(task: Task, claim: Claim, case: Mapping[str, Any], known: dict[str, Results | SpecError]) -> Verdict:
    values = task.values | dict(case)
    key = repr(sorted(values.items(), key=str))
    if key not in known:
        known[key] = _results(task, values)
    results = known[key]
    if isinstance(results, SpecError):
        return _failed(
            claim, case, "broken", f"the parameters of the claim: {results.diagnostics[0].message}", claim.expr
        )
    return decide(claim, results, case)


def _results(task: Task, values: dict[str, Any]) -> Results | SpecError:
    try:
        other = build(task.document, task.variant, values, task.suite)
    except SpecError as error:
        return error
    return Results(other.absorbing() if task.ending == "absorb" else other)


def decide(claim: Claim, results: Results, case: Mapping[str, Any] | None = None) -> Verdict:
    """The verdict on a claim about the task of some results."""
    case = case or {}
    evaluator = Evaluator(results, claim.options, CONFIDENCE, int(claim.options.get("episodes") or EPISODES))
    try:
        truth = evaluator.truth(claim.expr)
    except Undecidable as error:
        return _failed(claim, case, "undecidable", str(error), error.place or claim.expr)
    except Unfit as error:
        return _failed(claim, case, "broken", str(error), error.place or claim.expr, hint=error.hint)
    except SpecError as error:
        return _failed(claim, case, "undecidable", error.diagnostics[0].message, claim.expr)
    return _settled(claim, case, truth, evaluator)


def _settled(claim: Claim, case: Mapping[str, Any], truth: Truth, evaluator: Evaluator) -> Verdict:
    episodes = evaluator.simulated
    if truth.holds:
        return Verdict(claim, case, "supported" if episodes else "proved", truth.detail, episodes)
    if not episodes:
        return _failed(claim, case, "false", f"this claim does not hold: {truth.detail}", truth.place or claim.expr)
    how = f"{episodes:,} episodes contradict this claim at {CONFIDENCE:.1%} confidence: {truth.detail}"
    return _failed(claim, case, "contradicted", how, truth.place or claim.expr, episodes)


def _failed(
    claim: Claim,
    case: Mapping[str, Any],
    status: Status,
    message: str,
    place: s.Expr,
    episodes: int = 0,
    hint: str | None = None,
) -> Verdict:
    notes = (f"for {', '.join(f'{k} = {words(v)}' for k, v in case.items())}",) if case else ()
    diagnostic = Diagnostic(_CODES[status], place.place.span, message, hint, notes)
    return Verdict(claim, case, status, message, episodes, diagnostic)
