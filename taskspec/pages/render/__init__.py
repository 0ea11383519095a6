"""Pages -> files: LaTeX, HTML and Markdown."""

from __future__ import annotations

from taskspec.pages.render.html import gallery as gallery
from taskspec.pages.render.html import gallery_style as gallery_style
from taskspec.pages.render.html import marked_states as marked_states
from taskspec.pages.render.html import page_style as page_style
from taskspec.pages.render.html import site as site
from taskspec.pages.render.latex import document as document
from taskspec.pages.render.markdown import markdown as markdown
