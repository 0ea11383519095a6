"""Policies from files of Python: `model.py:fn`, a function from the observation to the action, or an object with `predict`."""

from __future__ import annotations

import importlib.util
import sys
import zlib
from pathlib import Path
from typing import Any

from taskspec.diagnostics import Diagnostic, SpecError


def is_function(name: str) -> bool:
    """Whether a policy's name means a function of a file."""
    return ".py:" in name


def place_of(name: str) -> tuple[Path, str]:
    """The file of `model.py:fn`, and the name of the function; nothing is run.

    Raises:
        SpecError: E710 when there is no such file.
    """
    place, _, attribute = name.rpartition(":")
    if not Path(place).is_file():
        raise SpecError([Diagnostic("E710", None, f"there is no file '{place}'")])
    return Path(place), attribute


def function_of(name: str, form: str = "(observation)") -> Any:
    """The function, or the object with `predict`, that a name `model.py:fn` means. The file is run.

    Args:
        form: what a hint says about its arguments.

    Raises:
        SpecError: E710, E711 when there is no such file, or it fails; E713 when it has nothing of that name that acts.
    """
    path, attribute = place_of(name)
    found = getattr(_module(path), attribute, None)
    if not (callable(found) or hasattr(found, "predict")):
        message = f"'{path}' has no function '{attribute}', nor an object of that name with `predict`"
        raise SpecError([Diagnostic("E713", None, message, f"def {attribute or 'act'}{form}: ...")])
    return found


def _module(path: Path) -> Any:
    """The module that a file makes, run anew; what lies beside it can be imported, as by a script."""
    name = f"{path.stem}_{zlib.crc32(str(path.resolve()).encode()):08x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses look for the module of a class
    sys.path.insert(0, str(path.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        message = f"'{path}' cannot be run: {type(error).__name__}: {error}"
        raise SpecError([Diagnostic("E711", None, message)]) from error
    finally:
        sys.path.pop(0)
    return module
