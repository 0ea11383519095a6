"""Pages -> a static site: a gallery and a page a task, mathematics as MathML, no network.

The one script is the gallery's: it filters the tasks, and without it all of them are there.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from html import escape
from typing import Any, assert_never

from markupsafe import Markup

from taskspec.base.bibliography import Reference
from taskspec.base.display import ON_PAGES, visible
from taskspec.base.extras import need
from taskspec.figures import Scene, svg
from taskspec.pages.facts import lines as score_lines
from taskspec.pages.notation import notation
from taskspec.pages.page import Page
from taskspec.pages.prose import (  # fmt: skip
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
    is_safe,
)
from taskspec.pages.render.suite import Suite, html_environment
from taskspec.pages.sections import Section, SectionLine
from taskspec.printers import tree as m
from taskspec.printers.mathml import mathml
from taskspec.printers.text import plain

BREAK_AFTER = 34.0
"""Letters of a formula that is longer than a line on small screens."""
_SIGNS = frozenset("=+−<>≤≥∼∧∨∈≡,")


def site(suite: Suite, links: Mapping[str, str] | None = None) -> dict[str, str]:
    """Files by name: `index.html` and one for each task.

    Args:
        suite: the pages.
        links: names and addresses for the head of every page, such as the language reference.
    """
    env = html_environment()
    safe = {name: address for name, address in (links or {}).items() if is_safe(address)}
    common = {"suite": suite.title, "links": safe, "style": Markup(_style())}
    count = len(suite.pages)
    files = {
        "index.html": env.get_template("index.html").render(
            count=count, notation=HtmlWriter({}).prose(notation(suite.pages)), **_gallery(suite), **common
        )
    }
    for i, page in enumerate(suite.pages):
        before = suite.pages[i - 1] if i else None
        after = suite.pages[i + 1] if i + 1 < len(suite.pages) else None
        files[f"{page.anchor}.html"] = env.get_template("task.html").render(
            before=before, after=after, **_page(suite, page), **common
        )
    return {name: visible(text, ON_PAGES) for name, text in files.items()}


def gallery(suite: Suite) -> str:
    """The tasks as cards, with a field to search them and a button for each capability: a piece of HTML for a page of its own."""
    return visible(html_environment().get_template("cards.html").render(**_gallery(suite)), ON_PAGES)


def _gallery(suite: Suite) -> dict[str, Any]:
    cards = [_card(suite, page) for page in suite.pages if page.anchor in suite.folded]
    return {"cards": cards, "capabilities": sorted({card["page"].capability for card in cards} - {""})}


def gallery_style() -> str:
    """CSS of galleries and figures, for a page that says what `--ink`, `--paper` and the other colours are."""
    return html_environment().get_template("gallery.css").render()


def page_style() -> str:
    """CSS of pages that stand alone, with the colours on light and on dark paper."""
    return html_environment().get_template("style.css").render()


def _style() -> str:
    return page_style() + gallery_style() + _highlight_style()


def page_of(template: str, **values: Any) -> str:
    """A page that stands alone, in the style of the others: the templates are `report.html` and `findings.html`."""
    env = html_environment()
    style = Markup("".join(env.get_template(name).render() for name in ("style.css", "report.css")))
    return visible(env.get_template(template).render(style=style, **values), ON_PAGES)


def _page(suite: Suite, page: Page) -> dict[str, Any]:
    writer = HtmlWriter(suite.cited)
    scene = suite.scenes.get(page.anchor)
    return {
        "page": page,
        "summary": writer.prose(page.summary),
        "description": [writer.block(b) for b in page.description],
        "sections": [writer.section(s, [each.title for each in page.settings]) for s in page.sections],
        "figure": Markup(svg(scene, css=True)) if scene else None,
        "caption": scene.caption if scene else "",
        "others": [(each.caption, Markup(svg(each.scene, css=True))) for each in suite.others(page)],
        "source": _highlighted(page.source_text),
    }


def _card(suite: Suite, page: Page) -> dict[str, Any]:
    """A task in the index: its line of facts and its thumbnail."""
    scene: Scene | None = suite.scenes.get(page.anchor)
    writer = HtmlWriter(suite.cited)
    spaces = [(name, section) for name, key in (("states", "state"), ("actions", "actions"), ("horizon", "horizon"))
              if (section := page.section(key)) is not None]  # fmt: skip
    facts = [(name, writer.prose(section.lines[0].content[:1])) for name, section in spaces]
    known = replace(page.facts, unknown=())
    found = [writer.prose(line) for line in score_lines(page.task, known)]
    names = ", ".join(f"{p.name} = {p.value}" for p in page.task.parameters)
    return {
        "page": page, "summary": writer.prose(page.summary), "facts": facts, "scores": found, "parameters": names,
        "figure": Markup(svg(scene, css=True)) if scene else None, "variants": suite.folded[page.anchor],
    }  # fmt: skip


# ---------- the source of a task


@lru_cache(maxsize=32)
def _highlighted(text: str) -> Markup:
    """YAML with its parts marked by class; the pages of variants have one source."""
    pygments, lexers, formatters = (need(f"pygments{x}", "docs") for x in ("", ".lexers.data", ".formatters"))
    formatter = formatters.HtmlFormatter(nowrap=True, classprefix="y-")
    return Markup(pygments.highlight(text, lexers.YamlLexer(), formatter))


_KINDS = {"nt": "link", "c1": "muted", "m": "number", "kc": "number", "p": "muted"}


def _highlight_style() -> str:
    return "".join(f".y-{short}{{color:var(--{color})}}\n" for short, color in _KINDS.items())


# ---------- sections, prose and mathematics


def article(title: str, summary: Inlines, description: Iterable[Block], sections: Iterable[Section]) -> str:
    """A page as one piece of HTML, for notebooks: no style, figure or references."""
    writer = HtmlWriter({})
    parts = [Markup("<h2>{}</h2><p>{}</p>").format(title, writer.prose(summary)), *map(writer.block, description)]
    for section in sections:
        found = writer.section(section)
        lines = [found["lead"], *found["lines"]] if found["lead"] else found["lines"]
        rows = [_row("th", section.table.header), *(_row("td", row) for row in found["rows"])] if section.table else []
        parts.append(Markup("<h3>{}</h3>").format(section.title))
        parts += [Markup("<p>{}</p>").format(line) for line in lines]
        parts += [Markup("<table>{}</table>").format(Markup("").join(rows))] if rows else []
    return visible(Markup("<article>{}</article>").format(Markup("").join(parts)), ON_PAGES)


def _row(tag: str, cells: Iterable[str]) -> Markup:
    return Markup("<tr>{}</tr>").format(Markup("").join(Markup(f"<{tag}>{{}}</{tag}>").format(c) for c in cells))


@dataclass(frozen=True)
class HtmlWriter:
    """Writes prose; sources that are known are cited by author and year."""

    references: Mapping[str, Reference]

    def section(self, section: Section, settings: Sequence[str] = ()) -> dict[str, Any]:
        lines = [self.line(line, settings) for line in section.lines]
        lead, rest = (lines[0], lines[1:]) if section.lead else (None, lines)
        rows = [[self.prose(cell) for cell in row] for row in section.table.rows] if section.table else []
        header = section.table.header if section.table else ()
        return {"key": section.key, "title": section.title, "lead": lead, "lines": rest, "header": header, "rows": rows}

    def line(self, line: SectionLine, settings: Sequence[str]) -> Markup:
        """A line with the values that it has at each setting of the parameters; `settings` are their titles."""
        out = self.prose(line.content)
        if line.verbatim is not None:
            out += Markup('<pre class="map">{}</pre>').format(line.verbatim)
        for title, values in zip(settings, line.values, strict=False):
            if values:
                out += Markup('<span class="values">{}: {}</span>').format(title, self.prose(values))
        return out

    def prose(self, content: Inlines) -> Markup:
        return Markup("").join(self.inline(piece) for piece in content)

    def inline(self, piece: Inline) -> Markup:
        match piece:
            case Text(text=text):
                return Markup(escape(text))
            case Formula(math=math, display=display):
                return formula(math, display)
            case CodeSpan(text=text):
                return Markup("<code>{}</code>").format(text)
            case Emph(inner=inner, strong=strong):
                tag = "strong" if strong else "em"
                return Markup(f"<{tag}>{{}}</{tag}>").format(self.prose(inner))
            case Link(address=address, inner=inner):
                return Markup('<a href="{}" rel="noreferrer">{}</a>').format(address, self.prose(inner))
            case Cite():
                return self.cite(piece)
            case Mark(holds=holds, text=text):
                sign, kind = ("?", "open") if holds is None else ("✓", "holds") if holds else ("✗", "fails")
                return Markup('<span class="mark {}"><span aria-hidden="true">{}</span> {}</span>').format(
                    kind, sign, text
                )
            case _:
                assert_never(piece)

    def cite(self, cite: Cite) -> Markup:
        found = self.references.get(cite.key)
        where = Markup(", {}").format(cite.where) if cite.where else Markup("")
        if found is None:
            return Markup("{}").format(cite.key) + where
        title = Markup("{}").format(found.plain("title"))
        address = found.plain("url")
        if address and is_safe(address):
            title = Markup('<a href="{}" rel="noreferrer">{}</a>').format(address, title)
        venue = f", {found.venue}" if found.venue else ""
        head = Markup("{} ({}). ").format(found.authors, found.plain("year"))
        return head + title + Markup("{}").format(venue) + where

    def block(self, block: Block) -> Markup:
        match block:
            case Paragraph(content=content):
                return Markup("<p>{}</p>").format(self.prose(content))
            case Bullets(items=items, ordered=ordered):
                tag = "ol" if ordered else "ul"
                inner = Markup("").join(
                    Markup("<li>{}</li>").format(Markup("").join(map(self.block, i))) for i in items
                )
                return Markup(f"<{tag}>{{}}</{tag}>").format(inner)
            case _:
                return Markup("<pre>{}</pre>").format(block.text)


def formula(math: m.Math, display: bool = False) -> Markup:
    """Mathematics in a line; a long formula in pieces, so that the browser can break the line between them."""
    if display:
        return Markup(f'<span class="display">{mathml(math, block=True)}</span>')
    pieces = _pieces(math) if m.width(math) > BREAK_AFTER else [math]
    if len(pieces) == 1:
        kind = "rigid" if m.width(math) > BREAK_AFTER else "formula"
        return Markup(f'<span class="{kind}">{mathml(math)}</span>')
    alt = escape(plain(math), quote=True)
    inner = " ".join(_infix(mathml(piece)) for piece in pieces)
    return Markup(f'<span class="formula long" role="math" aria-label="{alt}">{inner}</span>')


def _pieces(math: m.Math) -> list[m.Math]:
    """A row cut before its signs and after its commas."""
    out: list[list[m.Math]] = [[]]
    for item in _flat(math):
        if isinstance(item, m.Sym) and item.text in _SIGNS and item.text != "," and len(out[-1]) > 0:
            out.append([])
        out[-1].append(item)
        if item == m.Sym(",") or (isinstance(item, m.Gap) and item.width == "wide"):
            out.append([])
    return [m.row(*items) for items in out if items]


def _flat(math: m.Math) -> list[m.Math]:
    """The items of a row, with those of rows inside it."""
    return [x for item in math.items for x in _flat(item)] if isinstance(math, m.Row) else [math]


def _infix(element: str) -> str:
    """A piece that starts with a sign keeps the space around it."""
    return re.sub(r"^(<math[^>]*><mrow><mo)>", r'\1 form="infix">', element)
