"""The printed form of tasks: pages as data, figures, and their rendering as LaTeX, HTML and Markdown."""

from __future__ import annotations

from taskspec.figures import OVERLAYS as OVERLAYS
from taskspec.figures import Overlay as Overlay
from taskspec.figures import ShownFigure as ShownFigure
from taskspec.figures import figure as figure
from taskspec.figures import overlay as overlay
from taskspec.figures import render_frame as render_frame
from taskspec.figures import scene as scene
from taskspec.figures import undrawn as undrawn
from taskspec.pages.facts import Facts as Facts
from taskspec.pages.facts import gather as gather
from taskspec.pages.page import Page as Page
from taskspec.pages.page import page as page
from taskspec.pages.write import FORMATS as FORMATS
from taskspec.pages.write import write as write

__all__ = [
    "FORMATS", "OVERLAYS", "Facts", "Overlay", "Page", "ShownFigure", "figure", "gather", "overlay", "page",
    "render_frame", "write",
]  # fmt: skip
