"""Tables for notebooks, which show objects by their `_repr_html_`: a caption, a header, and rows of text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from taskspec.visible import visible


def html_table(caption: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; whatever texts hold is shown, and none of it is read as HTML."""
    body = "".join(f"<tr>{_cells('td', row)}</tr>" for row in rows)
    head = f"<thead><tr>{_cells('th', header)}</tr></thead>" if header else ""
    return f"<table><caption>{_shown(caption)}</caption>{head}<tbody>{body}</tbody></table>"


def _cells(tag: str, values: Sequence[object]) -> str:
    return "".join(f'<{tag} style="text-align: left">{_shown(value)}</{tag}>' for value in values)


def _shown(value: object) -> str:
    return escape(visible(str(value)))
