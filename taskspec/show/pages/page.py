"""The page of a task as data, in full and in short."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

from taskspec.base.display import visible
from taskspec.base.extras import need
from taskspec.base.files import safe_name
from taskspec.base.named import all_names
from taskspec.language import registry
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike
from taskspec.show.pages import facts as scores
from taskspec.show.pages import sections
from taskspec.show.pages.equations import Writing
from taskspec.show.pages.facts import Facts, Setting, gather
from taskspec.show.pages.prose import Block, Cite, Inlines, Text, blocks, inlines
from taskspec.show.pages.sections import Section, SectionLine

# Everything is read off the task, so a page cannot say anything that the environment does not do. What exact analysis
# found (scores, verdicts on claims) comes in as `Facts`; without them the page leaves it out.


@dataclass(frozen=True)
class Page:
    """The printed form of one task, with the values of each setting beside the symbols."""

    id: str
    name: str
    anchor: str
    title: str
    capability: str
    summary: Inlines
    description: tuple[Block, ...]
    make: str
    sections: tuple[Section, ...]
    sources: tuple[Cite, ...]
    source_text: str
    source_name: str
    task: Task
    facts: Facts
    settings: tuple[Setting, ...] = ()

    def section(self, key: str) -> Section | None:
        """Look up a section.

        Args:
            key: such as `dynamics`.

        Returns:
            None where the page has no such section.
        """
        return next((section for section in self.sections if section.key == key), None)

    def _repr_html_(self) -> str:
        hypertext = need("taskspec.show.pages.hypertext", "docs", "a page in a notebook")
        return hypertext.article(f"{self.name} {self.title}", self.summary, self.description, self.sections)


def page(task: TaskLike, facts: Facts | None = None, columns: Sequence[Mapping[str, Any]] = ()) -> Page:
    """Return the page of a task.

    Args:
        task: what to print, symbolic in its parameters.
        facts: scores and verdicts; none are shown without.
        columns: parameter values to show beside the symbols, each on top of the task's own. Scores and verdicts of
            them are worked out if `facts` are given. Names that the task has no parameter for are left out, and so are
            columns that come to the task's own values or to those of an earlier column.

    Returns:
        The sections in the order in which they are printed, each as a tree of formulas, tables and text.

    Raises:
        SpecError: (E703) for values that a parameter cannot have.
    """
    task = load(task)
    settings = tuple(_settings(task, columns, facts is not None))
    facts = facts or Facts()
    shown = _with_settings(task, facts, settings)
    source_text = task.source.document.origin.text
    source_name = task.source.document.origin.name.replace("\\", "/").rsplit("/")[-1]
    return Page(
        id=task.id, name=task.name, anchor=anchor(task.name), title=task.title,
        capability=task.spec.capability or "", summary=inlines(task.spec.summary),
        description=blocks(task.spec.description), make=visible(_call(task, source_name), keep=""), sections=shown,
        sources=tuple(Cite(x.key, x.where) for x in task.spec.sources),
        source_text=source_text, source_name=source_name,
        task=task, facts=facts, settings=settings,
    )  # fmt: skip


def _call(task: Task, source_name: str) -> str:
    """Return the call that makes the environment: by its id where that is known, else by its file."""
    if task.id in registry.known() or not source_name.endswith((".yaml", ".yml")):
        arguments = [_quoted(f"taskspec:{task.id}")]
    else:
        arguments = [_quoted("taskspec:taskspec/Spec-v0"), f"path={_quoted(source_name)}"]
        if task.source.variant is not None:
            arguments.append(f"variant={_quoted(task.source.variant)}")
    for p in task.parameters:
        if p.value != p.default:
            arguments.append(f"{p.name}={p.value!r}")
    if task.modifiers:
        arguments.append(f"modifiers={list(map(str, task.modifiers))!r}")
    return f"gymnasium.make({', '.join(arguments)})"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


_WORD_ENDS = re.compile(r"(?<=[a-z])(?=[A-Z]|\d+[A-Z](?![a-z]))|(?<=\d)(?=[A-Z][a-z])")
"""Between words of a name: `Pong|1D`, `Level2|Boss`, `Branching|Seals`."""


def anchor(name: str) -> str:
    """Return a name as part of an address or a file name."""
    words = re.sub(_WORD_ENDS, "-", name).lower()
    return safe_name(re.sub(r"[^a-z0-9]+", "-", words).strip("-") or "task")


def _settings(task: Task, columns: Sequence[Mapping[str, Any]], known: bool) -> Iterator[Setting]:
    names = {}
    for p in task.parameters:
        names[p.alias] = p.name
        names[p.name] = p.name
    shown = [task.values]
    for column in columns:
        values = {names[name]: value for name, value in column.items() if name in names}
        if not values:
            continue
        at = load(task, **values)
        if at.values not in shown:
            shown.append(at.values)
            facts = gather(at) if known else Facts()
            yield Setting(_title(at, values), at, facts)


def _title(task: Task, names: Iterable[str]) -> str:
    return ", ".join(f"{name} = {task.values[name]}" for name in names)


def _with_settings(task: Task, facts: Facts, settings: Sequence[Setting]) -> tuple[Section, ...]:
    shown = sections.all_sections(Writing(task, {}), facts, sections.results(_columns(task, facts, settings)))
    if settings and len(settings) < scores.MOST_COLUMNS:
        own_values = _concrete(task, facts)
        for each in settings:
            concrete = _concrete(each.task, each.facts)
            for i, section in enumerate(shown):
                shown[i] = _beside(section, own_values.get(section.key), concrete.get(section.key))
    return tuple(shown)


def _columns(task: Task, facts: Facts, settings: Sequence[Setting]) -> list[Setting]:
    return [Setting(_title(task, task.values), task, facts), *settings]


def _concrete(task: Task, facts: Facts) -> dict[str, Section]:
    return {section.key: section for section in sections.all_sections(Writing(task, task.values), facts)}


def _beside(section: Section, own: Section | None, concrete: Section | None) -> Section:
    """Return a section with what its lines are at a setting, where that differs from what they are at the task's own values."""
    if section.key == "parameters":  # a setting is headed by its parameters
        return section
    if own is None or concrete is None or not len(own.lines) == len(concrete.lines) == len(section.lines):
        return section
    lines = []
    for line, usual, other in zip(section.lines, own.lines, concrete.lines, strict=True):
        content = other.content
        if content == usual.content:
            content = ()
        lines.append(replace(line, values=(*line.values, content)))
    return replace(section, lines=tuple(lines))


