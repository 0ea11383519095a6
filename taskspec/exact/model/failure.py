"""Why a task has no exact model, and the optional packages that exact results need."""

from __future__ import annotations

import importlib.util
from typing import Any, NoReturn

from taskspec.diagnostics import Diagnostic, SpecError


def refuse(message: str, hint: str | None = None) -> NoReturn:
    """Raise: this task has no exact model (E712)."""
    raise SpecError([Diagnostic("E712", None, message, hint)])


def misused(message: str, hint: str | None = None) -> NoReturn:
    """Raise: a function was not called as it can be (E713)."""
    raise SpecError([Diagnostic("E713", None, message, hint)])


def scipy_sparse() -> Any:
    """`scipy.sparse`, imported on first use.

    Raises:
        SpecError: (E705) with the command that installs it.
    """
    return _needed("scipy.sparse", "exact", "exact models are sparse matrices of scipy")


def scipy_module(name: str) -> Any:
    """A part of `scipy.sparse`, imported on first use."""
    return _needed(f"scipy.sparse.{name}", "exact", "exact models are sparse matrices of scipy")


def _needed(module: str, extra: str, why: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        hint = f'pip install "taskspec[{extra}]"'
        raise SpecError([Diagnostic("E705", None, f"{name} is not installed, and {why}", hint)]) from None


def is_installed(module: str) -> bool:
    """Whether an optional package can be imported, without importing it."""
    return importlib.util.find_spec(module) is not None
