"""Results of exact analysis, or of simulation, as a page shows them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from taskspec.exact import Report, Results, Return, Verdict, Yardsticks, verdicts, wrong_examples, yardsticks
from taskspec.exact.planning.certified.enclosure import Enclosure
from taskspec.exact.scoring.statuses import CLAIMS
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike


@dataclass(frozen=True, slots=True)
class ScoreFact:
    """A return; `half` is half the width of its 95 % confidence interval when it was estimated from `episodes`.

    `tested` counts the episodes on which the abstraction was tested that it comes from.
    """

    value: int | float | Fraction
    half: float = 0.0
    episodes: int = 0
    tested: int = 0

    @property
    def exact(self) -> bool:
        return self.episodes == self.tested == 0


@dataclass(frozen=True, slots=True)
class VerdictFact:
    """What became of a claim; `holds` is None when it was not decided, and there are no words when it was not checked."""

    holds: bool | None = None
    words: str = ""


@dataclass(frozen=True)
class Facts:
    """What a page tells beyond the task itself; `verdicts` follow the order of the task's claims.

    `unknown` names the returns that every task has, and that could not be worked out for this one.
    """

    scores: Mapping[str, ScoreFact] = field(default_factory=dict)
    verdicts: Sequence[VerdictFact] = ()
    states: int | None = None
    wrong_examples: frozenset[int] = frozenset()  # by number
    unknown: Sequence[str] = ()


def gather(task: TaskLike | Report) -> Facts:
    """Scores and verdicts of a task, worked out now; a report of it, claims included, spares what `check` worked out already.

    Raises:
        SpecError: (E705) without scipy.
    """
    if isinstance(task, Report):
        return _facts(task.unlimited, task.verdicts, task.wrong_examples)
    found = Results(load(task))
    return _facts(found, verdicts(found.task, found), frozenset(i for i, _ in wrong_examples(found.task)))


def _facts(found: Results, said: Iterable[Verdict], wrong: frozenset[int]) -> Facts:
    returns = {"optimal": found.optimal, "random": found.random, "worst": found.worst, "expert": found.expert}
    shown = {f"{name} return": _score(value) for name, value in returns.items() if value is not None}
    unknown = tuple(f"{name} return" for name in ("optimal", "worst") if returns[name] is None)
    seen = yardsticks(found)
    if seen is not None:
        shown = _hidden(shown, seen)
    states = None if found.model is None else int(found.model.entered.sum())
    return Facts(shown, tuple(_by_claim(found.task, said)), states, wrong, unknown)


def _score(found: Return) -> ScoreFact:
    return ScoreFact(found.value, found.half if found.episodes else 0.0, found.episodes, found.tested)


def _hidden(shown: dict[str, ScoreFact], seen: Yardsticks) -> dict[str, ScoreFact]:
    """Scores of a task that hides its state: what the optimum knows is said, and what the best earn who see less follows."""
    found = {}
    for name, score in shown.items():
        found["optimal return, knowing the state" if name == "optimal return" else name] = score
        if name == "optimal return":
            found |= _bounds("best return with memory", seen.remembering)
            found |= _bounds("best return without memory", seen.memoryless)
    return found


def _bounds(name: str, value: Enclosure | None) -> dict[str, ScoreFact]:
    """A value, or its two bounds where these are apart."""
    if value is None:
        return {}
    if value.error <= 1e-9 * abs(value.value):
        return {name: ScoreFact(value.value)}
    return {f"{name}, {which}": ScoreFact(end) for which, end in zip(("at least", "at most"), value.ends, strict=True)}


def _by_claim(task: Task, decisions: Iterable[Verdict]) -> Iterable[VerdictFact]:
    """One verdict for each claim: it holds when it holds in all its cases."""
    waiting = iter(decisions)
    for claim in task.claims:
        found = [next(waiting) for _ in claim.cases or ({},)]
        yield _together(found)


def _together(found: Sequence[Verdict]) -> VerdictFact:
    order = list(CLAIMS)
    worst = max(found, key=lambda d: order.index(d.status))
    shown = CLAIMS[worst.status].shown.format(episodes=max(d.episodes for d in found))
    return VerdictFact(True if worst.holds else None if worst.status == "undecided" else False, shown)
