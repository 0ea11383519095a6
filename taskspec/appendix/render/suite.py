"""What the renderers work on: pages with their figures and the references that they cite."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from taskspec.appendix.bibliography import Reference
from taskspec.appendix.page import Page
from taskspec.figures import Scene


@dataclass(frozen=True)
class Suite:
    """The pages of some tasks; `scenes` are their figures by the pages' anchors."""

    title: str
    pages: tuple[Page, ...]
    scenes: Mapping[str, Scene]
    references: Mapping[str, Reference]

    @cached_property
    def cited(self) -> dict[str, Reference]:
        """The references that are cited and known, in the order of their keys."""
        keys = {cite.key for page in self.pages for cite in page.sources}
        return {key: self.references[key] for key in sorted(keys) if key in self.references}

    def files(self) -> dict[str, str]:
        """File names without ending, by anchor: they are the anchors."""
        return {page.anchor: page.anchor for page in self.pages}
