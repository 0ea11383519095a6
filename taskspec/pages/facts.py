"""Results of exact analysis or simulation as a page shows them: scores in a line or a table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from taskspec.exact import PomdpBounds, Report, Results, Return, Verdict, pomdp_bounds, verdicts, wrong_examples
from taskspec.pages.prose import CellTable, Formula, Inlines, Text
from taskspec.printers import tree as m
from taskspec.registry import load
from taskspec.scores.returns import CLAIMS, NUMBERS
from taskspec.solve.enclosure import Enclosure
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
    """Return scores and verdicts of a task; those of a report with claims are not worked out again.

    Raises:
        SpecError: (E705) without scipy.
    """
    if isinstance(task, Report):
        return _facts(task.unlimited, task.verdicts, task.wrong_examples)
    found = Results(load(task))
    return _facts(found, verdicts(found.task, found), frozenset(i for i, _ in wrong_examples(found.task)))


def _facts(found: Results, said: Iterable[Verdict], wrong: frozenset[int]) -> Facts:
    returns = {"optimal": found.optimal, "random": found.random, "worst": found.worst, "expert": found.expert}
    shown = {f"{name} return": _score_fact(value) for name, value in returns.items() if value is not None}
    unknown = tuple(f"{name} return" for name in ("optimal", "worst") if returns[name] is None)
    seen = pomdp_bounds(found)
    if seen is not None:
        shown = _hidden(shown, seen)
    states = None if found.model is None else int(found.model.entered.sum())
    return Facts(shown, tuple(_by_claim(found.task, said)), states, wrong, unknown)


def _score_fact(found: Return) -> ScoreFact:
    return ScoreFact(found.value, found.half if found.episodes else 0.0, found.episodes, found.tested)


def _hidden(shown: dict[str, ScoreFact], seen: PomdpBounds) -> dict[str, ScoreFact]:
    """Return scores of a task that hides its state: what the optimum knows is said, and what the best earn who see less
    follows.
    """
    found = {}
    for name, score in shown.items():
        found["optimal return, knowing the state" if name == "optimal return" else name] = score
        if name == "optimal return":
            found |= _bounds("best return with memory", seen.remembering)
            found |= _bounds("best return without memory", seen.memoryless)
    return found


def _bounds(name: str, value: Enclosure | None) -> dict[str, ScoreFact]:
    """Return a value, or its two bounds where these are apart."""
    if value is None:
        return {}
    if value.error <= 1e-9 * abs(value.value):
        return {name: ScoreFact(value.value)}
    return {f"{name}, {which}": ScoreFact(end) for which, end in zip(("at least", "at most"), value.ends, strict=True)}


def _by_claim(task: Task, decisions: Iterable[Verdict]) -> Iterable[VerdictFact]:
    """Yield one verdict for each claim, which holds if it holds in all its cases."""
    waiting = iter(decisions)
    for claim in task.claims:
        found = [next(waiting) for _ in claim.cases or ({},)]
        yield _together(found)


def _together(found: Sequence[Verdict]) -> VerdictFact:
    order = list(CLAIMS)
    worst = max(found, key=lambda d: order.index(d.status))
    shown = CLAIMS[worst.status].shown.format(episodes=max(d.episodes for d in found))
    return VerdictFact(True if worst.holds else None if worst.status == "undecided" else False, shown)


# -- scores in a line or a table


def title(facts: Facts) -> str:
    return "Exact scores" if facts.scores and all(s.exact for s in facts.scores.values()) else "Scores"


def lines(task: Task, facts: Facts) -> Iterator[Inlines]:
    """Yield each score with its name before it."""
    for name, value in _scores(task, facts):
        yield (Text(f"{name} "), *value)


MOST_COLUMNS = 4


def table(settings: Sequence[tuple[str, Task, Facts]]) -> CellTable:
    """Return a row for each score, a column for each setting of the parameters; the other way round for many settings."""
    found = [dict(_scores(task, facts)) for _, task, facts in settings]
    names = list(dict.fromkeys(name for scores in found for name in scores))
    if len(settings) > MOST_COLUMNS:
        turned = zip(settings, found, strict=True)
        lines = tuple(((Text(head),), *(scores.get(name, ()) for name in names)) for (head, _, _), scores in turned)
        return CellTable(("", *names), lines)
    rows = tuple(((Text(name),), *(scores.get(name, ()) for scores in found)) for name in names)
    return CellTable(("", *(heading for heading, _, _ in settings)), rows)


def _scores(task: Task, facts: Facts) -> Iterator[tuple[str, Inlines]]:
    for name, score in facts.scores.items():
        yield name, _score(score)
    for name in facts.unknown:
        yield name, (Text("unknown"),)
    if facts.states is not None:
        states = "reachable states" if task.spec.abstraction is None else "reachable abstract states"
        yield states, (Formula(number(facts.states)),)


def _score(score: ScoreFact) -> Inlines:
    """Return a return, and how sure it is."""
    if not score.episodes:
        told = (Text(f" ({NUMBERS['tested'].shown.format(episodes=score.tested)})"),) if score.tested else ()
        return (Formula(number(score.value)), *told)
    if score.half == 0:
        value = number(round(float(score.value), 6))
        return (Formula(value), Text(f" (in all of {score.episodes:,} episodes)"))
    value, half = _rounded(score.value, score.half)
    return (Formula(value), Text(" ± "), Formula(half), Text(f" (95 % CI, {score.episodes:,} episodes)"))


def _rounded(value: int | float | Fraction, half: float) -> tuple[m.Math, m.Math]:
    """Return an estimate and half its confidence interval, to two digits of the interval."""
    if not 0 < half < math.inf:
        return number(round(float(value), 6)), number(float(half))
    if not 1e-9 < half < 1e15:
        return number(float(f"{float(value):.3g}")), number(float(f"{half:.2g}"))
    digits = max(0, 1 - math.floor(math.log10(half)))
    sign = (m.Sym("−"),) if value < 0 else ()
    return m.row(*sign, m.Num(f"{abs(value):.{digits}f}")), m.Num(f"{half:.{digits}f}")


def number(value: int | float | Fraction) -> m.Math:
    """Return a number for people: short decimals and small fractions exactly, anything else to six digits."""
    if isinstance(value, float):
        if math.isinf(value):
            return m.row(*([m.Sym("−")] if value < 0 else []), m.Ident("∞"))
        value = _recognised(value)
    if isinstance(value, Fraction) and not _terminates(value) and value.denominator < 1000:
        return _mixed(value)
    if value < 0:
        return m.Row((m.Sym("−"), number(-value)))
    exact = isinstance(value, int) or (float(value) == round(float(value), 10))
    digits = f"{float(value):.12g}" if exact else f"{float(value):.6g}"
    mantissa, mark, exponent = digits.partition("e")
    if not mark:
        return m.Num(digits)
    power = str(int(exponent)).replace("-", "−")
    return m.Row((m.Num(mantissa), m.Sym("×"), m.Script(m.Num("10"), sup=m.Num(power))))


def _mixed(value: Fraction) -> m.Math:
    """Return a fraction as a whole number and the rest: 4 + 3/7, and -4 - 3/7."""
    whole, rest = divmod(abs(value), 1)
    frac = m.Frac(m.Num(str(rest.numerator)), m.Num(str(rest.denominator)))
    sign = (m.Sym("−"),) if value < 0 else ()
    return m.row(*sign, m.Num(str(whole)), m.Sym("−" if sign else "+"), frac) if whole else m.row(*sign, frac)


def _recognised(value: float) -> float | Fraction:
    """Return the small fraction that a number equals up to rounding, or the number itself."""
    ratio = Fraction(value).limit_denominator(999) if math.isfinite(value) else Fraction(0)
    return ratio if abs(float(ratio) - value) <= 1e-13 * max(1.0, abs(value)) else value


def _terminates(value: Fraction) -> bool:
    d = value.denominator
    for p in (2, 5):
        while d % p == 0:
            d //= p
    return d == 1 and value.denominator <= 10**6
