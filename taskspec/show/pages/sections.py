"""The sections of a page: what a task is, its modifiers, abstraction and symmetries, its scores, claims and examples."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from taskspec.base.named import all_names
from taskspec.exact.abstraction.abstraction import verify_symmetry
from taskspec.language.expressions import syntax as s
from taskspec.language.modifiers import sentences
from taskspec.language.task.build import build_abstract
from taskspec.language.task.parts import Component, are_finite, counts_of
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task
from taskspec.show.pages import claims, lines
from taskspec.show.pages import facts as scores
from taskspec.show.pages import prose as p
from taskspec.show.pages.equations import Writing
from taskspec.show.pages.facts import Facts, Setting
from taskspec.show.pages.lines import Maker, formula
from taskspec.show.printers import tree as m

T = TypeVar("T")
NOT_HERE = p.Mark(False, "not for these values")  # the mark of a claim that is about other values of the parameters
_OWN: tuple[tuple[str, str, Maker], ...] = (
    ("initial", "initial state", lines.initial),
    ("dynamics", "dynamics", lines.dynamics),
    ("reward", "rewards", lines.rewards),
    ("terminal", "termination", lines.termination),
    ("expert", "expert", lines.expert),
)


def abstraction(w: Writing) -> Iterator[p.Inlines]:
    """Yield its components as functions of the state, and what it does not take from the task."""
    stand_in = build_abstract(w.task)
    written = w.spec.abstraction
    if stand_in is None or written is None:
        return
    own = Writing(stand_in, w.values, hatted=frozenset(written.state) & {*w.spec.state, *w.spec.action})
    exprs = w.parsed("abstraction")
    for c in stand_in.state:
        equation = w.equation(own.symbol(c.name), exprs[c.name])
        content: p.Inlines = (formula(equation, m.Sym("∈"), own.domain(c.name, written.state[c.name])),)
        yield p.followed(content, ": ", c.doc)
    for section, title, make in _OWN:
        if getattr(written, section) is not None:
            for line in make(own):
                yield (p.Text(f"{title}: "), *line)
    if own.hatted and any(getattr(written, section) is None for section, _, _ in _OWN):
        pairs = []
        for name in sorted(own.hatted):
            pairs.append(m.Row((own.symbol(name), m.Words(" in place of "), own.plain.symbol(name))))
        yield (p.Text("all else as above, with "), formula(m.joined(pairs)))


_MAPS = {"observation": "what is seen: ", "action": "actions: "}


def symmetries(w: Writing) -> Iterator[p.Inlines]:
    """Yield a line for each: its name, what it is, its maps, and how it is known to keep returns."""
    exprs: Mapping[str, Mapping[str, Mapping[str, s.Expr]]] = w.parsed("symmetries") or {}
    for symmetry in w.task.annotations.symmetries:
        content: list[p.Inline] = [p.CodeSpan(symmetry.name), p.Text(": ")]
        if symmetry.doc:
            content += [*p.inlines(symmetry.doc), p.Text("; ")]
        for key, maps in exprs[symmetry.name].items():
            shown = [(each,) for each in _maps(w, key, maps)]
            content += [p.Text(_MAPS[key]), *p.listing(shown), p.Text("; ")]
        check = verify_symmetry(w.task, symmetry)
        mark = p.Mark(True, f"tested at {check.points:,} points")
        if check.problem is not None:
            mark = p.Mark(False, "false")
        elif check.is_proved:
            mark = p.Mark(True, "proved")
        yield (*content, p.Text("returns are kept "), mark)


def _maps(w: Writing, key: str, maps: Mapping[str, s.Expr]) -> Iterator[p.Formula]:
    """Yield what each component is mapped to; all of them together, where one is made of others."""
    task = w.task
    components = task.action
    if key == "observation":
        components = task.observation.components
    names = all_names(components)
    joined = set(maps)
    is_apart = True
    for name, expr in maps.items():
        read = {x.id for x in s.names(expr) if isinstance(x, s.Name)} & set(names)
        joined |= read
        is_apart = is_apart and read <= {name}
    if is_apart:
        for name, expr in maps.items():
            yield formula(w.symbol(name), m.Sym("↦"), w.math(expr))
    else:
        whole = w.whole(filter(joined.__contains__, names))
        yield formula(whole, m.Sym("↦"), m.tupled(list(map(w.math, maps.values()))))


def modifiers(task: Task) -> Iterator[p.Inlines]:
    """Yield a line for each, and one for the sizes of the state and the observation."""
    for each, said in sentences(task):
        yield (p.CodeSpan(str(each)), p.Text(": "), *p.inlines(said))
    if not task.modifiers:
        return
    with_them = "with it, the state is "
    if len(task.modifiers) > 1:
        with_them = "with them, the state is "
    line: list[p.Inline] = [p.Text(with_them), *_names(task.state)]
    if are_finite(task.state):
        count = math.prod(counts_of(task.state))
        digits = f"{count:,}"
        if count >= 10**9:
            digits = f"{count:.2e}"
        line += [p.Text(" ("), p.Formula(m.Num(digits)), p.Text(" values)")]
    rest = "; the rest of this page, its scores apart, is the task as written"
    if task.annotations.expert is None is not task.unmodified.annotations.expert:
        rest += ", whose expert is not one here"
    yield (*line, p.Text(", and the observation is "), *_observation(task.observation_layout), p.Text(rest))


def as_written(task: Task) -> Task:
    """Return the task as its spec has it, with the claims and examples that are still about it."""
    return task.unmodified.with_annotations(claims=task.annotations.claims, examples=task.annotations.examples)


def _names(components: Iterable[Component]) -> p.Inlines:
    return p.listing([(p.CodeSpan(c.name),) for c in components])


def _observation(layout: SpaceLayout) -> p.Inlines:
    if layout.form == "discrete":
        return (p.Text("one of "), p.Formula(m.Num(f"{layout.counts[0]:,}")), p.Text(" numbers"))
    if layout.form == "dict":
        return (p.Text("a dictionary of "), *_names(layout.components))
    kind = {"box": "reals", "multi_discrete": "integers"}.get(layout.form, "zeros and ones")
    return (p.Text("a vector of "), p.Formula(m.Num(f"{layout.size:,}")), p.Text(f" {kind}"))


@dataclass(frozen=True, slots=True)
class SectionLine:
    """A line of a section, and the same with each column of values (empty where nothing changes)."""

    content: p.Inlines
    values: tuple[p.Inlines, ...] = ()
    verbatim: str | None = None


_LABELS = {
    "parameters": "Parameters", "modifiers": "Modifiers", "state": "States", "actions": "Actions", "initial": "Start",
    "scores": "Returns", "abstraction": "Abstraction", "errata": "Corrections",
}  # fmt: skip
"""Short titles of sections."""


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and its lines, or a table; with `lead` the first line follows the heading, the others are below it."""

    key: str
    title: str
    lines: tuple[SectionLine, ...]
    lead: bool = False
    table: p.CellTable | None = None

    @property
    def label(self) -> str:
        """The title in a word, for a column of labels."""
        return _LABELS.get(self.key, self.title)

    def laid_out(self, lines: list[T]) -> tuple[T | None, list[T]]:
        """Return the text beside the heading and the lines below it."""
        if self.lead:
            return (lines[0], lines[1:])
        return (None, lines)


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


