"""Optional libraries, imported when they are first needed, with a message that says how to install them."""

from __future__ import annotations

import importlib
from typing import Any

from taskspec.diagnostics import Diagnostic, SpecError


def need(module: str, extra: str) -> Any:
    """Import a module of an optional dependency.

    Raises:
        SpecError: E705, when it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        message = f"this needs `{name}`, which is not installed"
        raise SpecError((Diagnostic("E705", None, message, f"pip install 'taskspec[{extra}]'"),)) from error
