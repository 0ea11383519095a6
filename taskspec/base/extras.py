"""Optional packages: imported when they are first needed, with the command that installs what is missing."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError

DISTRIBUTION = "taskspec-rl"
"""What `pip` calls this package: on the public index, `taskspec` is the work of others."""


def need(module: str, extra: str = "", what: str = "this") -> Any:
    """Import a module of an optional package.

    Args:
        module: with its package, as in `matplotlib.figure`.
        extra: of ours, that installs the package; "" if the package is in none.
        what: needs it, for the message.

    Raises:
        SpecError: E705, when it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise missing(package, install(extra) if extra else install_package(package), what) from error


def missing(package: str, hint: str, what: str = "this") -> SpecError:
    """The error E705: something needs a package that is not installed."""
    return SpecError([Diagnostic("E705", None, f"{what} needs `{package}`, which is not installed", hint)])


def is_installed(module: str) -> bool:
    """Whether an optional package can be imported, without importing it."""
    return importlib.util.find_spec(module) is not None


def install(extra: str) -> str:
    """The command that installs an extra of ours, where we are: in a checkout, or beside what was installed from a wheel."""
    root = _checkout()
    return install_package(f"{DISTRIBUTION}[{extra}]") if root is None else f'pip install -e "{root}[{extra}]"'


def install_package(requirement: str) -> str:
    """The command that installs a package of others; with double quotes, which every shell takes, that of Windows included."""
    return f'pip install "{requirement}"'


def _checkout() -> str | None:
    """The folder of the checkout that this module is part of, "." where it is the working folder; None in a wheel."""
    project = Path(__file__).resolve().parents[2] / "pyproject.toml"
    if not project.is_file() or f'name = "{DISTRIBUTION}"' not in project.read_text(encoding="utf-8"):
        return None
    here = Path(project.name)
    return "." if here.is_file() and here.samefile(project) else str(project.parent)
