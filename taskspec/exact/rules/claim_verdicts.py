"""Claims about exact results, and the parameter values that they are about.

Numbers are exact where they are (`B**-L` is a fraction) and intervals where they come from simulation. Two numbers are
equal within 1e-9 of their size, or within the claim's `tolerance`; an interval is equal to any number that it contains.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from taskspec.base.diagnostics import Diagnostic, Placed, SpecError
from taskspec.base.limits import tell
from taskspec.exact.model.space import words
from taskspec.exact.rollout.rollout import EPISODES
from taskspec.exact.rules.claim_rules import ClaimEvaluator, Reason, Terms
from taskspec.exact.rules.evaluator import InvalidClaim, Undecidable
from taskspec.exact.scores.returns import CLAIMS, OfClaim, Results
from taskspec.language.expressions import syntax as s
from taskspec.language.modifiers import modify
from taskspec.language.registry import load
from taskspec.language.source import Path
from taskspec.language.task.build import build
from taskspec.language.task.merge import merge
from taskspec.language.task.parts import Claim
from taskspec.language.task.task import Task, TaskLike

CONFIDENCE = 0.999
CODES = {"claims": "E603", "examples": "E613"}
"""Codes of mistakes in `for:`."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of a claim for one choice of parameters.

    `proved` holds by the exact model; `tested` was not contradicted by `episodes` of simulation at
    the stated confidence. The other statuses come with a diagnostic.
    """

    claim: Claim
    parameters: Mapping[str, Any]
    status: OfClaim
    detail: str = ""
    episodes: int = 0
    diagnostic: Diagnostic | None = None

    @property
    def holds(self) -> bool:
        return self.status in ("proved", "tested")

    def record(self) -> dict[str, Any]:
        """Return it as plain data for JSON."""
        data = {"claim": self.claim.text, "parameters": dict(self.parameters), "status": self.status}
        return data | {"detail": self.detail, "episodes": self.episodes}


def verdicts(
    task: TaskLike, results: Results | None = None, results_of: Callable[[Task], Results] = Results
) -> Iterator[Verdict]:
    """Yield the verdict on every claim of a task, one for each case of its `for:`.

    Args:
        results: of the task, where they are known already.
        results_of: gives those of the task at the parameter values of a case.
    """
    task = load(task)
    known: dict[str, Results | SpecError] = {}
    if results is not None:
        known[_key(task.given)] = results
    for number, claim in enumerate(task.annotations.claims):
        tell(f"claim {number + 1} of {len(task.annotations.claims)}")
        for case in claim.cases or ({},):
            values = task.given | dict(case)
            key = _key(values)
            if key not in known:
                try:
                    other = build(task.source.document, task.source.variant, values, task.source.suite)
                    known[key] = results_of(modify(other, *task.modifiers))
                except SpecError as error:
                    known[key] = error
            verdict = known[key]
            if isinstance(verdict, SpecError):
                wrong = wrong_setting(task, "claims", number, case, verdict)
                yield Verdict(claim, case, "broken", wrong.message, diagnostic=wrong)
            else:
                yield decide(claim, verdict, case)


def _key(values: Mapping[str, Any]) -> str:
    return repr(sorted(values.items(), key=str))


def decide(claim: Claim, results: Results, case: Mapping[str, Any] | None = None) -> Verdict:
    """Return the verdict on a claim about the task of some results."""
    case = case or {}
    try:
        holds, reason, episodes = _evaluated(claim, results)
    except Undecidable as error:
        return _failed(claim, case, "undecided", str(error), (error.place or claim.expr).place, hint=results.remedy)
    except InvalidClaim as error:
        return _failed(claim, case, "broken", str(error), (error.place or claim.expr).place, hint=error.hint)
    except SpecError as error:
        return _failed(claim, case, "undecided", error.diagnostics[0].message, claim.expr.place)
    place = reason.place.place
    if holds:
        return Verdict(claim, case, "tested" if episodes else "proved", reason.text, episodes)
    if holds is None:
        hint = None
        if _compares(claim.expr) and not episodes:
            hint = "give the claim a `tolerance`"
        message = f"this claim is neither proved nor contradicted: {reason.text}"
        return _failed(claim, case, "undecided", message, place, episodes, hint)
    if not episodes:
        message = f"this claim does not hold: {reason.text}"
        return _failed(claim, case, "false", message, place, hint=state_left(results.task))
    message = f"{episodes:,} episodes contradict this claim at {CONFIDENCE:.1%} confidence: {reason.text}"
    return _failed(claim, case, "contradicted", message, place, episodes)


def _evaluated(claim: Claim, results: Results) -> tuple[bool | None, Reason, int]:
    """Return whether a claim holds, the reason, and the episodes that it took.

    A claim about a model is decided where both readings of floats agree. One about episodes is contradicted by
    intervals that hold for any distribution; where these leave it open it holds, unless normal intervals contradict it.
    """
    calls = {call.function for call in s.names(claim.expr) if isinstance(call, s.Call)}
    if claim.options.get("under") and calls.isdisjoint(("probability", "measure", "prefers")):
        raise InvalidClaim(
            "`under` is for `probability`, `measure` and `prefers`; this claim has none of them", claim.expr
        )
    terms = Terms(confidence=CONFIDENCE, episodes=int(claim.options.get("episodes") or EPISODES))
    evaluator = ClaimEvaluator(results, claim.options, terms)
    holds, reason = _decided(evaluator, claim)
    episodes = evaluator.simulated
    if episodes:
        if holds is None:
            holds, reason = _decided(ClaimEvaluator(results, claim.options, replace(terms, soundly=False)), claim)
            if holds is None:
                holds = True
            elif not holds:
                holds = None
        return holds, reason, episodes
    if holds is not None and evaluator.ambiguous:
        other, _ = _decided(ClaimEvaluator(results, claim.options, replace(terms, as_written=True)), claim)
        if other is not holds:
            return None, Reason(f"it depends on how decimals are rounded to floats: {reason.text}", reason.place), 0
    return holds, reason, episodes


def _decided(evaluator: ClaimEvaluator, claim: Claim) -> tuple[bool | None, Reason]:
    truth = evaluator.truth(claim.expr)
    return truth.holds, truth.evidence[-1]


def state_left(task: Task) -> str | None:
    """Hint that the end, or the reward, reads the state left, where the state reached may be meant."""
    for section in ("terminal", "reward"):
        name = task.state_left(section)
        if name is not None:
            return f"`{section}` reads `{name}`, the state that a step leaves; `{name}'` is the state that it reaches"
    return None


def _compares(expr: s.Expr) -> bool:
    return isinstance(expr, s.Compare) or (isinstance(expr, s.Logical) and any(map(_compares, expr.operands)))


def _failed(
    claim: Claim,
    case: Mapping[str, Any],
    status: OfClaim,
    message: str,
    place: Placed,
    episodes: int = 0,
    hint: str | None = None,
) -> Verdict:
    notes = []
    if case:
        notes.append(f"for {', '.join(f'{k} = {words(v)}' for k, v in case.items())}")
    code = CLAIMS[status].code
    assert code is not None
    diagnostic = Diagnostic(code, place.span, message, hint, tuple(notes))
    return Verdict(claim, case, status, message, episodes, diagnostic)


def wrong_setting(task: Task, section: str, number: int, case: Mapping[str, Any], error: SpecError) -> Diagnostic:
    """Return the first mistake in the parameter values of a case, at the parameter in `for:`, or at all of them.

    Args:
        section: `claims` or `examples`.
        number: of the claim or example.
        error: raised when the task was built with these values.
    """
    first = error.diagnostics[0]
    merged = merge(task.source.document, task.source.variant)
    path: Path = (section, number)
    span = merged.key_span(path)
    if case:
        path = (*path, "for")
        span = merged.key_span(path)
        grid = merged.data[section][number]["for"]
        entries = [(path, grid)]
        if isinstance(grid, list):
            entries = [((*path, i), entry) for i, entry in enumerate(grid)]
        for start, entry in entries:
            for name in case:
                is_unknown = f"has no parameter '{name}'" in first.message
                at = (*start, name)
                if name in entry and is_unknown:
                    span = merged.key_span(at)
                elif name in entry and first.message.startswith(f"parameter {name} "):
                    value = entry[name]
                    if value == case[name]:
                        span = merged.span(at)
                    elif isinstance(value, list) and case[name] in value:
                        span = merged.span((*at, value.index(case[name])))
    return Diagnostic(CODES[section], span, first.message, first.hint)