# Short pages, and tasks of one spec as differences.

_KEPT = frozenset({
    "parameters", "modifiers", "maps", "state", "observations", "actions", "horizon", "definitions", "dynamics", "rewards",
    "termination", "initial", "roles", "scores",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sibling:
    """A page with only what differs from another one of its spec."""

    page: Page
    base: Page


@dataclass(frozen=True, slots=True)
class Family:
    """A page, and the other tasks of its spec, each by what differs from the one before that is most like it."""

    head: Page
    others: tuple[Sibling, ...] = ()

    @property
    def pages(self) -> tuple[Page, ...]:
        return self.head, *(other.page for other in self.others)

    @property
    def anchors(self) -> list[str]:
        return [page.anchor for page in self.pages]

    @property
    def title(self) -> str:
        """The part of their titles, up to a comma or a colon, that all begin with; else that of the first."""
        title = self.head.title
        first = re.split("[,:]", title)[0]
        others = {page.title for page in self.pages} - {title}
        if others and all(other.startswith(first) for other in others):
            return first
        return title


def briefly(page: Page) -> Page:
    """Return the page without its description, and without the sections that a reader of the paper can do without."""
    observation = page.task.observation
    kept = []
    for section in page.sections:
        if section.key == "scores":
            kept.append(_scores_alone(page))
        elif section.key == "observations" and observation.is_state and observation.space == "auto":
            continue
        elif section.key in _KEPT:
            kept.append(section)
    return replace(page, sections=tuple(kept), description=())


def _scores_alone(page: Page) -> Section:
    """Return the scores without claims: "optimal 1" for "optimal return 1", or a table of all settings."""
    title = scores.title(page.facts)
    if page.settings:
        return Section("scores", title, (), table=scores.table(_columns(page.task, page.facts, page.settings)))
    lines = []
    for line in scores.lines(page.task, page.facts):
        content = []
        for part in line:
            if isinstance(part, Text):
                part = Text(part.text.replace(" return ", " "))
            content.append(part)
        lines.append(SectionLine(tuple(content)))
    return Section("scores", title, tuple(lines))


def families(pages: Iterable[Page]) -> list[Family]:
    """Return pages by their spec, each after the first by its differences from that earlier one which leaves the fewest lines."""
    listed = []
    for _, group in groupby(pages, key=lambda page: page.task.source.document.origin.name):
        head, *others = group
        siblings = []
        for i, page in enumerate(others):
            choices = []
            for base in (head, *others[:i]):
                choices.append(Sibling(replace(page, sections=_differing(base, page)), base))
            siblings.append(min(choices, key=_lines))
        listed.append(Family(head, tuple(siblings)))
    return listed


def _lines(sibling: Sibling) -> int:
    return sum(len(section.lines) for section in sibling.page.sections if section.key != "scores")


def _differing(base: Page, page: Page) -> tuple[Section, ...]:
    same = all_names(page.task.parameters) == all_names(base.task.parameters)
    differing = []
    for section in page.sections:
        known = base.section(section.key)
        if known == section:
            continue
        if same and known is not None and section.key == "parameters":
            lines = tuple(line for line in section.lines if line not in known.lines)
            section = replace(section, lines=lines, lead=section.lead or len(lines) == 1)
        if section.key == "scores" and section.table and known is not None and known.table:
            rows = tuple(row for row in section.table.rows if row not in known.table.rows)
            section = replace(section, table=replace(section.table, rows=rows))
        differing.append(section)
    for section in base.sections:
        if page.section(section.key) is None:
            word = "the state" if section.key == "observations" else "none"
            differing.append(replace(section, lines=(SectionLine((Text(word),)),), lead=True, table=None))
    return tuple(differing)
