"""What renderers work on: pages with figures and references; and the environments of templates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from taskspec.base.bibliography import Reference
from taskspec.figures import Scene
from taskspec.pages.page import Page, Setting, anchor
from taskspec.task.merge import lineage

# -- templates, which only lay out what renderers have escaped

_TEMPLATES = Path(__file__).parent.parent / "templates"


@lru_cache(maxsize=1)
def html_environment() -> Environment:
    """Return the environment for HTML, which escapes all that is not marked as markup."""
    return Environment(
        loader=FileSystemLoader(_TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip


@lru_cache(maxsize=1)
def text_environment() -> Environment:
    """Return the environment for LaTeX and Markdown, with marks that neither uses; values have been escaped before."""
    return Environment(
        loader=FileSystemLoader(_TEMPLATES), autoescape=False, undefined=StrictUndefined,
        block_start_string="<%", block_end_string="%>", variable_start_string="<<", variable_end_string=">>",
        comment_start_string="<#", comment_end_string="#>",
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip


# -- pages with figures and references


@dataclass(frozen=True, slots=True)
class Other:
    """The figure of a setting of the parameters."""

    title: str
    anchor: str
    scene: Scene

    @property
    def caption(self) -> str:
        """The values, and what is seen."""
        return f"{self.title}. {self.scene.caption}"


def setting_anchor(page: Page, setting: Setting) -> str:
    """Return the page's anchor with the values of the setting."""
    return f"{page.anchor}-{anchor(setting.title)}"


@dataclass(frozen=True)
class Suite:
    """The pages of some tasks; `scenes` are their figures by the pages' anchors, and by those of their settings."""

    title: str
    pages: tuple[Page, ...]
    scenes: Mapping[str, Scene]
    references: Mapping[str, Reference]
    brief: bool = False

    @cached_property
    def cited(self) -> dict[str, Reference]:
        """The references that are cited and known, in the order of their keys."""
        keys = {cite.key for page in self.pages for cite in page.sources}
        return {key: self.references[key] for key in sorted(keys) if key in self.references}

    @cached_property
    def folded(self) -> dict[str, tuple[Page, ...]]:
        """Pages of variants by the anchor of the page that they are based on, directly or not."""
        known = {(page.task.document.origin.name, page.task.variant): page.anchor for page in self.pages}
        found: dict[str, list[Page]] = {}
        for page in self.pages:
            line = [(document.origin.name, key) for document, key in lineage((page.task.document, page.task.variant))]
            *_, first = (known[step] for step in line if step in known)
            found.setdefault(first, [])
            found[first] += [page] if page.anchor != first else []
        return {anchor: tuple(pages) for anchor, pages in found.items()}

    def others(self, page: Page) -> list[Other]:
        """Return the figures of a page's settings."""
        found = ((setting.title, setting_anchor(page, setting)) for setting in page.settings)
        return [Other(title, name, self.scenes[name]) for title, name in found if name in self.scenes]
