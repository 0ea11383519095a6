"""The page `beside` of the site: the tasks of DERAIL as the paper's appendix prints them, beside what is printed of them here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from taskspec.language import registry
from taskspec.show.pages.page import Page, briefly, page
from taskspec.show.pages.render.markdown import MarkdownWriter
from taskspec.show.pages.write import gather_pages

DOCS = Path(__file__).parents[1]
PAGE = DOCS / "explain" / "beside.md"
"""The introduction, to which the site adds the tasks."""

SECTIONS = {
    "action": "Action space", "dynamics": "Dynamics", "horizon": "Horizon", "initial": "Initial state", "reward": "Rewards",
}  # fmt: skip
"""Titles of rows by the sections of specs that errata are about."""


def beside() -> str:
    """The text of the page."""
    printed: Mapping[str, Mapping[str, list[str]]] = yaml.safe_load(
        (DOCS / "tools" / "printed.yaml").read_text(encoding="utf-8")
    )
    suite = gather_pages([registry.load(f"derail/{name}-v0") for name in printed])
    writer = MarkdownWriter(suite)
    parts = [PAGE.read_text(encoding="utf-8")]
    for each in suite.pages:
        parts += _task(each, writer, printed[each.name])
    return "\n".join(parts)


def _task(each: Page, writer: MarkdownWriter, printed: Mapping[str, list[str]]) -> Iterator[str]:
    """The parts in which the appendix and a task differ, each with the reason."""
    here = {s.title: [writer.cell(line.content) for line in s.lines] for s in briefly(page(each.task)).sections}
    errata = [(SECTIONS[key], erratum) for erratum in each.task.spec.errata for key in erratum.about or ()]
    if not errata:
        return
    yield f"## {each.name}\n\n![Figure of {each.name}](../reference/derail/figures/{each.anchor}.svg)\n"
    yield "| | the paper's appendix | here |\n|---|---|---|"
    for title, _ in errata:
        left, right = ("<br>".join(cells) for cells in (printed[title], here.get(title, ["–"])))
        yield f"| {title} | {left} | {right} |"
    yield ""
    for title, erratum in errata:
        because = f", because {erratum.because.strip()}" if erratum.because else ""
        said = erratum.source.partition(": ")[2] or erratum.source
        yield f"- *{title}*: in the appendix, {said}; here {erratum.here}{because}."
    yield ""
