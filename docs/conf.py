"""The documentation site: `python -m sphinx -W -b html docs build/site`. Needs the extra `site`.

The pages are plain Markdown that reads well in the repository, too. What the site needs beyond them is worked out here
and in `tools`: tables of contents from the links on index pages, pages for files above this folder,
pages made of the program and of the suites, mathematics as MathML, which needs no network, galleries, and figures in the
colours of the site.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes

from taskspec import __version__
from taskspec.show.pages.render.html import gallery_style
from taskspec.show.printers import tex
from taskspec.show.printers.markup import mathml

project = "taskspec"
author = project_copyright = "the taskspec authors"
version = release = __version__

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS.parent)]

from docs.tools import galleries, mistakes  # noqa: E402
from docs.tools.beside import beside  # noqa: E402
from docs.tools.commands import commands  # noqa: E402
from docs.tools.functions import functions  # noqa: E402
from docs.tools.names import names  # noqa: E402
from docs.tools.notebooks import page as page_of_notebook  # noqa: E402

source_suffix = {".md": "markdown", ".ipynb": "markdown"}
extensions = ["myst_parser", "sphinx_copybutton"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True
copybutton_exclude = ".linenos, .gp, .go"
myst_heading_anchors = 4
exclude_patterns = ["build", "_build", "tools"]
suppress_warnings = ["misc.highlighting_failure"]  # some snippets show mistakes

html_theme = "furo"
html_title = f"taskspec {version}"
html_math_renderer = "mathml"
html_show_sphinx = html_show_sourcelink = html_copy_source = False
html_static_path = ["static"]
html_css_files = ["site.css", "gallery.css"]
html_js_files = ["site.js"]

SHOWN = {
    "reference/contributing": "CONTRIBUTING.md",
    "reference/security": "SECURITY.md",
    "reference/errors": "taskspec/base/errors.md",
}
"""Pages of the site, and the files above this folder that they show."""
BUILT = {
    "explain/beside": beside,
    "reference/commands": commands,
    "reference/functions": functions,
    "reference/names": names,
}
"""Pages of the site that are made of the program in full; the repository has a summary of each."""
LINK = re.compile(r"\[[^\]]*\]\(([\w/-]+)\.(?:md|ipynb)\)")
ACCESSIBLE = (
    (r'class="caption" role="heading"', 'class="caption" role="heading" aria-level="2"'),
    (r'<aside class="(\w+)-drawer">', r'<aside class="\1-drawer" aria-label="\1">'),
    (r"<pre><span>", '<pre tabindex="0"><span>'),
    (r'<th class="([^"]*)"><p></p></th>', r'<td class="\1"></td>'),
    (r'<div id="search-results">', '<h1>Search</h1><div id="search-results">'),
    (r'<th style="([^"]*)"></th>', r'<td style="\1"></td>'),
)
"""Parts of pages, and how they are written so that all can read them."""
TOP = {
    "start/tutorial": "Write a task",
    "start/exam": "Examine my learner",
    "reference/library": "Library",
    "howto/studio": "Studio",
}
"""Pages that every page leads to, at its top."""
HIDDEN = "---\nhide-toc: true\n---\n\n"
"""Leaves out the table of contents on the right."""
GROUP = re.compile(r"^- (?=[^\[])", re.MULTILINE)


def setup(app: Any) -> dict[str, Any]:
    app.connect("builder-inited", lambda app: write_pages())
    app.connect("source-read", read)
    app.connect("html-page-context", lead)
    app.connect("build-finished", finish)
    app.add_html_math_renderer("mathml", (inline_math, None), (block_math, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_pages() -> None:
    """Write the pages that are files, of tasks and of mistakes."""
    galleries.write_pages()
    mistakes.write_pages()


def read(app: Any, page: str, source: list[str]) -> None:
    """Put in the files that lie above this folder, and add the tables of contents."""
    if (DOCS / f"{page}.ipynb").exists():
        source[0] = galleries.PAPER.sub("", page_of_notebook(source[0]))
    if page in SHOWN:
        source[0] = (DOCS.parent / SHOWN[page]).read_text(encoding="utf-8").replace("](docs/", "](../")
    if page in BUILT:
        source[0] = BUILT[page]()
    suite = galleries.suite_page(page)
    if suite is not None:
        source[0] = galleries.gallery_page(suite)
    if page == galleries.LIBRARY:
        source[0] = HIDDEN + source[0].replace("<!-- gallery -->", galleries.library_gallery())
    top = "../" * page.count("/")
    for name, file in SHOWN.items():
        source[0] = re.sub(rf"\]\((?:\.\./)*{re.escape(file)}", f"]({top}{name}.md", source[0])
    listed = galleries.below(page)
    if page == mistakes.INDEX:
        source[0] = mistakes.linked(source[0])
        listed = mistakes.below()
    if listed is not None:
        source[0] += tree("", listed)
    elif page == "index":
        text, _, pages = source[0].partition("\n## Pages\n")
        source[0] = HIDDEN + text.replace("<!-- wall -->", galleries.wall()) + contents(pages)
    source[0] = galleries.with_figures(source[0], (DOCS / page).parent)


def lead(app: Any, page: str, template: str, context: dict[str, Any], document: Any) -> None:
    """Put links at the top of a page."""
    links = (f'<a href="{context["pathto"](name)}">{text}</a>' for name, text in TOP.items())
    context["theme_announcement"] = f'<nav aria-label="first steps">{" ".join(links)}</nav>'


def finish(app: Any, error: Exception | None) -> None:
    """The style of galleries is that of printed pages; and what the theme leaves out that screen readers and keyboards need."""
    if error is not None or app.builder.format != "html":
        return
    (Path(app.outdir) / "_static" / "gallery.css").write_text(gallery_style(), encoding="utf-8")
    for page in Path(app.outdir).rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        for written, accessible in ACCESSIBLE:
            text = re.sub(written, accessible, text)
        page.write_text(text, encoding="utf-8")


def contents(text: str) -> str:
    """Return the groups of the sidebar: a list item without a link names one, and the links below it are its pages."""
    groups = GROUP.split(text)[1:]
    return "".join(tree(group.split("\n", 1)[0], LINK.findall(group)) for group in groups)


def tree(caption: str, pages: list[str]) -> str:
    options = ":hidden:\n" + (f":caption: {caption}\n" if caption else "")
    return "\n".join(["\n```{toctree}", options, *pages, "```\n"]) if pages else ""


def inline_math(visitor: Any, node: Any) -> None:
    visitor.body.append(mathml(tex.read(node.astext())))
    raise nodes.SkipNode


def block_math(visitor: Any, node: Any) -> None:
    visitor.body.append(mathml(tex.read(node.astext()), block=True))
    raise nodes.SkipNode
