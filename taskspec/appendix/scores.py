"""Scores in a line or a table, and numbers for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction

from taskspec.appendix.facts import Facts, ScoreFact
from taskspec.appendix.prose import CellTable, Formula, Inlines, Text
from taskspec.exact.scoring.statuses import NUMBERS
from taskspec.printers import tree as m
from taskspec.task.task import Task


def title(facts: Facts) -> str:
    return "Exact scores" if facts.scores and all(s.exact for s in facts.scores.values()) else "Scores"


def lines(task: Task, facts: Facts) -> Iterator[Inlines]:
    """Each score with its name before it."""
    for name, value in _scores(task, facts):
        yield (Text(f"{name} "), *value)


MOST_COLUMNS = 4


def table(settings: Sequence[tuple[str, Task, Facts]]) -> CellTable:
    """A row for each score, a column for each setting of the parameters; the other way round for many settings."""
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
    """A return, and how sure it is."""
    if not score.episodes:
        told = (Text(f" ({NUMBERS['tested'].shown.format(episodes=score.tested)})"),) if score.tested else ()
        return (Formula(number(score.value)), *told)
    if score.half == 0:
        value = number(round(float(score.value), 6))
        return (Formula(value), Text(f" (in all of {score.episodes:,} episodes)"))
    value, half = _rounded(score.value, score.half)
    return (Formula(value), Text(" ± "), Formula(half), Text(f" (95 % CI, {score.episodes:,} episodes)"))


def _rounded(value: int | float | Fraction, half: float) -> tuple[m.Math, m.Math]:
    """An estimate and half its confidence interval, to two digits of the interval."""
    if not 0 < half < math.inf:
        return number(round(float(value), 6)), number(float(half))
    if not 1e-9 < half < 1e15:
        return number(float(f"{float(value):.3g}")), number(float(f"{half:.2g}"))
    digits = max(0, 1 - math.floor(math.log10(half)))
    sign = (m.Sym("−"),) if value < 0 else ()
    return m.row(*sign, m.Num(f"{abs(value):.{digits}f}")), m.Num(f"{half:.{digits}f}")


def number(value: int | float | Fraction) -> m.Math:
    """A number for people: short decimals and small fractions exactly, anything else to six digits."""
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
    """A fraction as a whole number and the rest: 4 + 3/7, and -4 - 3/7."""
    whole, rest = divmod(abs(value), 1)
    frac = m.Frac(m.Num(str(rest.numerator)), m.Num(str(rest.denominator)))
    sign = (m.Sym("−"),) if value < 0 else ()
    return m.row(*sign, m.Num(str(whole)), m.Sym("−" if sign else "+"), frac) if whole else m.row(*sign, frac)


def _recognised(value: float) -> float | Fraction:
    """The small fraction that a number is to the last digits, or the number itself."""
    ratio = Fraction(value).limit_denominator(999) if math.isfinite(value) else Fraction(0)
    return ratio if abs(float(ratio) - value) <= 1e-13 * max(1.0, abs(value)) else value


def _terminates(value: Fraction) -> bool:
    d = value.denominator
    for p in (2, 5):
        while d % p == 0:
            d //= p
    return d == 1 and value.denominator <= 10**6
