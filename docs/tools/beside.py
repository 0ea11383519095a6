"""The page `beside.md`: the tasks of DERAIL as the paper's appendix prints them, beside what is printed of them here.

python -m docs.tools.beside
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from taskspec.base.files import write_text
from taskspec.language import registry
from taskspec.show.pages.page import Page, briefly, page
from taskspec.show.pages.render.markdown import MarkdownWriter
from taskspec.show.pages.write import gather_pages

DOCS = Path(__file__).parents[1]
INTRODUCTION = """\
# The ten tasks, beside the paper

Where appendix A of the paper contradicts the specs here: on the left what it prints (Freire, Gleave, Toyer and Russell, 2020,
[arXiv:2012.01365](https://arxiv.org/abs/2012.01365)), word for word (but "per cent" is spelled); on the right what
`taskspec docs --brief` prints, read off the spec that runs. All other parts agree. [Paper, appendix, code, and this
suite](fidelity.md) compares the code, too.

`python -m docs.tools.beside` makes this page from `docs/tools/printed.yaml`, which has the whole appendix, and the specs.
"""


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
    parts = [INTRODUCTION]
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


if __name__ == "__main__":
    write_text(DOCS / "explain" / "beside.md", beside())
