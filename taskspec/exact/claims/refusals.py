"""Why a claim has no verdict: it is not one, or it cannot be decided."""

from __future__ import annotations

from taskspec.lang import syntax as s


class Undecidable(Exception):
    """The claim needs something that the task does not have: a sentence that says what."""

    def __init__(self, message: str, place: s.Expr | None = None) -> None:
        super().__init__(message)
        self.place = place


class Unfit(Exception):
    """The expression is not one that a claim can be made of: a sentence that says why."""

    def __init__(self, message: str, place: s.Expr | None = None, hint: str | None = None) -> None:
        super().__init__(message)
        self.place, self.hint = place, hint
