"""Why a task has no exact model, and the optional package that exact models need."""

from __future__ import annotations

from typing import Any, NoReturn

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.extras import need


class NoModel(SpecError):
    """A task has no exact model, or none that answers what is asked (E712)."""


def refuse(message: str, hint: str | None = None) -> NoReturn:
    """Raise `NoModel`."""
    raise NoModel([Diagnostic("E712", None, message, hint)])


def misused(message: str, hint: str | None = None) -> NoReturn:
    """Raise: a function was not called as it can be (E713)."""
    raise SpecError([Diagnostic("E713", None, message, hint)])


def scipy_sparse() -> Any:
    """`scipy.sparse`, imported on first use.

    Raises:
        SpecError: (E705) with the command that installs it.
    """
    return need("scipy.sparse", "exact", "an exact model")


def scipy_module(name: str) -> Any:
    """A part of `scipy.sparse`, imported on first use."""
    return need(f"scipy.sparse.{name}", "exact", "an exact model")
