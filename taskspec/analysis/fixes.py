"""Fixes of mistakes whose hints say what to write, put into texts and files; all else in them stays as it is."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from taskspec.base.diagnostics import Diagnostic, Fix
from taskspec.base.files import write_text

Change: TypeAlias = tuple[int, int, str]
"""Where a piece of a text begins and ends, and what is to stand there."""
_LINE_END = re.compile(r"\r\n|\r|\n")


def fixed(text: str, fixes: Iterable[Fix]) -> str:
    """Return a text with fixes put in; of two that overlap, the first is."""
    starts = [0, *(found.end() for found in _LINE_END.finditer(text))]
    changes = []
    for span, replacement in fixes:
        start = starts[span.line - 1] + span.column - 1
        changes.append((start, starts[span.end_line - 1] + span.end_column - 1, replacement))
    return spliced(text, changes)


def spliced(text: str, changes: Iterable[Change]) -> str:
    """Return a text with pieces of it replaced; of two that overlap, the first is."""
    pieces = []
    done = 0
    for start, end, replacement in sorted(changes):
        if start >= done:
            pieces += [text[done:start], replacement]
            done = end
    return "".join([*pieces, text[done:]])


def fix_files(problems: Iterable[Diagnostic]) -> int:
    """Put the fixes of errors into the files that they are about, and return their number."""
    found: dict[str, set[Fix]] = {}
    for each in problems:
        fix = each.fix
        if fix is not None and each.severity == "error":
            found.setdefault(fix.span.origin.name, set()).add(fix)
    for name, fixes in found.items():
        path = Path(name)
        with path.open(encoding="utf-8", newline="") as file:
            text = file.read()
        write_text(path, fixed(text, fixes))
    return sum(map(len, found.values()))
