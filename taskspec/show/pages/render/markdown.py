"""Pages -> Markdown for a repository's documentation: mathematics between dollars, figures as files beside."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import assert_never
from urllib.parse import quote

from taskspec.base.display import ON_PAGES, visible
from taskspec.show.pages import prose as p
from taskspec.show.pages.page import Page
from taskspec.show.pages.render import text_environment
from taskspec.show.pages.render.suite import Suite
from taskspec.show.pages.sections import Section, SectionLine
from taskspec.show.printers import tree as m
from taskspec.show.printers.markup import latex

_SPECIAL = re.compile(r"([\\`*_{}\[\]()#+!|~$>-])")
_SPECIAL_INSIDE = re.compile(r"([\\`*_{}\[\]|~$])")  # those that mean something inside a line
_NUMBERED = re.compile(r"^(\d+)([.)])")
# Readers that take backslash escapes before mathematics would spoil these.
_SPELLED = ((r"\taskspecone ", r"\mathbf{1}"), (r"\{", r"\lbrace "), (r"\}", r"\rbrace "), (r"\\", r"\cr "),
            (r"\,", r"\thinspace "), (r"\%", r"\text{ per cent}"),
            (r"\text{\#}", r"\text{number of }"), (r"\#", r"\text{number of }"))  # fmt: skip


def markdown(suite: Suite) -> dict[str, str]:
    """Return files by name: `index.md` and one for each task."""
    env = text_environment()
    writer = MarkdownWriter(suite)
    files = {}
    rows = []
    for page in suite.pages:
        files[f"{page.anchor}.md"] = visible(writer.page(page), ON_PAGES)
        rows.append((escape(page.name), page.anchor, escape(page.capability), writer.prose(page.summary)))
    index = env.get_template("index.md").render(title=escape(suite.title), rows=rows)
    files["index.md"] = visible(index, ON_PAGES)
    return files


def escape(text: str) -> str:
    """Return text for Markdown: no markup, no HTML, on one line."""
    text = escape_entities(text)
    return _NUMBERED.sub(
        r"\1\\\2", _SPECIAL.sub(r"\\\1", text).replace(r"\(", "(").replace(r"\)", ")").replace(r"\-", "-")
    )


@dataclass(frozen=True)
class MarkdownWriter:
    suite: Suite

    def page(self, page: Page) -> str:
        scene = self.suite.scenes.get(page.anchor)
        picture = {"figure": "", "alt": "", "notes": ""}
        if scene is not None:
            notes = escape(" ".join(scene.notes))
            picture = {"figure": f"figures/{page.anchor}.svg", "alt": escape(scene.alt), "notes": notes}
        others = []
        for other in self.suite.others(page):
            others.append((f"figures/{other.anchor}.svg", escape(other.scene.alt), escape(other.caption)))
        return text_environment().get_template("task.md").render(
            name=escape(page.name), title=escape(page.title), summary=self.prose(page.summary), make=page.make,
            description=list(map(self.block, page.description)), others=others,
            sections=[self.section(section, page) for section in page.sections], **picture,
        )  # fmt: skip

    def section(self, section: Section, page: Page) -> dict[str, object]:
        lead, rest = section.laid_out([self.line(line, page) for line in section.lines])
        return {"title": escape(section.title), "lead": lead, "lines": rest, "table": self.table(section)}

    def table(self, section: Section) -> list[list[str]]:
        """Return rows of cells, the heading first."""
        cells = section.table
        if cells is None:
            return []
        rows = [list(map(escape, cells.header))]
        for row in cells.rows:
            rows.append(list(map(self.cell, row)))
        return rows

    def cell(self, content: p.Inlines) -> str:
        """Return prose without the bars that would end a cell."""
        spelled = {p.Formula: r"\vert ", p.CodeSpan: r"\|"}
        text = ""
        for piece in content:
            text += self.inline(piece).replace("|", spelled.get(type(piece), "|"))
        return text

    def line(self, line: SectionLine, page: Page) -> str:
        text = self.prose(line.content)
        if line.verbatim is not None:
            text += _drawn(line.verbatim)
        for setting, values in zip(page.settings, line.values, strict=False):
            if values:
                text += f" ({escape(setting.title)}: {self.prose(values)})"
        return text

    def prose(self, content: p.Inlines) -> str:
        texts = list(map(self.inline, content))
        for i, piece in enumerate(content[1:]):
            if isinstance(piece, p.Link) and texts[i].endswith("!"):  # a page loads no images from elsewhere
                texts[i] = texts[i][:-1] + r"\!"
        return "".join(texts)

    def inline(self, piece: p.Inline) -> str:
        match piece:
            case p.Text(text=text):
                return _SPECIAL_INSIDE.sub(r"\\\1", escape_entities(text))
            case p.Formula(math=math):
                return formula(math)
            case p.CodeSpan(text=text):
                return _code(text)
            case p.Emph(inner=inner, strong=strong):
                mark = "*" * (1 + strong)
                return f"{mark}{self.prose(inner)}{mark}"
            case p.Link(address=address, inner=inner):
                return f"[{self.prose(inner)}](<{quote(address, safe=':/?=&.,+-@!*;~%#')}>)"
            case p.Cite():
                return self.cite(piece)
            case p.Mark(holds=holds, text=text):
                sign = {None: "", True: "✓ ", False: "✗ "}[holds]
                return f"({sign}{escape(text)})"
            case _:
                assert_never(piece)

    def cite(self, cite: p.Cite) -> str:
        number = self.suite.cited.get(cite.key)
        where = f", {escape(cite.where)}" if cite.where else ""
        if number is None:
            return escape(cite.key) + where
        return f"{escape(number.authors)} ({escape(number.plain('year'))}). {escape(number.plain('title'))}{where}"

    def block(self, block: p.Block) -> str:
        match block:
            case p.Paragraph(content=content):
                return self.prose(content)
            case p.Bullets(items=items):
                lines = []
                for item in items:
                    lines.append("- " + " ".join(map(self.block, item)))
                return "\n".join(lines)
            case _:
                return "\n".join(f"    {row}" for row in block.text.splitlines())


def escape_entities(text: str) -> str:
    return " ".join(text.split("\n")).replace("&", "&amp;").replace("<", "&lt;")


def _drawn(text: str) -> str:
    """Return lines as a block of code within the inner list of a page."""
    fence = "`" * max(3, _longest_ticks(text) + 1)
    return "\n    ".join(("\n", f"{fence}text", *text.splitlines(), fence))


def _code(text: str) -> str:
    ticks = "`" * (_longest_ticks(text) + 1)
    pad = ""
    if text.startswith("`") or text.endswith("`"):
        pad = " "
    return f"{ticks}{pad}{text}{pad}{ticks}"


def _longest_ticks(text: str) -> int:
    return max(map(len, re.findall("`+", text)), default=0)


def formula(math: m.Math) -> str:
    text = latex(math)
    for written, spelled in _SPELLED:
        text = text.replace(written, spelled)
    return f"${re.sub(r' +', ' ', text.replace(chr(92) + 'allowbreak', '')).strip()}$"
