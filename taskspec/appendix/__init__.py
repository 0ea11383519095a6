"""The printed form of tasks: pages as data, figures, and their rendering as LaTeX, HTML and Markdown."""

from __future__ import annotations

from taskspec.appendix.facts import Facts as Facts
from taskspec.appendix.facts import gather as gather
from taskspec.appendix.figures import OVERLAYS as OVERLAYS
from taskspec.appendix.figures import Overlay as Overlay
from taskspec.appendix.figures import figure as figure
from taskspec.appendix.figures import overlay as overlay
from taskspec.appendix.figures import render_frame as render_frame
from taskspec.appendix.figures import scene as scene
from taskspec.appendix.figures import undrawn as undrawn
from taskspec.appendix.page import Page as Page
from taskspec.appendix.page import page as page
from taskspec.appendix.write import FORMATS as FORMATS
from taskspec.appendix.write import write as write

__all__ = [
    "FORMATS", "OVERLAYS", "Facts", "Overlay", "Page", "figure", "gather", "overlay", "page", "render_frame", "scene",
    "undrawn", "write",
]  # fmt: skip
