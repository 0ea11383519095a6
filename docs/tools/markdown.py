"""Markdown: tables, code and docstrings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

_SECTION = re.compile(r"^(Args|Attributes|Raises|Returns|Yields):$")
_ENTRY = re.compile(r"^    (\S[^:]*): (.*)$")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; bars inside cells are escaped, also between backticks, as GitHub and MyST require."""
    lines = [_row(header), "|" + "---|" * len(header)]
    return "\n".join([*lines, *(_row(row) for row in rows)])


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def code(text: str) -> str:
    """Return text as code, with as many backticks as it needs."""
    if "`" in text:
        return f"`` {text} ``"
    return f"`{text}`"


def docstring(text: str) -> str:
    """Convert a docstring without indentation: paragraphs stay, and sections such as `Args:` become lists."""
    return "\n".join(_lines(text)).strip()


def _lines(text: str) -> Iterator[str]:
    section = ""
    for line in text.splitlines():
        if found := _SECTION.match(line):
            section = found[1]
            yield from (f"**{section}**", "")
        elif not line.startswith(" ") and line:
            section = ""
            yield line
        elif section and section not in ("Returns", "Yields") and (entry := _ENTRY.match(line)):
            names = ", ".join(f"`{name}`" for name in entry[1].split(", "))
            yield f"- {names}: {entry[2]}"
        else:
            yield f"  {line.strip()}" if section in ("Args", "Attributes", "Raises") and line.strip() else line.strip()
