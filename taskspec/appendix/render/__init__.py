"""Pages -> files: LaTeX, HTML and Markdown. The one package that imports the template library."""

from __future__ import annotations

from taskspec.appendix.render.html import gallery as gallery
from taskspec.appendix.render.html import gallery_style as gallery_style
from taskspec.appendix.render.html import page_style as page_style
from taskspec.appendix.render.html import site as site
from taskspec.appendix.render.latex import document as document
from taskspec.appendix.render.markdown import markdown as markdown
