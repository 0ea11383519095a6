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
`taskspec docs --brief` prints of the same part of the task, read off the spec that runs. [Paper, appendix, code, and this
suite](fidelity.md) lists where they differ, with the released code, and each task's page has its corrections.

This page is made by `python docs/beside.py` from `docs/printed.yaml` and the specs; a test keeps it up to date.
"""


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
    for title, lines in printed.items():
        left, right = ("<br>".join(cells) for cells in (lines, here.get(title, ["–"])))
        yield f"| {title} | {left} | {right} |"
    yield ""


if __name__ == "__main__":
    write_text(DOCS / "beside.md", beside())
