"""Sections, prose and mathematics as HTML."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import chain
from typing import Any, assert_never

from markupsafe import Markup

from taskspec.base.display import ON_PAGES, visible
from taskspec.show.bibliography import Reference
from taskspec.show.pages import prose as p
from taskspec.show.pages.render import html_environment
from taskspec.show.pages.sections import Section, SectionLine
from taskspec.show.printers import tree as m
from taskspec.show.printers.markup import mathml
from taskspec.show.printers.text import plain

BREAK_AFTER = 34.0  # letters of a formula that is longer than a line on small screens
FITS = 24.0  # letters of a formula that small screens have room for
SPLIT_AFTER = 44.0  # letters of a formula that is decided case by case, and wider than small screens
_SIGNS = frozenset("=+−<>≤≥∼∧∨∈≡,")
_INFIX = re.compile(r"^(<math[^>]*><mrow><mo)>")
"""Where a piece of a formula starts with a sign, which keeps the space around it."""
_MARKS = {None: ("open", "?"), True: ("holds", "✓"), False: ("fails", "✗")}
"""The class and the sign of marks."""


@dataclass(frozen=True)
class HtmlWriter:
    """Writes prose; sources that are known are cited by author and year.

    `states` are codes of states by their symbols: lines of transitions from them are marked, so that a figure can point at them.
    """

    references: Mapping[str, Reference]
    states: Mapping[str, int] = field(default_factory=dict)

    def words(
        self,
        summary: p.Inlines,
        description: Iterable[p.Block],
        sections: Iterable[Section],
        settings: Sequence[str] = (),
    ) -> dict[str, Any]:
        """Return what templates show of a page."""
        return {
            "summary": self.prose(summary),
            "description": list(map(self.block, description)),
            "sections": [self.section(section, settings) for section in sections],
        }

    def section(self, section: Section, settings: Sequence[str] = ()) -> dict[str, Any]:
        lead, rest = section.laid_out([self.line(line, settings) for line in section.lines])
        table = section.table or p.CellTable((), ())
        rows = []
        for row in table.rows:
            rows.append(list(map(self.prose, row)))
        return {
            "key": section.key, "title": section.title, "lead": lead, "lines": rest, "header": table.header, "rows": rows,
        }  # fmt: skip

    def line(self, line: SectionLine, settings: Sequence[str]) -> Markup:
        """Return a line with the values that it has at each setting of the parameters; `settings` are their titles."""
        out = self.prose(line.content)
        if line.verbatim is not None:
            out += Markup('<pre class="map">{}</pre>').format(line.verbatim)
        for title, values in zip(settings, line.values, strict=False):
            if values:
                out += Markup('<span class="values">{}: {}</span>').format(title, self.prose(values))
        state = self.states.get(origin_of(line.content))
        if state is not None:
            return Markup('<span data-of="{}">{}</span>').format(state, out)
        return out

    def prose(self, content: p.Inlines) -> Markup:
        return Markup("").join(map(self.inline, content))

    def inline(self, piece: p.Inline) -> Markup:
        match piece:
            case p.Text(text=text):
                return Markup(escape(text))
            case p.Formula(math=math, display=display, short=None):
                return formula(math, display)
            case p.Formula(math=math, short=short):
                return Markup('<span class="exact" title="{}">{}</span>').format(plain(math), formula(short or math))
            case p.CodeSpan(text=text):
                return Markup("<code>{}</code>").format(text)
            case p.Emph(inner=inner, strong=strong):
                tag = "strong" if strong else "em"
                return Markup(f"<{tag}>{{}}</{tag}>").format(self.prose(inner))
            case p.Link(address=address, inner=inner):
                return Markup('<a href="{}" rel="noreferrer">{}</a>').format(address, self.prose(inner))
            case p.Cite():
                return self.cite(piece)
            case p.Mark(holds=holds, text=text):
                whole = '<span class="mark {}"><span aria-hidden="true">{}</span> {}</span>'
                return Markup(whole).format(*_MARKS[holds], text)
            case _:
                assert_never(piece)

    def cite(self, cite: p.Cite) -> Markup:
        reference = self.references.get(cite.key)
        if reference is None:
            return Markup(", ").join(filter(None, (cite.key, cite.where)))
        title = Markup("{}").format(reference.plain("title"))
        address = reference.plain("url")
        if address and p.is_safe(address):
            title = Markup('<a href="{}" rel="noreferrer">{}</a>').format(address, title)
        head = Markup("{} ({}). ").format(reference.authors, reference.plain("year"))
        return head + Markup(", ").join(filter(None, (title, reference.venue, cite.where)))

    def block(self, block: p.Block) -> Markup:
        match block:
            case p.Paragraph(content=content):
                return Markup("<p>{}</p>").format(self.prose(content))
            case p.Bullets(items=items, ordered=ordered):
                tag = "ol" if ordered else "ul"
                inner = Markup("")
                for item in items:
                    inner += Markup("<li>{}</li>").format(Markup("").join(map(self.block, item)))
                return Markup(f"<{tag}>{{}}</{tag}>").format(inner)
            case _:
                return Markup("<pre>{}</pre>").format(block.text)


def article(
    heading: str,
    summary: p.Inlines,
    description: Iterable[p.Block],
    sections: Iterable[Section],
    writer: HtmlWriter | None = None,
) -> str:
    """Return a page without style and figure, for notebooks and the studio; without references unless a writer knows some."""
    words = (writer or HtmlWriter({})).words(summary, description, sections)
    return visible(html_environment().get_template("article.html").render(heading=heading, **words), ON_PAGES)


def formula(math: m.Math, display: bool = False) -> Markup:
    """Return mathematics in a line; a long formula in pieces, so that the browser can break the line between them."""
    if display:
        return Markup(f'<span class="display">{mathml(math, block=True)}</span>')
    match _flat(math):
        case [*left, m.Cases() as cases] if m.width(math) > SPLIT_AFTER:
            whole = '<span class="split" role="math" aria-label="{}">{}</span>'
            return Markup(whole).format(plain(math), _by_cases(left, cases))
    pieces = [math]
    if m.width(math) > BREAK_AFTER:
        pieces = _pieces(_flat(math))
    if max(map(m.width, pieces)) > BREAK_AFTER:
        pieces = _pieces(_flat(math, inside=True))
    if len(pieces) == 1:
        kind = "rigid" if m.width(math) > BREAK_AFTER else "formula"
        return Markup(f'<span class="{kind}"{_letters(math)}>{mathml(math)}</span>')
    written = []
    for piece in pieces:
        part = _INFIX.sub(r'\1 form="infix">', mathml(piece))
        letters = _letters(piece)
        if letters:
            part = f"<span{letters}>{part}</span>"
        written.append(part)
    label = escape(plain(math), quote=True)
    return Markup(f'<span class="formula long" role="math" aria-label="{label}">{" ".join(written)}</span>')


def _by_cases(left: list[m.Math], cases: m.Cases) -> Markup:
    before = formula(m.row(*left)) if left else Markup("")
    cells = Markup("")
    for cell in chain.from_iterable(cases.rows):
        cells += Markup("<span>{}</span>").format(formula(cell))
    return before + Markup('<span class="rows">{}</span>').format(cells)


def _letters(math: m.Math) -> str:
    letters = m.width(math)
    if letters > FITS:
        return f' style="--letters: {letters:.0f}"'
    return ""


def origin_of(content: p.Inlines) -> str:
    """Return the symbol of the state that a line of transitions starts from; "" for other lines."""
    match content:
        case (p.Formula(math=m.Row(items=(origin, m.Arrow(), *_))), *_):
            return plain(origin)
        case _:
            return ""


def _pieces(items: Iterable[m.Math]) -> list[m.Math]:
    out: list[list[m.Math]] = [[]]
    for item in items:
        if isinstance(item, m.Sym) and item.text in _SIGNS and item.text != "," and len(out[-1]) > 0:
            out.append([])
        out[-1].append(item)
        if item == m.Sym(",") or (isinstance(item, m.Gap) and item.width == "wide"):
            out.append([])
    return [m.row(*items) for items in filter(None, out)]


def _flat(math: m.Math, inside: bool = False) -> list[m.Math]:
    """Return the items of rows in rows; with `inside` also those within brackets that are as high as a line."""
    match math:
        case m.Row(items=items):
            flat = []
            for item in items:
                flat += _flat(item, inside)
            return flat
        case m.Fence(left=left, body=body, right=right) if inside and not m.is_tall(body):
            return [m.Sym(left), *_flat(body, inside), m.Sym(right)]
        case _:
            return [math]
