"""Galleries of the suites' tasks, in place of the tables of index pages, and figures that follow the colours of the site."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from taskspec import figures, pages, registry
from taskspec.pages.render.html import gallery
from taskspec.pages.render.suite import Suite
from taskspec.pages.write import gather_pages

SUITES = {"suite/index": "derail", "seals/index": "seals"}
"""Index pages, and the suites whose tasks they show."""
FIGURES = Path(__file__).parent / "suite/figures"
TABLE = re.compile(r"^\|.*\n(?:\|.*\n)+", re.MULTILINE)
ROW = re.compile(r"(?<=^\| )`([\w/]+-v\d+)`", re.MULTILINE)
FIGURE = re.compile(r"!\[([^\]]*)\]\(([\w./-]+\.svg)\)")
PAPER = re.compile(r'<rect width="[\d.]+" height="[\d.]+" fill="#ffffff"/>')


@lru_cache
def suite_of(page: str) -> Suite:
    """The tasks of an index page, with their scores."""
    tasks = [registry.load(entry.id) for entry in registry.shipped().values() if entry.suite == SUITES[page]]
    return gather_pages(tasks, facts={task.id: pages.gather(task) for task in tasks})


def with_gallery(page: str, text: str) -> str:
    """An index page with a gallery in place of its table."""
    cards = gallery(suite_of(page))
    return TABLE.sub(lambda _: f"```{{raw}} html\n{cards}\n```\n", text, count=1)


def thumbnails() -> str:
    """The figures of the tasks of DERAIL, each a link to its page."""
    suite = suite_of("suite/index")
    links = []
    for anchor in suite.folded:
        page = next(page for page in suite.pages if page.anchor == anchor)
        drawn = PAPER.sub("", (FIGURES / f"{anchor}.svg").read_text(encoding="utf-8"), count=1)
        links.append(f'<a href="suite/{anchor}.html">{drawn}<span>{page.name}</span><em>{page.capability}</em></a>')
    return '```{raw} html\n<div class="thumbnails">' + "".join(links) + "</div>\n```\n"


def with_drawings(text: str) -> str:
    """The page of the library, with the figures of tasks that have one."""

    def drawn(found: re.Match[str]) -> str:
        scene = figures.scene(registry.load(found[1]))
        if scene is None:
            return found[0]
        return f'{found[0]} <span class="drawn">{PAPER.sub("", figures.svg(scene), count=1)}</span>'

    return ROW.sub(drawn, text)


def below(page: str) -> list[str] | None:
    """The pages to list under a page of a suite: tasks under their index, variants under their task; None for other pages."""
    folder = page.partition("/")[0]
    if f"{folder}/index" not in SUITES:
        return None
    folded = suite_of(f"{folder}/index").folded
    return list(folded) if page in SUITES else [other.anchor for other in folded.get(page.partition("/")[2], ())]


def with_figures(text: str, folder: Path) -> str:
    """A page whose figures are drawn inline, without paper of their own; other pictures stay what they are."""

    def drawn(found: re.Match[str]) -> str:
        svg = (folder / found[2]).read_text(encoding="utf-8")
        if not PAPER.search(svg):
            return found[0]
        return f"\n```{{raw}} html\n{PAPER.sub('', svg, count=1)}\n```\n"

    return FIGURE.sub(drawn, text)
