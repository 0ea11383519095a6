"""Fixes of mistakes whose hints say what to write, put into texts and files; all else in them stays as it is."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from taskspec.base.diagnostics import Diagnostic, Fix
from taskspec.base.files import write_text

_LINE_END = re.compile(r"\r\n|\r|\n")


def fixed(text: str, fixes: Iterable[Fix]) -> str:
    """Return a text with fixes put in; of two that overlap, the first is."""
    starts = [0, *(found.end() for found in _LINE_END.finditer(text))]
    pieces = []
    done = 0
    for span, replacement in sorted(fixes, key=lambda fix: (fix.span.line, fix.span.column)):
        start = starts[span.line - 1] + span.column - 1
        if start >= done:
            pieces += [text[done:start], replacement]
            done = starts[span.end_line - 1] + span.end_column - 1
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
