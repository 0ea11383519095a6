"""Prose as data: inline pieces and blocks, and the reader of the Markdown with `$mathematics$` that specs are written in.

Markdown is parsed by markdown-it (CommonMark, no raw HTML); its tokens become the closed set of pieces below, which
every renderer escapes in its own way. Links keep only addresses that are safe to follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from taskspec.show.printers import tree as m
from taskspec.show.printers.tex import read as read_tex

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

_SAFE = frozenset({"http", "https", "mailto", ""})


@dataclass(frozen=True, slots=True)
class Text:
    text: str


@dataclass(frozen=True, slots=True)
class Formula:
    """Mathematics in a line, or on a line of its own; where there is room for a tooltip, `short` is shown in its place."""

    math: m.Math
    display: bool = False
    short: m.Num | None = None


@dataclass(frozen=True, slots=True)
class CodeSpan:
    text: str


@dataclass(frozen=True, slots=True)
class Emph:
    """Stressed words; `strong` ones are bold."""

    inner: tuple[Inline, ...]
    strong: bool = False


@dataclass(frozen=True, slots=True)
class Link:
    address: str
    inner: tuple[Inline, ...]


@dataclass(frozen=True, slots=True)
class Cite:
    """A reference to a source of the bibliography, and where in it."""

    key: str
    where: str | None = None


@dataclass(frozen=True, slots=True)
class Mark:
    """A mark of a verdict: holds or not, None where it was not decided."""

    holds: bool | None
    text: str


Inline = Text | Formula | CodeSpan | Emph | Link | Cite | Mark
Inlines = tuple[Inline, ...]


@dataclass(frozen=True, slots=True)
class CellTable:
    header: tuple[str, ...]
    rows: tuple[tuple[Inlines, ...], ...]


@dataclass(frozen=True, slots=True)
class Paragraph:
    content: Inlines


@dataclass(frozen=True, slots=True)
class Bullets:
    items: tuple[tuple[Block, ...], ...]
    ordered: bool = False


@dataclass(frozen=True, slots=True)
class Verbatim:
    text: str


Block = Paragraph | Bullets | Verbatim
_MINUS = re.compile(r"(?<![^\s([{,;:=])-(?=\d)")  # the sign of a negative number in prose


@lru_cache(maxsize=1)
def _parser() -> MarkdownIt:
    from markdown_it import MarkdownIt
    from mdit_py_plugins.dollarmath import dollarmath_plugin

    parser = MarkdownIt("commonmark", {"html": False}).disable(["image", "html_inline", "html_block"])
    return parser.use(dollarmath_plugin, allow_digits=False, double_inline=True)


def blocks(text: str | None) -> tuple[Block, ...]:
    if not text:
        return ()
    tokens = iter(_parser().parse(text))
    return tuple(_blocks(tokens, None))


def inlines(text: str | None) -> Inlines:
    """Return the inline pieces of a Markdown text of one line; what would start a block is text like any other."""
    if not text:
        return ()
    (token,) = _parser().parseInline(" ".join(text.split()))
    return _merge(_inlines(iter(token.children or ()), None))


def _blocks(tokens: Iterator[Token], close: str | None) -> Iterator[Block]:
    for token in tokens:
        if token.type == close:
            return
        match token.type:
            case "paragraph_open" | "heading_open":
                content = _merge(_inlines(iter(next(tokens).children or ()), None))
                next(tokens)
                if token.type == "heading_open":
                    content = (Emph(content, strong=True),)
                yield Paragraph(content)
            case "bullet_list_open" | "ordered_list_open":
                close_list = token.type.replace("open", "close")
                items = []
                while next(tokens).type != close_list:  # each item begins with a token of its own
                    items.append(tuple(_blocks(tokens, "list_item_close")))
                yield Bullets(tuple(items), ordered=token.type == "ordered_list_open")
            case "fence" | "code_block":
                yield Verbatim(token.content.rstrip("\n"))
            case "math_block" | "math_block_label":
                yield Paragraph((Formula(read_tex(token.content), display=True),))
            case "blockquote_open":
                yield from _blocks(tokens, "blockquote_close")
            case _:
                continue


def _inlines(tokens: Iterator[Token], close: str | None) -> Iterator[Inline]:
    for token in tokens:
        if token.type == close:
            return
        match token.type:
            case "text" | "text_special":
                yield Text(_MINUS.sub("−", token.content))
            case "softbreak" | "hardbreak":
                yield Text(" ")
            case "code_inline":
                yield CodeSpan(token.content)
            case "math_inline" | "math_inline_double":
                yield Formula(read_tex(token.content), display=token.type.endswith("double"))
            case "em_open" | "strong_open":
                inner = _merge(_inlines(tokens, token.type.replace("open", "close")))
                yield Emph(inner, strong=token.type == "strong_open")
            case "link_open":
                inner = _merge(_inlines(tokens, "link_close"))
                address = str(token.attrGet("href") or "")
                if is_safe(address):
                    yield Link(address, inner)
                else:
                    yield from inner
            case _:
                yield Text(token.content)


def is_safe(address: str) -> bool:
    """Return whether an address is a web page, a mail address or a place nearby, not a script."""
    try:
        scheme = urlsplit(address).scheme
    except ValueError:
        return False
    return scheme.lower() in _SAFE and ":" not in address.split("/")[0].replace(f"{scheme}:", "", 1)


def _merge(pieces: Iterator[Inline]) -> Inlines:
    out: list[Inline] = []
    for piece in pieces:
        if isinstance(piece, Text) and out and isinstance(out[-1], Text):
            out[-1] = Text(out[-1].text + piece.text)
        else:
            out.append(piece)
    return tuple(out)


def separated(items: Sequence[Inlines], mark: str = ", ", last: str | None = None) -> Inlines:
    marks = [mark] * (len(items) - 1)
    if last is not None:
        marks[-1:] = [last]
    out: list[Inline] = []
    for i, item in enumerate(items):
        if i:
            out.append(Text(marks[i - 1]))
        out += item
    return tuple(out)


def followed(content: Inlines, mark: str, doc: str | None) -> Inlines:
    """Return prose and after a mark what an author says of it, if that is anything."""
    said = inlines(doc)
    return (*content, Text(mark), *said) if said else content


def listing(items: Sequence[Inlines]) -> Inlines:
    """Return items as a sentence lists them: a, b and c."""
    return _merge(iter(separated(items, last=" and ")))
