"""The sections of a page, one function each: what a task is, its modifiers, abstraction and symmetries."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from taskspec.abstraction.symmetry_proofs import verify_symmetry
from taskspec.lang import syntax as s
from taskspec.modifiers import sentences
from taskspec.pages import claims, lines
from taskspec.pages import claims as examples
from taskspec.pages import facts as scores
from taskspec.pages.equations import Writing
from taskspec.pages.facts import Facts
from taskspec.pages.lines import Maker, formula
from taskspec.pages.prose import CellTable, Cite, CodeSpan, Formula, Inline, Inlines, Mark, Text, inlines, listing
from taskspec.printers import tree as m
from taskspec.task.build import build_abstract
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Component, Task

# -- abstraction

_OWN: tuple[tuple[str, str, Maker], ...] = (
    ("initial", "initial state", lines.initial),
    ("dynamics", "dynamics", lines.dynamics),
    ("reward", "rewards", lines.rewards),
    ("terminal", "termination", lines.termination),
    ("expert", "expert", lines.expert),
)


def abstraction(w: Writing) -> Iterator[Inlines]:
    """Yield its components as functions of the state, and what it does not take from the task."""
    stand_in = build_abstract(w.task)
    written = w.spec.abstraction
    if stand_in is None or written is None:
        return
    own = Writing(stand_in, w.values, hatted=frozenset(written.state) & {*w.spec.state, *w.spec.action})
    exprs = w.parsed("abstraction")
    for c in stand_in.state:
        equation = w.equation(own.symbol(c.name), exprs[c.name])
        content: Inlines = (formula(equation, m.Sym("∈"), own.domain(c.name, written.state[c.name])),)
        yield (*content, Text(": "), *inlines(c.doc)) if c.doc else content
    for section, title, make in _OWN:
        if getattr(written, section) is not None:
            yield from ((Text(f"{title}: "), *line) for line in make(own))
    if own.hatted and any(getattr(written, section) is None for section, _, _ in _OWN):
        pairs = (m.Row((own.symbol(n), m.Words(" in place of "), own.plain.symbol(n))) for n in sorted(own.hatted))
        yield (Text("all else as above, with "), formula(m.joined(pairs)))


# -- symmetries

_MAPS = {"observation": "what is seen: ", "action": "actions: "}


def symmetries(w: Writing) -> Iterator[Inlines]:
    """Yield a line for each: its name, what it is, its maps, and how it is known to keep returns."""
    exprs: Mapping[str, Mapping[str, Mapping[str, s.Expr]]] = w.parsed("symmetries") or {}
    for symmetry in w.task.symmetries:
        content: list[Inline] = [CodeSpan(symmetry.name), Text(": ")]
        content += [*inlines(symmetry.doc), Text("; ")] if symmetry.doc else []
        for key, maps in exprs[symmetry.name].items():
            shown = [formula(w.symbol(name), m.Sym("↦"), w.math(expr)) for name, expr in maps.items()]
            content += [Text(_MAPS[key]), *listing([(each,) for each in shown]), Text("; ")]
        found = verify_symmetry(w.task, symmetry)
        how = "proved" if found.is_proved else f"tested at {found.points:,} points"
        yield (
            *content,
            Text("returns are kept "),
            Mark(found.problem is None, how if found.problem is None else "false"),
        )


# -- modifiers


def modifiers(task: Task) -> Iterator[Inlines]:
    """Yield a line for each, and one for the sizes of the state and the observation."""
    for each, said in sentences(task):
        yield (CodeSpan(str(each)), Text(": "), *inlines(said))
    if task.modifiers:
        yield (
            Text("with "),
            *_all_of(task),
            Text(f"; the rest of this page, its scores apart, is the task as written{_lost(task)}"),
        )


def _lost(task: Task) -> str:
    return ", whose expert is not one here" if task.expert is None is not task.unmodified.expert else ""


def as_written(task: Task) -> Task:
    """Return the task as its spec has it, with the claims and examples that are still about it."""
    return replace(task.unmodified, claims=task.claims, examples=task.examples)


def _all_of(task: Task) -> Iterator[Inline]:
    """Yield `them, the state is s, acted (8 values), and the observation one of 4 numbers`."""
    yield Text("them, the state is " if len(task.modifiers) > 1 else "it, the state is ")
    yield from listing([(CodeSpan(c.name),) for c in task.state])
    yield from _values(task.state)
    yield Text(", and the observation is ")
    yield from _observation(task.observation_layout)


def _values(components: tuple[Component, ...]) -> Iterator[Inline]:
    if not all(c.is_finite for c in components):
        return
    count = math.prod(n for c in components for n in c.counts)
    number: m.Math = m.Num(f"{count:,}" if count < 10**9 else f"{count:.2e}")
    yield from (Text(" ("), Formula(number), Text(" values)"))


def _observation(layout: SpaceLayout) -> Iterator[Inline]:
    match layout.form:
        case "discrete":
            yield from (Text("one of "), Formula(m.Num(f"{layout.counts[0]:,}")), Text(" numbers"))
        case "dict":
            yield from (Text("a dictionary of "), *listing([(CodeSpan(c.name),) for c in layout.components]))
        case "box":
            yield from (Text("a vector of "), Formula(m.Num(f"{layout.size:,}")), Text(" reals"))
        case form:
            kind = "integers" if form == "multi_discrete" else "zeros and ones"
            yield from (Text("a vector of "), Formula(m.Num(f"{layout.size:,}")), Text(f" {kind}"))


# -- sections


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
    """Return every section that has content."""
    changed = modifiers(w.task)
    told = Section("modifiers", "Modifiers, in this order", tuple(map(SectionLine, changed)), False)
    w = replace(w, task=as_written(w.task))
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
    """Put a single line beside its heading."""
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
    """Return a text that starts with a capital and ends with a stop."""
    text = text.strip()
    ended = text if text.endswith((".", "!", "?")) else f"{text}."
    return inlines(ended[:1].upper() + ended[1:])


def _sources(w: Writing) -> Iterator[SectionLine]:
    for entry in w.spec.sources:
        yield SectionLine((Cite(entry.key, entry.where),))
