"""Text for people: control characters as escapes such as `\\x1b` or `\\u202e`, and tables for notebooks.

Labels, file names and prose come from the authors of specs. Terminals obey control characters, and those of the bidirectional
algorithm change how a line reads (Boucher and Anderson, "Trojan Source", 2023).
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Iterable, Sequence
from typing import Any

_HIDDEN = frozenset({"Cc", "Cf", "Cn", "Cs", "Zl", "Zp"})
"""Unicode: control, format, unassigned, lone surrogates (of file names that are no UTF-8), line and paragraph separators."""
ON_PAGES = "\n\t\u200b\u200c\u200d"
"""Characters that pages keep: line breaks, tabs, break opportunities, and joiners of Persian, Hindi and emoji."""


def visible(text: str, keep: str = "\n") -> str:
    """Return a text with hidden characters as escapes, but for those in `keep`."""
    if text.isprintable():
        return text
    for char in filter(_is_hidden, set(text) - set(keep)):
        text = text.replace(char, char.encode("unicode_escape").decode())
    return text


def visible_json(data: Any) -> str:
    """Return data as JSON with hidden characters as escapes."""
    text = json.dumps(data, indent=2, ensure_ascii=False, default=str)
    if text.replace("\n", "").isprintable():
        return text
    return "".join(json.dumps(c)[1:-1] if c != "\n" and _is_hidden(c) else c for c in text)


def lettered(letter: str) -> str:
    """Return a character of a map, or `blank` for white space."""
    return letter if letter.strip() else "blank"


def _is_hidden(char: str) -> bool:
    return not char.isprintable() and unicodedata.category(char) in _HIDDEN


def html_table(caption: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return an HTML table with a caption, a header, and rows of escaped text, for `_repr_html_`."""
    body = "".join(f"<tr>{_cells('td', row)}</tr>" for row in rows)
    head = f"<thead><tr>{_cells('th', header)}</tr></thead>" if header else ""
    return f"<table><caption>{_shown(caption)}</caption>{head}<tbody>{body}</tbody></table>"


def _cells(tag: str, values: Sequence[object]) -> str:
    return "".join(f'<{tag} style="text-align: left">{_shown(value)}</{tag}>' for value in values)


def _shown(value: object) -> str:
    from html import escape

    return escape(visible(str(value)))
