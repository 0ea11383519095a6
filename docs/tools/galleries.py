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
from taskspec.show.record import SUITES

DOCS = Path(__file__).parents[1]
LIBRARY = "reference/library"
FIGURE = re.compile(r"!\[([^\]]*)\]\(([\w./-]+\.svg)\)")
PAPER = re.compile(r'<rect width="[\d.]+" height="[\d.]+" fill="#ffffff"/>')
WALL = (
    "derail/RiskyPath", "toy_text/FrozenLake", "planning/SlidingPuzzle", "derail/InitShiftExpert", "safety/TomatoWatering",
    "classic_control/Acrobot", "planning/KeyDoor", "derail/LargestSum", "pomdp/Tiger", "bsuite/DeepSea",
    "classic_control/MountainCar", "memory/Minesweeper", "derail/NoisyObs", "planning/TicTacToe", "derail/Sort",
    "safety/BoatRace", "planning/Sokoban", "toy_text/Taxi",
)  # fmt: skip
"""The tasks of the wall of figures on the first pages."""


@lru_cache
def suite_of(name: str) -> Suite:
    """The tasks of a suite, with their scores."""
    tasks = [registry.load(entry.id) for entry in registry.shipped().values() if entry.suite == name]
    return gather_pages(tasks, SUITES[name].title, facts={task.id: pages.gather(task) for task in tasks})


def write_pages() -> None:
    """Write a page, and its figures, for each task of the suites; only what changed, so that a second build is fast."""
    for name in SUITES:
        suite = suite_of(name)
        files = markdown(suite)
        for page in suite.pages:
            files[f"{page.anchor}.md"] += f"\n## Specification\n\n```yaml\n{page.source_text}```\n"
        files["index.md"] = f"# {suite.title}\n"  # `gallery_page` is what the site shows
        files |= {f"figures/{anchor}.svg": figures.svg(scene) + "\n" for anchor, scene in suite.scenes.items()}
        for file, text in files.items():
            path = DOCS / "reference" / name / file
            if not path.exists() or path.read_text(encoding="utf-8") != text:
                write_text(path, text)


def suite_page(page: str) -> str | None:
    """Return the name of the suite whose index page this is; None for other pages."""
    name = page.removeprefix("reference/").removesuffix("/index")
    if page == f"reference/{name}/index" and name in SUITES:
        return name
    return None


def gallery_page(name: str) -> str:
    """An index page: a gallery of the tasks of its suite."""
    suite = suite_of(name)
    about = SUITES[name]
    return f"# {suite.title}\n\n{about.line[0].upper()}{about.line[1:]}.\n\n{_raw(gallery({'': suite}))}"


def library_gallery() -> str:
    """A gallery of all tasks."""
    return _raw(gallery({f"{name}/": suite_of(name) for name in SUITES}))


def wall() -> str:
    """The figures of some tasks, each a link to its page."""
    links = []
    for task in WALL:
        name = task.partition("/")[0]
        suite = suite_of(name)
        page = next(page for page in suite.pages if page.id == f"{task}-v0")
        drawn = figures.svg(suite.scenes[page.anchor], css=True)
        links.append(
            f'<a href="reference/{name}/{page.anchor}.html">{drawn}<span>{page.name}</span><em>{page.capability}</em></a>'
        )
    return _raw(f'<div class="thumbnails">{"".join(links)}</div>')


def _raw(html: str) -> str:
    return f"```{{raw}} html\n{html}\n```\n"


def below(page: str) -> list[str] | None:
    """The pages to list under a page: suites under the library, tasks under their suite, variants under their task.

    None for pages that are none of these.
    """
    if page == LIBRARY:
        return [f"{name}/index" for name in SUITES]
    folder, _, anchor = page.rpartition("/")
    name = suite_page(f"{folder}/index")
    if name is None:
        return None
    folded = suite_of(name).folded
    if anchor == "index":
        return list(folded)
    return [other.anchor for other in folded.get(anchor, ())]


def with_figures(text: str, folder: Path) -> str:
    """A page whose figures are drawn inline, without paper of their own; other pictures stay what they are."""

    def drawn(found: re.Match[str]) -> str:
        svg = (folder / found[2]).read_text(encoding="utf-8")
        if not PAPER.search(svg):
            return found[0]
        return f"\n```{{raw}} html\n{PAPER.sub('', svg, count=1)}\n```\n"

    return FIGURE.sub(drawn, text)
