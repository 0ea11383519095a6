"""The closed table of error and warning codes.

It is read from `errors.md` beside this file, which the documentation shows. A new code is a new entry: an anchor,
the heading `### E302 unknown-name: title`, and an explanation in Markdown with a wrong and a corrected example.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

Severity = Literal["error", "warning"]
"""How bad a diagnostic is."""


def severity(code: str) -> Severity:
    """Return `warning` for the W codes, `error` for all others."""
    if code.startswith("W"):
        return "warning"
    return "error"


@dataclass(frozen=True, slots=True)
class Code:
    """One situation that a user can be in. `explanation` is Markdown."""

    code: str
    slug: str
    title: str
    explanation: str

    @property
    def severity(self) -> Severity:
        """`warning` for the W codes, `error` for all others."""
        return severity(self.code)


@lru_cache(maxsize=1)
def codes() -> dict[str, Code]:
    """Return every code of an error or a warning, with its explanation."""
    entries = {}
    for part in _parts():
        for entry in part.split("\n### ")[1:]:
            heading, _, explanation = entry.partition("\n")
            name, _, title = heading.partition(": ")
            code, slug = name.split(" ")
            entries[code] = Code(code, slug, title, explanation.partition('\n<a id="')[0].strip())
    return entries


def classes() -> dict[str, str]:
    """Return the subject of each class of codes, by the first two characters of the codes."""
    headings = [part.splitlines()[0].partition("xx: ") for part in _parts()]
    return {prefix: subject for prefix, _, subject in headings}


def _parts() -> list[str]:
    page = Path(__file__).with_name("errors.md").read_text(encoding="utf-8")
    return page.split("\n## ")[1:]
