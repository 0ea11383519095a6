"""The page of a task as data: sections in the order of a paper's appendix, each a list of lines of prose and mathematics.

Everything is read off the task, so a page cannot say anything that the environment does not do. What exact analysis
found (scores, verdicts on claims) comes in as `Facts`; without them the page leaves it out.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from taskspec.appendix import sections
from taskspec.appendix.facts import Facts
from taskspec.appendix.prose import Block, Cite, Inlines, blocks, inlines
from taskspec.appendix.sections import Section, SectionLine
from taskspec.appendix.writing import Writing
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike
from taskspec.visible import visible


@dataclass(frozen=True)
class Page:
    """What is printed about one task. `columns` are the sets of parameter values shown beside the symbols."""

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
    columns: tuple[str, ...] = ()

    def section(self, key: str) -> Section | None:
        return next((s for s in self.sections if s.key == key), None)


def page(task: TaskLike, facts: Facts | None = None, columns: Sequence[Mapping[str, Any]] = ()) -> Page:
    """The page of a task.

    Args:
        task: what to print, symbolic in its parameters.
        facts: scores and verdicts; none are shown without.
        columns: parameter values to show beside the symbols, each on top of the task's own.
    """
    task, facts = load(task), facts or Facts()
    shown = _with_columns(task, facts, columns)
    return Page(
        id=task.id, name=task.name, anchor=anchor(task.name), title=task.title,
        capability=task.spec.capability or "", summary=inlines(task.spec.summary),
        description=blocks(task.spec.description), make=make_line(task), sections=shown,
        sources=tuple(Cite(x.key, x.where) for x in task.spec.sources),
        source_text=task.document.origin.text, source_name=task.document.origin.name.replace("\\", "/").rsplit("/")[-1],
        task=task, facts=facts, columns=tuple(column_title(c) for c in columns),
    )  # fmt: skip


def anchor(name: str) -> str:
    """A name as part of an address or a file name."""
    return re.sub(r"[^a-z0-9]+", "-", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name).lower()).strip("-") or "task"


def make_line(task: Task) -> str:
    """The line of Python that makes the environment, with the parameters that differ from their defaults."""
    changed = "".join(f", {p.name}={p.value!r}" for p in task.parameters if p.value != p.default)
    return visible(f"gymnasium.make({json.dumps(task.id, ensure_ascii=False)}{changed})", keep="")


def column_title(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values.items())


def _with_columns(task: Task, facts: Facts, columns: Sequence[Mapping[str, Any]]) -> tuple[Section, ...]:
    """The sections, with every line that the values change shown with them too."""
    symbolic = sections.all_sections(Writing(task, {}), facts)
    for values in columns:
        concrete = sections.all_sections(Writing(task, {**task.values, **values}), facts)
        found = {s.key: s for s in concrete}
        symbolic = [_beside(s, found.get(s.key)) for s in symbolic]
    return tuple(symbolic)


def _beside(section: Section, concrete: Section | None) -> Section:
    if concrete is None or len(concrete.lines) != len(section.lines) or section.key == "parameters":
        return section  # the heading of a column gives the parameters
    lines = [_line_beside(a, b) for a, b in zip(section.lines, concrete.lines, strict=True)]
    return replace(section, lines=tuple(lines))


def _line_beside(line: SectionLine, concrete: SectionLine) -> SectionLine:
    found = concrete.content if concrete.content != line.content else ()
    return replace(line, values=(*line.values, found))
