"""Claims about exact results, and the parameter values that they are about."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from taskspec.base.diagnostics import Diagnostic, Placed, Span, SpecError
from taskspec.base.progress import tell
from taskspec.lang import syntax as s
from taskspec.model.space import words
from taskspec.modifiers import modify
from taskspec.registry import load
from taskspec.rollout.simulate import EPISODES
from taskspec.rules.evaluator import Evaluator, Terms, Truth
from taskspec.rules.vocabulary import Undecidable, Unfit
from taskspec.scores.returns import Results
from taskspec.scores.saved import CLAIMS, OfClaim
from taskspec.source import Path
from taskspec.task.build import build
from taskspec.task.merge import Merged, merge
from taskspec.task.task import Claim, Task, TaskLike

# ---------- settings
# What is wrong with the parameter values that a claim or an example is about, said where they stand in its `for:`.

_CODES = {"claims": "E603", "examples": "E613"}


def wrong_setting(task: Task, section: str, number: int, case: Mapping[str, Any], error: SpecError) -> Diagnostic:
    """The first thing that is wrong with the values of a case.

    Args:
        section, number: `claims` or `examples`, and which of them.
        error: what building the task with these values came to.
    """
    found = error.diagnostics[0]
    span = _place(
        merge(task.document, task.variant), (section, number, "for") if case else (section, number), case, found
    )
    return Diagnostic(_CODES[section], span, found.message, found.hint)


def _place(merged: Merged, path: Path, case: Mapping[str, Any], found: Diagnostic) -> Span:
    """The name of a parameter that is not there, a value that it cannot have, or all that is given."""
    for start, name in _names(merged, path) if case else ():
        if name in case and f"has no parameter '{name}'" in found.message:
            return merged.key_span((*start, name))
        if name in case and found.message.startswith(f"parameter {name} "):
            for at in _values(merged, (*start, name), case[name]):
                return merged.span(at)
    return merged.key_span(path)


def _names(merged: Merged, path: Path) -> Iterator[tuple[Path, str]]:
    """Every parameter of `for:`, with the path of the mapping in which it stands."""
    grid = merged.data[str(path[0])][path[1]]["for"]
    entries = [((*path, i), entry) for i, entry in enumerate(grid)] if isinstance(grid, list) else [(path, grid)]
    yield from ((start, name) for start, entry in entries for name in entry)


def _values(merged: Merged, path: Path, value: Any) -> Iterator[Path]:
    """Where a value stands among those of a parameter."""
    written: Any = merged.data
    for step in path:
        written = written[step]
    if not isinstance(written, list):
        yield from [path] if written == value else []
    elif value in written:
        yield (*path, written.index(value))


# ---------- claims
# Claims: statements about exact results, evaluated over the surface syntax by an interpreter of their own.
#
# Numbers are exact where they are (`B**-L` is a fraction) and intervals where they come from
# simulation. Two numbers are equal within 1e-9 of their size, or within the claim's `tolerance`; an
# interval is equal to what it contains.

CONFIDENCE = 0.999


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a claim for one choice of parameters.

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


def verdicts(task: TaskLike, results: Results | None = None) -> Iterator[Verdict]:
    """The verdict on every claim of a task, one for each case of its `for:`."""
    task = load(task)
    known: dict[str, Results | SpecError] = {}
    if results is not None:
        known[_key(task.given)] = results
    for number, claim in enumerate(task.claims):
        tell(f"claim {number + 1} of {len(task.claims)}")
        for case in claim.cases or ({},):
            yield _verdict(task, number, case, known)


def _verdict(task: Task, number: int, case: Mapping[str, Any], known: dict[str, Results | SpecError]) -> Verdict:
    values, claim = task.given | dict(case), task.claims[number]
    key = _key(values)
    if key not in known:
        known[key] = _results(task, values)
    results = known[key]
    if isinstance(results, SpecError):
        wrong = wrong_setting(task, "claims", number, case, results)
        return _failed(claim, case, "broken", wrong.message, wrong, hint=wrong.hint)
    return decide(claim, results, case)


def _key(values: Mapping[str, Any]) -> str:
    return repr(sorted(values.items(), key=str))


def _results(task: Task, values: dict[str, Any]) -> Results | SpecError:
    try:
        other = build(task.document, task.variant, values, task.suite)
    except SpecError as error:
        return error
    return Results(modify(other, *task.modifiers))


def decide(claim: Claim, results: Results, case: Mapping[str, Any] | None = None) -> Verdict:
    """The verdict on a claim about the task of some results."""
    case = case or {}
    try:
        truth, episodes = _looked_at(claim, results)
    except Undecidable as error:
        return _failed(claim, case, "undecided", str(error), (error.place or claim.expr).place, hint=results.remedy)
    except Unfit as error:
        return _failed(claim, case, "broken", str(error), (error.place or claim.expr).place, hint=error.hint)
    except SpecError as error:
        return _failed(claim, case, "undecided", error.diagnostics[0].message, claim.expr.place)
    return _settled(claim, case, truth, episodes)


def _looked_at(claim: Claim, results: Results) -> tuple[Truth, int]:
    """What becomes of a claim, and the episodes that it took.

    A claim about a model is decided where it comes out the same by both readings of floats. One about episodes is
    contradicted by intervals that hold for any distribution; where these leave it open it stands, unless normal
    intervals speak against it.
    """
    episodes = int(claim.options.get("episodes") or EPISODES)
    terms = Terms(confidence=CONFIDENCE, episodes=episodes)
    evaluator = Evaluator(results, claim.options, terms)
    truth = evaluator.truth(claim.expr)
    if truth.holds is None and evaluator.simulated:
        other = Evaluator(results, claim.options, replace(terms, soundly=False)).truth(claim.expr)
        return replace(other, holds=None if other.holds is False else True), evaluator.simulated
    if truth.holds and not evaluator.simulated and evaluator.rests_on:
        why = f"of an abstraction that agreed with the task in {evaluator.rests_on:,} episodes"
        truth, episodes = replace(truth, detail=f"{truth.detail}; {why}"), evaluator.rests_on
    else:
        episodes = evaluator.simulated
    if truth.holds is not None and not evaluator.simulated and evaluator.ambiguous:
        other = Evaluator(results, claim.options, replace(terms, as_written=True)).truth(claim.expr)
        if other.holds is not truth.holds:
            detail = f"it depends on how decimals are rounded to floats: {truth.detail}"
            return Truth(None, detail, truth.place or other.place), 0
    return truth, episodes


def _settled(claim: Claim, case: Mapping[str, Any], truth: Truth, episodes: int) -> Verdict:
    place = (truth.place or claim.expr).place
    if truth.holds:
        return Verdict(claim, case, "tested" if episodes else "proved", truth.detail, episodes)
    if truth.holds is None:
        hint = "give the claim a `tolerance`" if _compares(claim.expr) and not episodes else None
        message = f"this claim is neither proved nor contradicted: {truth.detail}"
        return _failed(claim, case, "undecided", message, place, episodes, hint)
    if not episodes:
        return _failed(claim, case, "false", f"this claim does not hold: {truth.detail}", place)
    how = f"{episodes:,} episodes contradict this claim at {CONFIDENCE:.1%} confidence: {truth.detail}"
    return _failed(claim, case, "contradicted", how, place, episodes)


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
    notes = (f"for {', '.join(f'{k} = {words(v)}' for k, v in case.items())}",) if case else ()
    code = CLAIMS[status].code
    assert code is not None
    diagnostic = Diagnostic(code, place.span, message, hint, notes)
    return Verdict(claim, case, status, message, episodes, diagnostic)
