"""The short form of pages: what defines a task and its scores, and tasks of one spec together, as differences."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from taskspec.appendix.page import Page
from taskspec.appendix.prose import Inlines, Text
from taskspec.appendix.sections import Section, SectionLine

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
    def title(self) -> str:
        """The part of their titles, up to a comma or a colon, that all begin with; else that of the first."""
        titles = [page.title for page in self.pages]
        first = re.split("[,:]", titles[0])[0]
        return first if len(set(titles)) > 1 and all(title.startswith(first) for title in titles) else titles[0]


def briefly(page: Page) -> Page:
    """The page without its description, and without the sections that a reader of the paper can do without."""
    kept = tuple(s for s in page.sections if s.key in _KEPT and not (s.key == "observations" and _is_state(page)))
    return replace(page, sections=tuple(_shorter(s) if s.key == "scores" else s for s in kept), description=())


def _shorter(scores: Section) -> Section:
    """The scores with "optimal" for "optimal return"."""

    def told(content: Inlines) -> Inlines:
        return tuple(Text(x.text.replace(" return ", " ")) if isinstance(x, Text) else x for x in content)

    return replace(scores, lines=tuple(replace(line, content=told(line.content)) for line in scores.lines))


def _is_state(page: Page) -> bool:
    return page.task.observation.is_state and page.task.observation.space == "auto"


def families(pages: Iterable[Page]) -> list[Family]:
    """Neighbours that are tasks of one spec, together."""
    found = []
    for _, group in groupby(pages, key=lambda page: page.task.document.origin.name):
        head, *others = group
        told = [_sibling(page, [head, *others[:i]]) for i, page in enumerate(others)]
        found.append(Family(head, tuple(told)))
    return found


def _sibling(page: Page, before: Sequence[Page]) -> Sibling:
    """The differences from that page before it which leaves the fewest lines to tell, or the first of these."""
    differing = [_differing(base, page) for base in before]
    sections, base = min(zip(differing, before, strict=True), key=lambda pair: _defining_lines(pair[0]))
    return Sibling(replace(page, sections=sections), base)


def _defining_lines(sections: Sequence[Section]) -> int:
    """How many lines define what differs; scores follow from them."""
    return sum(len(section.lines) for section in sections if section.key != "scores")


def _differing(base: Page, page: Page) -> tuple[Section, ...]:
    """The sections of a page that its base lacks, or has with other content; of its parameters, those at other values."""
    found = [section for section in page.sections if base.section(section.key) != section]
    same = [p.name for p in page.task.parameters] == [p.name for p in base.task.parameters]
    changed = [_changed(base, section) if same and section.key == "parameters" else section for section in found]
    return (*changed, *(_without(section) for section in base.sections if page.section(section.key) is None))


def _changed(base: Page, section: Section) -> Section:
    """A section with the lines alone that differ from those of the base."""
    known = base.section(section.key)
    kept = tuple(line for line in section.lines if known is None or line not in known.lines)
    return replace(section, lines=kept, lead=section.lead or len(kept) == 1)


def _without(section: Section) -> Section:
    """What stands in the place of a section that a page does not have."""
    told = "the state" if section.key == "observations" else "none"
    return replace(section, lines=(SectionLine((Text(told),)),), lead=True, run_on=False, table=None)
