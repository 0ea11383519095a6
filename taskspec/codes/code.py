"""What one entry of the table of codes holds."""

from __future__ import annotations

from typing import Literal

from taskspec.base.records import dataclass

Severity = Literal["error", "warning"]
"""How bad a diagnostic is."""


@dataclass(frozen=True, slots=True)
class Code:
    """One situation that a user can be in. `explanation` is Markdown; the error guide prints it."""

    code: str
    slug: str
    title: str
    explanation: str

    @property
    def severity(self) -> Severity:
        """`warning` for the W codes, `error` for all others."""
        return "warning" if self.code.startswith("W") else "error"
