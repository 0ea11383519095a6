"""Pages and galleries of the suites' tasks, and figures that follow the colours of the site."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from taskspec.base.files import write_text
from taskspec.language import registry
from taskspec.show import figures, pages
from taskspec.show.pages.render.html import gallery
from taskspec.show.pages.render.markdown import markdown
from taskspec.show.pages.render.suite import Suite
from taskspec.show.pages.write import gather_pages

DOCS = Path(__file__).parents[1]
SUITES = {
    "reference/derail/index": ("derail", "The DERAIL suite"),
    "reference/seals/index": ("seals", "Cliff worlds and random decision processes"),
}
"""Index pages, and the suites whose tasks they show, with their headings."""
FIGURES = DOCS / "reference/derail/figures"
FIGURE = re.compile(r"!\[([^\]]*)\]\(([\w./-]+\.svg)\)")
PAPER = re.compile(r'<rect width="[\d.]+" height="[\d.]+" fill="#ffffff"/>')


@lru_cache
def suite_of(page: str) -> Suite:
    """The tasks of an index page, with their scores."""
    name, title = SUITES[page]
    tasks = [registry.load(entry.id) for entry in registry.shipped().values() if entry.suite == name]
    return gather_pages(tasks, title, facts={task.id: pages.gather(task) for task in tasks})


def write_pages() -> None:
    """Write a page, and its figures, for each task of the suites; only what changed, so that a second build is fast."""
    for page in SUITES:
        suite = suite_of(page)
        files = {name: text for name, text in markdown(suite).items() if name != "index.md"}
        files |= {f"figures/{anchor}.svg": figures.svg(scene) + "\n" for anchor, scene in suite.scenes.items()}
        for name, text in files.items():
            path = (DOCS / page).parent / name
            if not path.exists() or path.read_text(encoding="utf-8") != text:
                write_text(path, text)


def gallery_page(page: str) -> str:
    """An index page: a gallery of the tasks of its suite."""
    return f"# {SUITES[page][1]}\n\n```{{raw}} html\n{gallery(suite_of(page))}\n```\n"


def thumbnails() -> str:
    """The figures of the tasks of DERAIL, each a link to its page."""
    suite = suite_of("reference/derail/index")
    links = []
    for anchor in suite.folded:
        page = next(page for page in suite.pages if page.anchor == anchor)
        drawn = PAPER.sub("", (FIGURES / f"{anchor}.svg").read_text(encoding="utf-8"), count=1)
        links.append(
            f'<a href="reference/derail/{anchor}.html">{drawn}<span>{page.name}</span><em>{page.capability}</em></a>'
        )
    return '```{raw} html\n<div class="thumbnails">' + "".join(links) + "</div>\n```\n"


def below(page: str) -> list[str] | None:
    """The pages to list under a page of a suite: tasks under their index, variants under their task; None for other pages."""
    folder, _, name = page.rpartition("/")
    if f"{folder}/index" not in SUITES:
        return None
    folded = suite_of(f"{folder}/index").folded
    return list(folded) if page in SUITES else [other.anchor for other in folded.get(name, ())]


def with_figures(text: str, folder: Path) -> str:
    """A page whose figures are drawn inline, without paper of their own; other pictures stay what they are."""

    def drawn(found: re.Match[str]) -> str:
        svg = (folder / found[2]).read_text(encoding="utf-8")
        if not PAPER.search(svg):
            return found[0]
        return f"\n```{{raw}} html\n{PAPER.sub('', svg, count=1)}\n```\n"

    return FIGURE.sub(drawn, text)
