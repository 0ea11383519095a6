"""The printed form of tasks: pages as data, figures, and their rendering as LaTeX, HTML and Markdown."""

from __future__ import annotations

from taskspec.show.figures import OVERLAYS, Overlay, ShownFigure, figure, overlay, render_frame
from taskspec.show.pages.facts import Facts, gather
from taskspec.show.pages.page import Page, page
from taskspec.show.pages.write import FORMATS, write

__all__ = [
    "FORMATS", "OVERLAYS", "Facts", "Overlay", "Page", "ShownFigure", "figure", "gather", "overlay", "page",
    "render_frame", "write",
]  # fmt: skip