def all_sections(w: Writing, facts: Facts, found_results: Iterable[Section] = ()) -> list[Section]:
    """Return every section that has content; those of results come after what the task is."""
    changed = modifiers(w.task)
    w = replace(w, task=as_written(w.task))
    maps = [SectionLine((p.Text(name),), verbatim=text) for name, text in lines.grids(w)]
    sections = []
    for key, title, make, lead in _SECTIONS:
        sections.append(Section(key, title, tuple(map(SectionLine, make(w))), lead))
    sections[1:1] = [
        Section("modifiers", "Modifiers, in this order", tuple(map(SectionLine, changed))),
        Section("maps", "Maps", tuple(maps)),
    ]
    sections += [
        *found_results,
        Section("examples", "Examples", (), table=claims.examples(w, facts.wrong_examples)),
        Section("errata", "Corrections to the source", tuple(map(SectionLine, _errata(w)))),
        Section("sources", "Sources", tuple(SectionLine((p.Cite(x.key, x.where),)) for x in w.spec.sources)),
    ]
    for i, section in enumerate(sections):
        if len(section.lines) == 1 and section.lines[0].verbatim is None:
            sections[i] = replace(section, lead=True)
    return [section for section in sections if section.lines or section.table]


def results(columns: Sequence[Setting]) -> list[Section]:
    """Return scores and claims, in one table if it has room for a column for each setting of the parameters.

    The first one is the page's own.
    """
    w = Writing(as_written(columns[0].task), {})
    stated = []
    for claim in w.task.annotations.claims:
        content = claims.claim_text(w, claim)
        if claim.cases:
            content += (p.Text(" (for "), *lines.cases(w, claim.cases), p.Text(")"))
        stated.append(content)
    if not any(each.facts.scores or each.facts.verdicts for each in columns):
        return [Section("claims", "Claims", tuple(map(SectionLine, stated)))]
    table = scores.table(columns)
    marks = [_marks(each.facts, len(stated), is_own=i == 0) for i, each in enumerate(columns)]
    section = Section("scores", scores.title(columns[0].facts), (), table=table)
    if len(columns) > scores.MOST_COLUMNS:
        written = []
        for content, mark in zip(stated, marks[0], strict=True):
            written.append(SectionLine((*content, p.Text(" "), *mark)))
        return [section, Section("claims", "Claims", tuple(written))]
    if not stated:
        return [section]
    rows = [(said, *cells) for said, *cells in zip(stated, *marks, strict=True)]
    return [replace(section, title=f"{section.title} and claims", table=replace(table, rows=(*table.rows, *rows)))]


def _marks(facts: Facts, count: int, is_own: bool) -> list[p.Inlines]:
    """Return what became of each claim; one that does not hold at other values than the page's own is not about them."""
    marks: list[p.Inlines] = [()] * count
    for i, verdict in enumerate(facts.verdicts):
        if verdict.holds is False and not is_own:
            marks[i] = (NOT_HERE,)
        elif verdict.text:
            marks[i] = (verdict,)
    return marks


def _errata(w: Writing) -> Iterator[p.Inlines]:
    for entry in w.spec.errata:
        source = entry.source.strip()
        if not source.endswith((".", "!", "?")):
            source += "."
        content: p.Inlines = (*p.inlines(source[:1].upper() + source[1:]), p.Text(" Here: "), *p.inlines(entry.here))
        yield (*p.followed(content, ", because ", entry.because), p.Text("."))
