"""Docstrings as Markdown: paragraphs stay, and the sections that say what is given and what comes of it become lists."""

from __future__ import annotations

import re
from collections.abc import Iterator

_SECTION = re.compile(r"^(Args|Attributes|Raises|Returns|Yields):$")
_ENTRY = re.compile(r"^    (\S[^:]*): (.*)$")


def markdown(text: str) -> str:
    """A docstring, or the rest of one, whose indentation is that of its first line."""
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
