"""Pages -> LaTeX: one file a task, `appendix.tex` to include, a document of its own, and the bibliography."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import assert_never
from urllib.parse import quote

from taskspec.appendix.page import Page
from taskspec.appendix.prose import (
    Block,
    Bullets,
    Cite,
    CodeSpan,
    Emph,
    Formula,
    Inline,
    Inlines,
    Link,
    Mark,
    Paragraph,
    Text,
)  # fmt: skip
from taskspec.appendix.render.environment import text_environment
from taskspec.appendix.render.suite import Suite
from taskspec.appendix.sections import Section, SectionLine
from taskspec.figures import tikz, tikz_colors
from taskspec.printers import tree as m
from taskspec.printers.latex import escape, latex

BESIDE = frozenset({
    "parameters", "maps", "state", "observations", "actions", "horizon", "definitions", "dynamics", "rewards",
    "termination", "initial", "expert",
})  # fmt: skip
"""Sections that stand beside the figure; the others have the whole width."""
LINE = 34.0
"""About how many letters of mathematics fit in a line beside a figure."""


def document(suite: Suite) -> dict[str, str]:
    """Files by name: the tasks, `appendix.tex`, `document.tex`, `preamble.tex`, `references.bib`."""
    env = text_environment()
    writer = LatexWriter(frozenset(suite.cited))
    files = {f"{page.anchor}.tex": writer.page(suite, page) for page in suite.pages}
    names = [page.anchor for page in suite.pages]
    files["appendix.tex"] = env.get_template("appendix.tex").render(names=names, title=escape(suite.title))
    files["preamble.tex"] = env.get_template("preamble.tex").render(colors=tikz_colors())
    files["document.tex"] = env.get_template("document.tex").render(title=escape(suite.title), cites=bool(suite.cited))
    files["references.bib"] = "\n".join(r.bibtex() for r in suite.cited.values())
    return files


@dataclass(frozen=True)
class LatexWriter:
    """Writes prose; sources outside `known` keys are named instead of cited."""

    known: frozenset[str]

    def page(self, suite: Suite, page: Page) -> str:
        scene = suite.scenes.get(page.anchor)
        return text_environment().get_template("task.tex").render(
            name=escape(page.name), title=escape(page.title), label=page.anchor, id=escape(page.id),
            summary=self.prose(page.summary), make=escape(page.make), capability=escape(page.capability),
            description=[self.block(b) for b in page.description],
            beside=[self.section(s, page) for s in page.sections if s.key in BESIDE],
            below=[self.section(s, page, wide=True) for s in page.sections if s.key not in BESIDE],
            figure=tikz(scene) if scene else "", caption=self.caption(page, scene.notes if scene else ()),
            others=[(tikz(each.scene), escape(each.title)) for each in suite.others(page)],
        )  # fmt: skip

    def caption(self, page: Page, notes: Iterable[str]) -> str:
        return " ".join([rf"\texttt{{{escape(page.name)}}}.", *map(escape, notes)])

    # -- sections -------------------------------------------------------------------------------------------------

    def section(self, section: Section, page: Page, wide: bool = False) -> dict[str, object]:
        lines = [self.line(line, page, wide) for line in section.lines]
        if section.run_on:
            lines = ["; ".join(lines)]
        lead, rest = (lines[0], lines[1:]) if section.lead or section.run_on else ("", lines)
        return {"title": escape(section.title), "lead": lead, "lines": rest, "table": self.table(section)}

    def table(self, section: Section) -> str:
        """A tabular, as wide as the line at the most."""
        found = section.table
        if found is None:
            return ""
        rows = [" & ".join(map(self.cell, row)) for row in found.rows]
        head = " & ".join(rf"\taskspechead{{{escape(title)}}}" for title in found.header)
        body = r" \\ ".join([head, *rows])
        return rf"\taskspectable{{{'l' * len(found.header)}}}{{{body}}}"

    def cell(self, content: Inlines) -> str:
        """Prose in a line of its own, in which formulas are not broken."""
        return "".join(f"${latex(p.math)}$" if isinstance(p, Formula) else self.inline(p, True) for p in content)

    def line(self, line: SectionLine, page: Page, wide: bool) -> str:
        text = self.prose(line.content, wide)
        if line.verbatim is not None:
            rows = r"\\".join(escape(row).replace(" ", "~") for row in line.verbatim.splitlines())
            text += rf"\par{{\ttfamily {rows}}}"
        for setting, values in zip(page.settings, line.values, strict=False):
            if values:
                text += rf" \taskspecvalues{{{escape(setting.title)}}}{{{self.prose(values, wide)}}}"
        return text

    def prose(self, content: Inlines, wide: bool = True) -> str:
        return "".join(self.inline(piece, wide) for piece in content)

    def inline(self, piece: Inline, wide: bool) -> str:
        match piece:
            case Text(text=text):
                return escape(text)
            case Formula(math=math, display=display):
                return formula(math, wide, display)
            case CodeSpan(text=text):
                return rf"\texttt{{{escape(text)}}}"
            case Emph(inner=inner, strong=strong):
                return rf"\{'textbf' if strong else 'emph'}{{{self.prose(inner, wide)}}}"
            case Link(address=address, inner=inner):
                return rf"\taskspeclink{{{_address(address)}}}{{{self.prose(inner, wide)}}}"
            case Cite():
                return self.cite(piece)
            case Mark(holds=holds, text=text):
                return rf"\taskspec{'holds' if holds else 'fails'}{{{escape(text)}}}"
            case _:
                assert_never(piece)

    def cite(self, cite: Cite) -> str:
        where = f"[{{{escape(cite.where)}}}]" if cite.where else ""
        if cite.key in self.known:
            return rf"\cite{where}{{{cite.key}}}"
        return escape(f"{cite.key}, {cite.where}" if cite.where else cite.key)

    def block(self, block: Block) -> str:
        match block:
            case Paragraph(content=content):
                return self.prose(content)
            case Bullets(items=items, ordered=ordered):
                kind = "enumerate" if ordered else "itemize"
                inner = "\n".join(r"\item " + "\n\n".join(map(self.block, item)) for item in items)
                return f"\\begin{{{kind}}}\n{inner}\n\\end{{{kind}}}"
            case _:
                rows = r"\\".join(escape(row).replace(" ", "~") for row in block.text.splitlines())
                return rf"{{\ttfamily {rows}}}"


def formula(math: m.Math, wide: bool, display: bool = False) -> str:
    """Mathematics in a line; what cannot break and may be too wide is put on a line of its own and fitted."""
    if display or (_is_rigid(math) and m.width(math) > (2.2 * LINE if wide else LINE) * 0.8):
        return rf"\taskspecwide{{{latex(math)}}}"
    return f"${latex(math)}$"


def _is_rigid(math: m.Math) -> bool:
    """Whether some part of a formula cannot be broken across lines."""
    if isinstance(math, m.Cases | m.Matrix):
        return True
    if isinstance(math, m.Fence) and m.is_tall(math.body):
        return True
    return any(_is_rigid(child) for child in m.children(math))


def _address(address: str) -> str:
    """An address with whatever TeX could take as its own written in per cent."""
    return quote(address, safe=":/?=&.,+-@!*();~'").replace("%", r"\%").replace("&", r"\&").replace("~", r"\~{}")
