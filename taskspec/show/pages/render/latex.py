"""Pages -> LaTeX: one file a task, `appendix.tex` to include, a document of its own, and the bibliography."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import assert_never
from urllib.parse import quote

from taskspec.base import __version__
from taskspec.show.figures import tikz
from taskspec.show.figures.vector_formats import tikz_colors
from taskspec.show.pages import prose as p
from taskspec.show.pages.page import Family, Page, Sibling, families
from taskspec.show.pages.render import text_environment
from taskspec.show.pages.render.suite import Suite, notation
from taskspec.show.pages.sections import Section, SectionLine
from taskspec.show.printers import tree as m
from taskspec.show.printers.markup import LONG, escape, latex

BESIDE = frozenset({
    "parameters", "maps", "state", "observations", "actions", "horizon", "definitions", "dynamics", "rewards",
    "termination", "initial", "roles", "expert",
})  # fmt: skip
"""Sections that stand beside the figure; the others have the whole width."""
BESIDE_ROOM = 27.0
BRIEF_ROOM = 40.0
WHOLE_ROOM = 60.0
"""About how many letters of mathematics fit in a line: beside a figure, there in small letters, and in a line of the page."""


def document(suite: Suite) -> dict[str, str]:
    """Return files by name: the tasks, `appendix.tex`, `document.tex`, `preamble.tex`, `references.bib`."""
    env = text_environment()
    writer = LatexWriter(frozenset(suite.cited))
    if suite.brief:
        write = writer.brief
    else:
        write = writer.family
    texts = {family.head.anchor: write(suite, family) for family in families(suite.pages)}
    files = {f"{anchor}.tex": text for anchor, text in texts.items()}
    names = list(texts)
    files["appendix.tex"] = env.get_template("appendix.tex").render(
        names=names, brief=suite.brief, notation=writer.prose(notation(suite.pages))
    )
    files["preamble.tex"] = env.get_template("preamble.tex").render(colors=tikz_colors())
    files["document.tex"] = env.get_template("document.tex").render(
        title=escape(suite.title), brief=suite.brief, cites=bool(suite.cited), version=__version__
    )
    files["references.bib"] = "\n".join(r.bibtex() for r in suite.cited.values())
    return files


@dataclass(frozen=True)
class LatexWriter:
    """Writes prose; sources outside `known` keys are named instead of cited."""

    known: frozenset[str]

    def family(self, suite: Suite, family: Family) -> str:
        """Return tasks of one spec in one section: the first, and what differs in the others."""
        head = family.head
        return text_environment().get_template("task.tex").render(
            self.parts(suite, head), title=escape(family.title), id=escape(head.id), capability=escape(head.capability),
            labels=[page.anchor for page in family.pages],
            others=[(tikz(each.scene), escape(each.caption)) for each in suite.others(head)],
            family=[{**self.parts(suite, other.page, other.base), "base": _base(other, head)} for other in family.others],
        )  # fmt: skip

    def parts(self, suite: Suite, page: Page, base: Page | None = None) -> dict[str, object]:
        """Return the parts of a page; of a variant, a figure and a description only if it has its own."""
        scene = suite.scenes.get(page.anchor)
        if base is not None and scene is not None and scene.shows(suite.scenes.get(base.anchor)):
            scene = None
        told = () if base is not None and page.description == base.description else page.description
        return {
            "name": escape(page.name), "summary": self.prose(page.summary), "make": escape(page.make),
            "description": list(map(self.block, told)),
            "beside": [self.section(s, page, BESIDE_ROOM) for s in page.sections if s.key in BESIDE],
            "below": [self.section(s, page, WHOLE_ROOM) for s in page.sections if s.key not in BESIDE],
            "figure": tikz(scene) if scene else "", "caption": escape(scene.caption) if scene else "",
        }  # fmt: skip

    def brief(self, suite: Suite, family: Family) -> str:
        """Return tasks of one spec in one section: the first, and what differs in the others."""
        head = family.head
        scene = suite.scenes.get(head.anchor)
        others = []
        for other in family.others:
            others.append({
                "name": escape(other.page.name), "base": _base(other, head), "summary": self.prose(other.page.summary),
                "sections": [*self.run_in(other.page)],
            })  # fmt: skip
        return text_environment().get_template("brief.tex").render(
            name=escape(head.name), title=escape(family.title), id=escape(head.id), summary=self.prose(head.summary),
            labels=[page.anchor for page in family.pages], cites=", ".join(map(self.cite, head.sources)),
            sections=[*self.run_in(head)], others=others,
            figure=tikz(scene) if scene else "", caption=escape(scene.caption) if scene else "",
        )  # fmt: skip

    def run_in(self, page: Page) -> Iterator[dict[str, object]]:
        """Yield sections as rows of a card: a short title, and the lines one after the other."""
        for section in page.sections:
            ends = [";"] * (len(section.lines) - 1) + ["."]
            text = " ".join(self.brief_line(*each, page) for each in zip(section.lines, ends, strict=False))
            yield {"title": escape(section.label), "text": text + self.table(section)}

    def section(self, section: Section, page: Page, room: float) -> dict[str, object]:
        lead, rest = section.laid_out([self.line(line, page, room) for line in section.lines])
        return {"title": escape(section.title), "lead": lead, "lines": rest, "table": self.table(section)}

    def table(self, section: Section) -> str:
        """Return a tabular, as wide as the line at the most, and its rows as paragraphs for lines that are too short for it."""
        cells = section.table
        if cells is None:
            return ""
        rows = [list(map(self.cell, row)) for row in cells.rows]
        heads = [rf"\taskspechead{{{escape(title)}}}" for title in cells.header]
        lines = rows
        if any(cells.header):
            lines = [heads, *rows]
        body = r" \\ ".join(" & ".join(row) for row in lines)
        stacked = "".join(rf"\taskspecrow{{{_stacked(cells.header, heads, row)}}}" for row in rows)
        return rf"\taskspectable{{{'l' * len(heads)}}}{{{body}}}{{{stacked}}}"

    def cell(self, content: p.Inlines) -> str:
        """Return prose in a line of its own, in which formulas are not broken."""
        texts = []
        for piece in content:
            texts.append(f"${latex(piece.math)}$" if isinstance(piece, p.Formula) else self.inline(piece, WHOLE_ROOM))
        return "".join(texts)

    def line(self, line: SectionLine, page: Page, room: float) -> str:
        text = self.prose(line.content, room)
        if line.verbatim is not None:
            rows = r"\\".join(escape(row).replace(" ", "~") for row in line.verbatim.splitlines())
            text += rf"\par{{\ttfamily {rows}}}"
        for setting, values in zip(page.settings, line.values, strict=False):
            if values:
                text += rf" \taskspecvalues{{{escape(setting.title)}}}{{{self.prose(values, room, ')')}}}"
        return text

    def brief_line(self, line: SectionLine, end: str, page: Page) -> str:
        """Return a line among others of its paragraph, with the sign that ends it; a map has none."""
        if line.verbatim is not None:
            return rf"{self.line(line, page, BRIEF_ROOM)}\par"
        asides = []
        for setting, values in zip(page.settings, line.values, strict=False):
            if values:
                asides.append((setting.title, values))
        told = [self.prose(line.content, BRIEF_ROOM, "" if asides else end)]
        for i, (title, values) in enumerate(asides):
            closing = ")" + (end if i == len(asides) - 1 else "")
            told.append(rf"\taskspecaside{{{escape(title)}}}{{{self.prose(values, BRIEF_ROOM, closing)}}}")
        return " ".join(told)

    def prose(self, content: p.Inlines, room: float = WHOLE_ROOM, end: str = "") -> str:
        """Return pieces of prose; the sign that ends them stays with a formula on a line of its own."""
        if end and content and isinstance(content[-1], p.Formula):
            return self.prose(content[:-1], room) + formula(content[-1].math, room, content[-1].display, end)
        return "".join(self.inline(piece, room) for piece in content) + end

    def inline(self, piece: p.Inline, room: float) -> str:
        match piece:
            case p.Text(text=text):
                return escape(text)
            case p.Formula(math=math, display=display):
                return formula(math, room, display)
            case p.CodeSpan(text=text):
                return rf"\texttt{{{escape(text)}}}"
            case p.Emph(inner=inner, strong=strong):
                return rf"\{'textbf' if strong else 'emph'}{{{self.prose(inner, room)}}}"
            case p.Link(address=address, inner=inner):
                safe = quote(address, safe=":/?=&.,+-@!*();~'")  # TeX's special characters as percent codes
                place = safe.replace("%", r"\%").replace("&", r"\&").replace("~", r"\~{}")
                return rf"\taskspeclink{{{place}}}{{{self.prose(inner, room)}}}"
            case p.Cite():
                return self.cite(piece)
            case p.Mark(holds=holds, text=text):
                return rf"\taskspec{'fails' if holds is False else 'holds'}{{{escape(text)}}}"
            case _:
                assert_never(piece)

    def cite(self, cite: p.Cite) -> str:
        where = ""
        if cite.where:
            where = f"[{{{escape(cite.where)}}}]"
        if cite.key in self.known:
            return rf"\cite{where}{{{cite.key}}}"
        return escape(f"{cite.key}, {cite.where}" if cite.where else cite.key)

    def block(self, block: p.Block) -> str:
        match block:
            case p.Paragraph(content=content):
                return self.prose(content)
            case p.Bullets(items=items, ordered=ordered):
                kind = "itemize"
                if ordered:
                    kind = "enumerate"
                inner = "\n".join(r"\item " + "\n\n".join(map(self.block, item)) for item in items)
                return f"\\begin{{{kind}}}\n{inner}\n\\end{{{kind}}}"
            case _:
                rows = r"\\".join(escape(row).replace(" ", "~") for row in block.text.splitlines())
                return rf"{{\ttfamily {rows}}}"


def _base(sibling: Sibling, head: Page) -> str:
    if sibling.base is head:
        return ""
    return escape(sibling.base.name)


def formula(math: m.Math, room: float, display: bool = False, end: str = "") -> str:
    """Return mathematics and a sign after it; what cannot break and may be too wide is put on a line of its own and fitted."""
    if display or (_is_rigid(math) and m.width(math) > room):
        return rf"\taskspecwide{{{latex(math)}{end}}}"
    style = ""
    for outer in m.parts(math):
        if isinstance(outer, m.Frac) and sum(isinstance(part, m.Frac) for part in m.parts(outer)) > 1:
            style = r"\displaystyle "
    return f"${style}{latex(math)}${end}"


def _is_rigid(math: m.Math) -> bool:
    for part in m.parts(math):
        match part:
            case m.Cases() | m.Matrix():
                return True
            case m.Fence(body=body) if m.is_tall(body):
                return True
            case m.Script(sub=sub) if sub is not None and m.width(sub) > LONG:
                return True
    return False


def _stacked(titles: Sequence[str], heads: Sequence[str], row: Sequence[str]) -> str:
    parts = []
    for title, head, cell in zip(titles, heads, row, strict=True):
        if cell and title:
            parts.append(f"{head} {cell}")
        elif cell:
            parts.append(cell)
    return r"\quad ".join(parts)
