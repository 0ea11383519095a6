"""Text for people: control characters are shown as escapes, and tables for notebooks."""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Iterable, Sequence
from typing import Any

# ---------- visible
# Text for people: what a screen would obey, hide or turn around is shown as an escape instead, as `\x1b` or `\u202e`.
#
# Labels, file names and prose come from whoever wrote a spec. A terminal acts on control characters, and those
# of the bidirectional algorithm make a line read as something that it does not say (Boucher and Anderson, "Trojan Source", 2023).

_HIDDEN = frozenset({"Cc", "Cf", "Cn", "Cs", "Zl", "Zp"})
"""Unicode: control, format, unassigned, lone surrogates (of file names that are no UTF-8), line and paragraph separators."""
ON_PAGES = "\n\t\u200b\u200c\u200d"
"""Kept on pages: line breaks, tabs, places to break a line, and what Persian, Hindi and families of emoji are spelt with."""


def visible(text: str, keep: str = "\n") -> str:
    """A text that shows all that it holds; characters in `keep` stay as they are."""
    if text.isprintable():
        return text
    for char in filter(_is_hidden, set(text) - set(keep)):
        text = text.replace(char, char.encode("unicode_escape").decode())
    return text


def visible_json(data: Any) -> str:
    """JSON that shows all that it holds, and means the same."""
    text = json.dumps(data, indent=2, ensure_ascii=False, default=str)
    if text.replace("\n", "").isprintable():
        return text
    return "".join(json.dumps(c)[1:-1] if c != "\n" and _is_hidden(c) else c for c in text)


def lettered(letter: str) -> str:
    """A character of a map by itself: as it is, or the word for a blank."""
    return letter if letter.strip() else "blank"


def _is_hidden(char: str) -> bool:
    return not char.isprintable() and unicodedata.category(char) in _HIDDEN


# ---------- notebook
# Tables for notebooks, which show objects by their `_repr_html_`: a caption, a header, and rows of text.


def html_table(caption: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; whatever texts hold is shown, and none of it is read as HTML."""
    body = "".join(f"<tr>{_cells('td', row)}</tr>" for row in rows)
    head = f"<thead><tr>{_cells('th', header)}</tr></thead>" if header else ""
    return f"<table><caption>{_shown(caption)}</caption>{head}<tbody>{body}</tbody></table>"


def _cells(tag: str, values: Sequence[object]) -> str:
    return "".join(f'<{tag} style="text-align: left">{_shown(value)}</{tag}>' for value in values)


def _shown(value: object) -> str:
    from html import escape

    return escape(visible(str(value)))
