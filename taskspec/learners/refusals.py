"""What a learner raises on a task that it is not made for."""

from __future__ import annotations

from typing import Any, NoReturn

from taskspec.diagnostics import Diagnostic, SpecError


class CannotLearn(SpecError):
    """A learner is not made for a task (E724): an exam leaves the task out, instead of counting it as failed.

    Args:
        message: why not.
        hint: what else can be done.
    """

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__([Diagnostic("E724", None, message, hint)])
        self.message, self.hint = message, hint

    def __reduce__(self) -> tuple[Any, ...]:
        return CannotLearn, (self.message, self.hint)  # so that it comes through from another process


def cannot_learn(message: str, hint: str | None = None) -> NoReturn:
    """Raise CannotLearn."""
    raise CannotLearn(message, hint)
