"""Results of exact analysis or simulation as a page shows them: scores in a line or a table."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from taskspec.base.display import small_fraction
from taskspec.exact import Model, Report, Results, Return, Verdict, pomdp_bounds, verdicts, wrong_examples
from taskspec.exact.scores.returns import CLAIMS
from taskspec.exact.solve.enclosure import Enclosure
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike
from taskspec.show.pages.prose import CellTable, Formula, Inlines, Mark, Text
from taskspec.show.printers import tree as m
from taskspec.show.printers.text import plain

Value = int | float | Fraction


@dataclass(frozen=True)
class Facts:
    """Results that a page shows beside the task itself; `verdicts` follow the order of the task's claims.

    `unknown` names the returns that every task has, and that could not be worked out for this one.
    """

    scores: Mapping[str, Return] = field(default_factory=dict)
    verdicts: Sequence[Mark] = ()
    wrong_examples: frozenset[int] = frozenset()  # by number
    unknown: Sequence[str] = ()
    model: Model | None = field(default=None, compare=False, repr=False)  # from which the results are

    @property
    def states(self) -> int | None:
        """The number of states that are reached."""
        if self.model is None:
            return None
        return int(self.model.entered.sum())


@dataclass(frozen=True)
class Setting:
    """The task at other values of its parameters, which the page shows beside the symbols."""

    title: str
    task: Task
    facts: Facts


def gather(task: TaskLike | Report) -> Facts:
    """Return scores and verdicts of a task.

    Args:
        task: or the report of a check, whose scores and verdicts are not worked out again.

    Returns:
        The known scores, the verdict on each claim, and the examples that are wrong.
    """
    if isinstance(task, Report):
        return _facts(task.results, task.verdicts, task.coverage.wrong_examples)
    results = Results(load(task))
    wrong = dict(wrong_examples(results.task))
    return _facts(results, verdicts(results.task, results), frozenset(wrong))


def _facts(results: Results, said: Iterable[Verdict], wrong: frozenset[int]) -> Facts:
    returns = {"optimal": results.optimal, "random": results.random, "worst": results.worst, "expert": results.expert}
    shown: dict[str, Return] = {}
    seen = pomdp_bounds(results)
    for name, value in returns.items():
        if value is None:
            continue
        if name == "optimal" and seen is not None:  # a task that hides its state
            shown["optimal return, knowing the state"] = value
            shown |= _bounds("best return with memory", seen.remembering)
            shown |= _bounds("best return without memory", seen.memoryless)
        else:
            shown[f"{name} return"] = value
    unknown = [f"{name} return" for name in ("optimal", "worst") if returns[name] is None]
    return Facts(shown, tuple(by_claim(results.task, said)), wrong, tuple(unknown), results.model)


def _bounds(name: str, value: Enclosure | None) -> dict[str, Return]:
    if value is None:
        return {}
    if value.error <= 1e-9 * abs(value.value):
        return {name: Return(value.value)}
    low, high = value.ends
    return {f"{name}, at least": Return(low), f"{name}, at most": Return(high)}


def by_claim(task: Task, decisions: Iterable[Verdict]) -> Iterator[Mark]:
    """Yield one verdict for each claim, which holds if it holds in all its cases."""
    waiting = iter(decisions)
    order = list(CLAIMS)
    for claim in task.annotations.claims:
        stated = [next(waiting) for _ in claim.cases or ({},)]
        worst = max(stated, key=lambda verdict: order.index(verdict.status))
        shown = CLAIMS[worst.status].shown.format(episodes=max(verdict.episodes for verdict in stated))
        holds = bool(worst.holds) if worst.status != "undecided" else None
        yield Mark(holds, shown)


def title(facts: Facts) -> str:
    if facts.scores and all(s.exact for s in facts.scores.values()):
        return "Exact scores"
    return "Scores"


def lines(task: Task, facts: Facts) -> Iterator[Inlines]:
    for name, value in _scores(task, facts):
        yield (Text(f"{name} "), *value)


MOST_COLUMNS = 4


def table(settings: Sequence[Setting]) -> CellTable:
    """Return a row for each score, a column for each setting of the parameters; the other way round for many settings."""
    titles = []
    by_name: dict[str, list[Inlines]] = {}
    for i, each in enumerate(settings):
        titles.append(each.title if len(settings) > 1 else "")
        for name, score in _scores(each.task, each.facts):
            by_name.setdefault(name, [()] * len(settings))[i] = score
    header = titles
    rows = [((Text(name),), *cells) for name, cells in by_name.items()]
    if len(settings) > MOST_COLUMNS:
        header = list(by_name)
        rows = [((Text(title),), *cells) for title, *cells in zip(titles, *by_name.values(), strict=True)]
    return CellTable(("", *header), tuple(rows))


def _scores(task: Task, facts: Facts) -> Iterator[tuple[str, Inlines]]:
    for name, score in facts.scores.items():
        yield name, _score(score)
    for name in facts.unknown:
        yield name, (Text("unknown"),)
    if facts.states is not None:
        states = "reachable abstract states"
        if task.spec.abstraction is None:
            states = "reachable states"
        yield states, (Formula(number(facts.states)),)


def _score(score: Return) -> Inlines:
    if not score.episodes:
        return (Formula(number(score.value), short=_short(score.value)),)
    if score.half == 0:
        return (Formula(_estimate(score.value)), Text(f" (in all of {score.episodes:,} episodes)"))
    value: m.Math = _estimate(score.value)
    half = _estimate(score.half)
    if 1e-9 < score.half < 1e15:  # to two digits of the interval
        digits = max(0, 1 - math.floor(math.log10(score.half)))
        value = m.signed(score.value < 0, m.Num(f"{abs(score.value):.{digits}f}"))
        half = m.Num(f"{score.half:.{digits}f}")
    return (Formula(value), Text(" ± "), Formula(half), Text(f" (95 % CI, {score.episodes:,} episodes)"))


def _short(value: Value) -> m.Num | None:
    """Return a number to three digits, or to a whole one; None where `number` has no more digits than that."""
    written = plain(number(value))
    if not _LONG.fullmatch(written):
        return None
    places = max(0, 2 - math.floor(math.log10(abs(float(value)))))
    return m.Num(f"{float(value):.{places}f}".replace("-", "−"))


_LONG = re.compile(r"−?(?=[\d.]{6,})\d*\.\d+")
"""Decimals of more than four digits."""


def _estimate(value: Value) -> m.Math:
    return number(round(float(value), 6))


def number(value: Value) -> m.Math:
    """Return a number for people: short decimals and small fractions exactly, anything else to six digits."""
    size = -value if value < 0 else value
    if isinstance(size, float) and math.isfinite(size):
        small = small_fraction(size, 999, 1e-13 * max(1.0, size))  # which it equals up to rounding
        if small is not None:
            size = small
    if value < 0 and size:
        return m.row(m.Sym("−"), *_digits(size, "−"))
    return m.row(*_digits(size, "+"))


def _digits(size: Value, sign: str) -> Iterator[m.Math]:
    """Yield the number from 0 on; a fraction after a whole number has the sign of both."""
    if size == math.inf:
        yield m.Ident("∞")
        return
    if isinstance(size, Fraction) and size.denominator < 1000 and 10**9 % size.denominator:  # no short decimal
        whole, rest = divmod(size, 1)
        if whole:
            yield from (m.Num(str(whole)), m.Sym(sign))
        yield m.Frac(m.Num(str(rest.numerator)), m.Num(str(rest.denominator)))
        return
    digits = f"{float(size):.6g}"
    if isinstance(size, int) or float(size) == round(float(size), 10):
        digits = f"{float(size):.12g}"
    mantissa, mark, exponent = digits.partition("e")
    if not mark:
        yield m.Num(digits)
        return
    power = m.Num(str(int(exponent)).replace("-", "−"))
    yield m.Row((m.Num(mantissa), m.Sym("×"), m.Script(m.Num("10"), sup=power)))
