"""The printed form of tasks: pages as data, figures, and their rendering as LaTeX, HTML and Markdown."""

from __future__ import annotations

from taskspec.show.figures import OVERLAYS as OVERLAYS
from taskspec.show.figures import Overlay as Overlay
from taskspec.show.figures import ShownFigure as ShownFigure
from taskspec.show.figures import figure as figure
from taskspec.show.figures import overlay as overlay
from taskspec.show.figures import render_frame as render_frame
from taskspec.show.figures import scene as scene
from taskspec.show.figures import undrawn as undrawn
from taskspec.show.pages.facts import Facts as Facts
from taskspec.show.pages.facts import gather as gather
from taskspec.show.pages.page import Page as Page
from taskspec.show.pages.page import page as page
from taskspec.show.pages.write import FORMATS as FORMATS
from taskspec.show.pages.write import write as write

__all__ = [
    "FORMATS", "OVERLAYS", "Facts", "Overlay", "Page", "ShownFigure", "figure", "gather", "overlay", "page",
    "render_frame", "write",
]  # fmt: skip
