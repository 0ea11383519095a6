"""The sections of a page, one function each: what a task is, in lines of prose and mathematics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from taskspec.appendix import claims, examples, lines, modifiers, scores
from taskspec.appendix.abstraction import abstraction
from taskspec.appendix.facts import Facts
from taskspec.appendix.prose import CellTable, Cite, Inline, Inlines, Mark, Text, inlines
from taskspec.appendix.symmetries import symmetries
from taskspec.appendix.writing import Writing


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
    table: CellTable | None = None


_SECTIONS: tuple[tuple[str, str, lines.Maker, bool], ...] = (
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
    ("roles", "Roles", lines.roles, True),
    ("expert", "Expert", lines.expert, False),
    ("abstraction", "Finite abstraction, for exact results", abstraction, False),
    ("symmetries", "Symmetries", symmetries, False),
)


def all_sections(w: Writing, facts: Facts) -> list[Section]:
    """Every section that has something to say."""
    changed = modifiers.modifiers(w.task)
    told = Section("modifiers", "Modifiers, in this order", tuple(map(SectionLine, changed)), False)
    w = replace(w, task=modifiers.as_written(w.task))
    found = [Section(key, title, tuple(SectionLine(x) for x in make(w)), lead) for key, title, make, lead in _SECTIONS]
    grids = Section(
        "maps", "Maps", tuple(SectionLine((Text(name),), verbatim=text) for name, text in lines.grids(w)), False
    )
    found[1:1] = [told, grids]
    found += [
        Section(
            "scores", scores.title(facts), tuple(map(SectionLine, scores.lines(w.task, facts))), False, run_on=True
        ),
        Section("claims", "Claims", tuple(_claims(w, facts)), False),
        Section("examples", "Examples", (), False, table=examples.table(w, facts.wrong_examples)),
        Section("errata", "Corrections to the source", tuple(_errata(w)), False),
        Section("sources", "Sources", tuple(_sources(w)), False),
    ]
    return [_single(s) for s in found if s.lines or s.table]


def _single(section: Section) -> Section:
    """A section of one line has it beside its heading."""
    lead = section.lead or (len(section.lines) == 1 and section.lines[0].verbatim is None)
    return replace(section, lead=lead)


# -- results ----------------------------------------------------------------------------------------------------------


def _claims(w: Writing, facts: Facts) -> Iterator[SectionLine]:
    verdicts = list(facts.verdicts)
    for i, claim in enumerate(w.task.claims):
        found = verdicts[i] if i < len(verdicts) else None
        about_others = w if not claim.cases else replace(w, values={})  # it says itself which values it is about
        cases = (Text(" (for "), *lines.cases(w, claim.cases), Text(")")) if claim.cases else ()
        content: list[Inline] = [*claims.claim(about_others, claim), *cases]
        if found is not None and found.words:
            words = "not for these values" if found.holds is False and about_others.values else found.words
            content += [Text(" "), Mark(found.holds, words)]
        yield SectionLine(tuple(content))


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
