"""The page `beside.md`: the tasks of DERAIL as the paper's appendix prints them, beside what is printed of them here.

python docs/beside.py
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from taskspec import registry
from taskspec.base.files import write_text
from taskspec.pages.page import Page, briefly, page
from taskspec.pages.render.markdown import MarkdownWriter
from taskspec.pages.write import gather_pages

DOCS = Path(__file__).parent
INTRODUCTION = """\
# The ten tasks, beside the paper

On the left of each table is what appendix A of the paper prints (Freire, Gleave, Toyer and Russell, 2020,
[arXiv:2012.01365](https://arxiv.org/abs/2012.01365)), word for word (but "per cent" is spelled); on the right what
`taskspec docs --brief` prints of the same part of the task, read off the spec that runs. A row with ≠ is one in which they
contradict one another; below the table is why. [Paper, appendix, code, and this suite](fidelity.md) compares the code, too.

This page is made by `python docs/beside.py` from `docs/printed.yaml` and the specs; a test keeps it up to date.
"""


SECTIONS = {
    "action": "Action space", "dynamics": "Dynamics", "horizon": "Horizon", "initial": "Initial state", "reward": "Rewards",
}  # fmt: skip
"""Titles of rows by the sections of specs that errata are about."""
DIFFERS = '<span class="differs">≠</span>'
"""The mark of a row; the style sheet colours the row by it."""


def beside() -> str:
    """The text of the page."""
    printed: Mapping[str, Mapping[str, list[str]]] = yaml.safe_load((DOCS / "printed.yaml").read_text(encoding="utf-8"))
    suite = gather_pages([registry.load(f"derail/{name}-v0") for name in printed])
    writer = MarkdownWriter(suite)
    parts = [INTRODUCTION]
    for each in suite.pages:
        parts += _task(each, writer, printed[each.name])
    return "\n".join(parts)


def _task(each: Page, writer: MarkdownWriter, printed: Mapping[str, list[str]]) -> Iterator[str]:
    yield f"## {each.name}\n\n![Figure of {each.name}](suite/figures/{each.anchor}.svg)\n"
    yield "| | the paper's appendix | here |\n|---|---|---|"
    here = {s.title: [writer.cell(line.content) for line in s.lines] for s in briefly(page(each.task)).sections}
    errata = [(SECTIONS[key], erratum) for erratum in each.task.spec.errata for key in erratum.about or ()]
    differing = {title for title, _ in errata}
    for title, lines in printed.items():
        left, right = ("<br>".join(cells) for cells in (lines, here.get(title, ["–"])))
        mark = f" {DIFFERS}" if title in differing else ""
        yield f"| {title}{mark} | {left} | {right} |"
    yield ""
    for title, erratum in errata:
        because = f", because {erratum.because.strip()}" if erratum.because else ""
        said = erratum.source.partition(": ")[2] or erratum.source
        yield f"- *{title}*: in the appendix, {said}; here {erratum.here}{because}."
    if errata:
        yield ""


if __name__ == "__main__":
    write_text(DOCS / "beside.md", beside())
