"""The closed table of diagnostic codes, read from `errors.md` beside this file.

`docs/errors.md` is a copy of that page. A new code is a new entry: an anchor, the heading `### E302 unknown-name: title`,
and an explanation in Markdown with a wrong and a corrected example.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from taskspec.base.records import dataclass

Severity = Literal["error", "warning"]
"""How bad a diagnostic is."""


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
        return "warning" if self.code.startswith("W") else "error"


CLASSES: dict[str, str] = {}
"""The subject of each class of codes, by the first two characters of the codes."""

CODES: dict[str, Code] = {}
"""Every code of an error or a warning, with its explanation."""

PAGE = Path(__file__).with_name("errors.md")

for _part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
    _heading, *_entries = _part.split("\n### ")
    _prefix, _, _subject = _heading.splitlines()[0].partition("xx: ")
    CLASSES[_prefix] = _subject
    for _entry in _entries:
        _title, _, _explanation = _entry.partition("\n")
        _name, _, _title = _title.partition(": ")
        _code, _slug = _name.split(" ")
        CODES[_code] = Code(_code, _slug, _title, _explanation.partition('\n<a id="')[0].strip())
