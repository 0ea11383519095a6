"""The sections of a page, one function each: what a task is, in lines of prose and mathematics."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from taskspec.appendix import claims, examples, lines
from taskspec.appendix.examples import ExampleTable
from taskspec.appendix.facts import Facts
from taskspec.appendix.prose import Cite, Formula, Inline, Inlines, Mark, Text, inlines
from taskspec.appendix.writing import Writing
from taskspec.exact.scoring.statuses import NUMBERS
from taskspec.printers import tree as m


@dataclass(frozen=True, slots=True)
class SectionLine:
    """A line of a section, and the same with each column of values (empty where nothing changes)."""

    content: Inlines
    values: tuple[Inlines, ...] = ()
    verbatim: str | None = None


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and its lines, or a table; with `lead` the first line follows the heading, the others are below it."""

    key: str
    title: str
    lines: tuple[SectionLine, ...]
    lead: bool = True
    run_on: bool = False  # short lines, which may follow each other with semicolons
    table: ExampleTable | None = None


Maker = Callable[[Writing], Iterator[Inlines]]
_SECTIONS: tuple[tuple[str, str, Maker, bool], ...] = (
    ("parameters", "Configurable parameters", lines.parameters, False),
    ("state", "State space", lines.state, True),
    ("observations", "Observations", lines.observations, True),
    ("actions", "Action space", lines.actions, True),
    ("horizon", "Horizon", lines.horizon, True),
    ("definitions", "Definitions", lines.definitions, False),
    ("dynamics", "Dynamics", lines.dynamics, False),
    ("rewards", "Rewards", lines.rewards, True),
    ("termination", "Termination", lines.termination, True),
    ("initial", "Initial state", lines.initial, False),
    ("expert", "Expert", lines.expert, False),
)


def all_sections(w: Writing, facts: Facts) -> list[Section]:
    """Every section that has something to say."""
    found = [Section(key, title, tuple(SectionLine(x) for x in make(w)), lead) for key, title, make, lead in _SECTIONS]
    grids = Section(
        "maps", "Maps", tuple(SectionLine((Text(name),), verbatim=text) for name, text in lines.grids(w)), False
    )
    found.insert(1, grids)
    found += [
        Section("scores", _scores_title(facts), tuple(_scores(facts)), False, run_on=True),
        Section("claims", "Claims", tuple(_claims(w, facts)), False),
        Section("examples", "Examples", (), False, table=examples.table(w, facts.wrong_examples)),
        Section("errata", "Where the source is repaired", tuple(_errata(w)), False),
        Section("sources", "Sources", tuple(_sources(w)), False),
    ]
    return [_single(s) for s in found if s.lines or s.table]


def _single(section: Section) -> Section:
    """A section of one line has it beside its heading."""
    lead = section.lead or (len(section.lines) == 1 and section.lines[0].verbatim is None)
    return replace(section, lead=lead)


# -- results ----------------------------------------------------------------------------------------------------------


def _scores_title(facts: Facts) -> str:
    return "Exact scores" if all(s.exact for s in facts.scores.values()) else "Scores"


def _scores(facts: Facts) -> Iterator[SectionLine]:
    for name, score in facts.scores.items():
        if not score.episodes:
            told = f" ({NUMBERS['tested'].shown.format(episodes=score.tested)})" if score.tested else ""
            yield SectionLine((Text(f"{name} "), Formula(number(score.value)), *([Text(told)] if told else [])))
            continue
        if score.error == 0:
            value = number(round(float(score.value), 6))
            yield SectionLine((Text(f"{name} "), Formula(value), Text(f" (in all of {score.episodes} episodes)")))
            continue
        value, error = _rounded(score.value, score.error)
        yield SectionLine(
            (Text(f"{name} "), Formula(value), Text(" ± "), Formula(error), Text(f" (from {score.episodes} episodes)"))
        )
    if facts.states is not None:
        yield SectionLine((Text("states that can be reached "), Formula(number(facts.states))))


def _rounded(value: int | float | Fraction, error: float) -> tuple[m.Math, m.Math]:
    """An estimate and its standard error, to two digits of the error."""
    if not 0 < error < math.inf:
        return number(round(float(value), 6)), number(float(error))
    digits = max(0, 1 - math.floor(math.log10(error)))
    sign = (m.Sym("−"),) if value < 0 else ()
    return m.row(*sign, m.Num(f"{abs(value):.{digits}f}")), m.Num(f"{error:.{digits}f}")


def number(value: int | float | Fraction) -> m.Math:
    """A number for people: short decimals and small fractions exactly, anything else to six digits."""
    if value < 0:
        return m.Row((m.Sym("−"), number(-value)))
    if isinstance(value, float):
        value = _recognised(value)
    if isinstance(value, Fraction) and not _terminates(value) and value.denominator < 1000:
        whole, rest = divmod(value, 1)
        frac = m.Frac(m.Num(str(rest.numerator)), m.Num(str(rest.denominator)))
        return m.Row((m.Num(str(whole)), m.Sym("+"), frac)) if whole else frac
    exact = isinstance(value, int) or (float(value) == round(float(value), 10))
    digits = f"{float(value):.12g}" if exact else f"{float(value):.6g}"
    mantissa, mark, exponent = digits.partition("e")
    if not mark:
        return m.Num(digits)
    power = str(int(exponent)).replace("-", "−")
    return m.Row((m.Num(mantissa), m.Sym("×"), m.Script(m.Num("10"), sup=m.Num(power))))


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


def _claims(w: Writing, facts: Facts) -> Iterator[SectionLine]:
    verdicts = list(facts.verdicts)
    for i, claim in enumerate(w.task.claims):
        found = verdicts[i] if i < len(verdicts) else None
        content: list[Inline] = [*claims.claim(w, claim), *_cases(claim.cases)]
        if found is not None and found.holds is not None:
            content += [Text(" "), Mark(found.holds, found.words)]
        yield SectionLine(tuple(content))


def _cases(cases: tuple[Mapping[str, Any], ...]) -> Inlines:
    if not cases:
        return ()
    shown = "; ".join(", ".join(f"{k} = {_setting(v)}" for k, v in case.items()) for case in cases)
    return (Text(f" (for {shown})"),)


def _setting(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


# -- where it comes from ----------------------------------------------------------------------------------------------


def _errata(w: Writing) -> Iterator[SectionLine]:
    for entry in w.spec.errata:
        content: Inlines = (*_sentence(entry.source), Text(" Here: "), *inlines(entry.here))
        if entry.because:
            content += (Text(", because "), *inlines(entry.because))
        yield SectionLine((*content, Text(".")))


def _sentence(text: str) -> Inlines:
    """A text that starts with a capital and ends with a stop."""
    text = text.strip()
    ended = text if text.endswith((".", "!", "?")) else f"{text}."
    return inlines(ended[:1].upper() + ended[1:])


def _sources(w: Writing) -> Iterator[SectionLine]:
    for entry in w.spec.sources:
        yield SectionLine((Cite(entry.key, entry.where),))
