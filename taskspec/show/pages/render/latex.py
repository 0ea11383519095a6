"""Pages -> LaTeX: one file a task, `appendix.tex` to include, a document of its own, and the bibliography."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import assert_never
from urllib.parse import quote

from taskspec.base import __version__
from taskspec.show.figures import Scene, tikz
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
    write = writer.brief if suite.brief else writer.family
    files = {}
    names = []
    for family in families(suite.pages):
        names.append(family.head.anchor)
        files[f"{family.head.anchor}.tex"] = write(suite, family)
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
        others = []
        for other in family.others:
            others.append({**self.parts(suite, other.page, other.base), "base": _base(other, head)})
        return text_environment().get_template("task.tex").render(
            self.parts(suite, head), title=escape(family.title), id=escape(head.id), capability=escape(head.capability),
            labels=family.anchors, family=others,
            others=[(tikz(each.scene), escape(each.caption)) for each in suite.others(head)],
        )  # fmt: skip

    def parts(self, suite: Suite, page: Page, base: Page | None = None) -> dict[str, object]:
        """Return the parts of a page; of a variant, a figure and a description only if it has its own."""
        scene = suite.scenes.get(page.anchor)
        description = page.description
        if base is not None:
            if scene is not None and scene.shows(suite.scenes.get(base.anchor)):
                scene = None
            if description == base.description:
                description = ()
        beside = []
        below = []
        for section in page.sections:
            if section.key in BESIDE:
                beside.append(self.section(section, page, BESIDE_ROOM))
            else:
                below.append(self.section(section, page, WHOLE_ROOM))
        return {
            "name": escape(page.name), "summary": self.prose(page.summary), "make": escape(page.make),
            "description": list(map(self.block, description)), "beside": beside, "below": below, **_pictured(scene),
        }  # fmt: skip

    def brief(self, suite: Suite, family: Family) -> str:
        """Return tasks of one spec in one section: the first, and what differs in the others."""
        head = family.head
        others = []
        for other in family.others:
            others.append({
                "name": escape(other.page.name), "base": _base(other, head), "summary": self.prose(other.page.summary),
                "sections": [*self.run_in(other.page)],
            })  # fmt: skip
        return text_environment().get_template("brief.tex").render(
            name=escape(head.name), title=escape(family.title), id=escape(head.id), summary=self.prose(head.summary),
            labels=family.anchors, cites=", ".join(map(self.cite, head.sources)),
            sections=[*self.run_in(head)], others=others, **_pictured(suite.scenes.get(head.anchor)),
        )  # fmt: skip

    def run_in(self, page: Page) -> Iterator[dict[str, object]]:
        """Yield sections as rows of a card: a short title, and the lines one after the other."""
        for section in page.sections:
            ends = [";"] * (len(section.lines) - 1) + ["."]
            texts = []
            for line, end in zip(section.lines, ends, strict=False):
                texts.append(self.brief_line(line, end, page))
            yield {"title": escape(section.label), "text": " ".join(texts) + self.table(section)}

    def section(self, section: Section, page: Page, room: float) -> dict[str, object]:
        lead, rest = section.laid_out([self.line(line, page, room) for line in section.lines])
        return {"title": escape(section.title), "lead": lead, "lines": rest, "table": self.table(section)}

    def table(self, section: Section) -> str:
        """Return a tabular, as wide as the line at the most, and its rows as paragraphs for lines that are too short for it."""
        cells = section.table
        if cells is None:
            return ""
        heads = [rf"\taskspechead{{{escape(title)}}}" for title in cells.header]
        lines = []
        if any(cells.header):
            lines.append(" & ".join(heads))
        stacked = ""
        for row in cells.rows:
            texts = list(map(self.cell, row))
            lines.append(" & ".join(texts))
            stacked += rf"\taskspecrow{{{_stacked(cells.header, heads, texts)}}}"
        body = r" \\ ".join(lines)
        return rf"\taskspectable{{{'l' * len(heads)}}}{{{body}}}{{{stacked}}}"

    def cell(self, content: p.Inlines) -> str:
        """Return prose in a line of its own, in which formulas are not broken."""
        text = ""
        for piece in content:
            if isinstance(piece, p.Formula):
                text += f"${latex(piece.math)}$"
            else:
                text += self.inline(piece, WHOLE_ROOM)
        return text

    def line(self, line: SectionLine, page: Page, room: float) -> str:
        text = self.prose(line.content, room)
        if line.verbatim is not None:
            text += rf"\par{_verbatim(line.verbatim)}"
        for setting, values in zip(page.settings, line.values, strict=False):
            if values:
                text += rf" \taskspecvalues{{{escape(setting.title)}}}{{{self.prose(values, room, ')')}}}"
        return text

    def brief_line(self, line: SectionLine, end: str, page: Page) -> str:
        """Return a line among others of its paragraph, with the sign that ends it; a map has none."""
        if line.verbatim is not None:
            return rf"{self.line(line, page, BRIEF_ROOM)}\par"
        backwards = []
        for setting, values in reversed(list(zip(page.settings, line.values, strict=False))):
            if values:
                text = self.prose(values, BRIEF_ROOM, f"){end}")
                backwards.append(rf"\taskspecaside{{{escape(setting.title)}}}{{{text}}}")
                end = ""
        backwards.append(self.prose(line.content, BRIEF_ROOM, end))
        return " ".join(reversed(backwards))

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
                command = "textbf" if strong else "emph"
                return rf"\{command}{{{self.prose(inner, room)}}}"
            case p.Link(address=address, inner=inner):
                safe = quote(address, safe=":/?=&.,+-@!*();~'")  # TeX's special characters as percent codes
                place = safe.replace("%", r"\%").replace("&", r"\&").replace("~", r"\~{}")
                return rf"\taskspeclink{{{place}}}{{{self.prose(inner, room)}}}"
            case p.Cite():
                return self.cite(piece)
            case p.Mark(holds=False, text=text):
                return rf"\taskspecfails{{{escape(text)}}}"
            case p.Mark(text=text):
                return rf"\taskspecholds{{{escape(text)}}}"
            case _:
                assert_never(piece)

    def cite(self, cite: p.Cite) -> str:
        if cite.key not in self.known:
            return escape(", ".join(filter(None, (cite.key, cite.where))))
        where = ""
        if cite.where:
            where = f"[{{{escape(cite.where)}}}]"
        return rf"\cite{where}{{{cite.key}}}"

    def block(self, block: p.Block) -> str:
        match block:
            case p.Paragraph(content=content):
                return self.prose(content)
            case p.Bullets(items=items, ordered=ordered):
                kind = "enumerate" if ordered else "itemize"
                lines = [rf"\begin{{{kind}}}"]
                for item in items:
                    lines.append(r"\item " + "\n\n".join(map(self.block, item)))
                return "\n".join((*lines, rf"\end{{{kind}}}"))
            case _:
                return _verbatim(block.text)


def _verbatim(text: str) -> str:
    rows = r"\\".join(escape(row).replace(" ", "~") for row in text.splitlines())
    return rf"{{\ttfamily {rows}}}"


def _pictured(scene: Scene | None) -> dict[str, str]:
    if scene is None:
        return {"figure": "", "caption": ""}
    return {"figure": tikz(scene), "caption": escape(scene.caption)}


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
