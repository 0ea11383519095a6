"""The short form of pages: what defines a task and its scores, and tasks of one spec together, as differences."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import groupby

from taskspec.appendix.page import Page
from taskspec.appendix.sections import Section

_KEPT = frozenset({
    "parameters", "modifiers", "maps", "state", "observations", "actions", "horizon", "definitions", "dynamics", "rewards",
    "termination", "initial", "scores",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Family:
    """A page, and for other tasks of its spec the pages with only what differs."""

    head: Page
    others: tuple[Page, ...] = ()

    @property
    def title(self) -> str:
        """The part of their titles, up to a comma or a colon, that all begin with; else that of the first."""
        titles = [page.title for page in (self.head, *self.others)]
        first = re.split("[,:]", titles[0])[0]
        return first if len(set(titles)) > 1 and all(title.startswith(first) for title in titles) else titles[0]


def briefly(page: Page) -> Page:
    """The page without its description, and without the sections that a reader of the paper can do without."""
    kept = tuple(s for s in page.sections if s.key in _KEPT and not (s.key == "observations" and _is_state(page)))
    return replace(page, sections=kept, description=())


def _is_state(page: Page) -> bool:
    return page.task.observation.is_state and page.task.observation.space == "auto"


def families(pages: Iterable[Page]) -> list[Family]:
    """Neighbours that are tasks of one spec, together."""
    found = []
    for _, group in groupby(pages, key=lambda page: page.task.document.origin.name):
        head, *others = group
        found.append(Family(head, tuple(replace(page, sections=_differing(head, page)) for page in others)))
    return found


def _differing(head: Page, page: Page) -> tuple[Section, ...]:
    """The sections of a page that its head has not, or has with other content; of its parameters, those at other values."""
    found = (section for section in page.sections if head.section(section.key) != section)
    same = [p.name for p in page.task.parameters] == [p.name for p in head.task.parameters]
    return tuple(_changed(head, section) if same and section.key == "parameters" else section for section in found)


def _changed(head: Page, section: Section) -> Section:
    """A section with the lines alone that differ from those of the head."""
    known = head.section(section.key)
    kept = tuple(line for line in section.lines if known is None or line not in known.lines)
    return replace(section, lines=kept, lead=section.lead or len(kept) == 1)
