"""Markdown: tables, code, and pages with parts that are generated."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; bars inside cells are escaped, also between backticks, as GitHub and MyST require."""
    lines = [_row(header), "|" + "---|" * len(header)]
    return "\n".join([*lines, *(_row(row) for row in rows)])


def entries(rows: Iterable[Sequence[str]]) -> str:
    """Return a list: of each row the first cell, a colon, and the second cell."""
    return "\n".join(f"- {name}: {text}" for name, text in rows)


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def code(text: str) -> str:
    """Return text as code, with as many backticks as it needs."""
    if "`" in text:
        return f"`` {text} ``"
    return f"`{text}`"


def filled(page: Path, parts: Mapping[str, str]) -> str:
    """Return a page with its generated parts, which stand between `<!-- NAME -->` and `<!-- /NAME -->`, replaced.

    Raises:
        ValueError: where the page lacks one of them.
    """
    text = page.read_text(encoding="utf-8")
    for name, part in parts.items():
        place = re.compile(rf"(<!-- {name} -->(\n?)).*?(\n?<!-- /{name} -->)", re.DOTALL)
        places = list(place.finditer(text))
        if len(places) != 1:
            raise ValueError(f"{page.name} needs one part {name}")
        text = text[: places[0].end(1)] + part + text[places[0].start(3) :]
    return text
