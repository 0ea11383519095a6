"""Policies from Python files: functions, `model.py:fn`."""

from __future__ import annotations

import importlib.util
import sys
import zlib
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError


def plain(values: Any) -> Any:
    """Return a tensor of PyTorch, with a gradient or without, as an array; anything else as it is."""
    if hasattr(values, "detach"):
        return values.detach().cpu().numpy()
    return values


def is_function(name: str) -> bool:
    return ".py:" in name


def place_of(name: str) -> tuple[Path, str]:
    """Return the file of `model.py:fn` and the name of the function; nothing is run."""
    place, _, attribute = name.rpartition(":")
    if not Path(place).is_file():
        raise SpecError([Diagnostic("E710", None, f"there is no file '{place}'")])
    return Path(place), attribute


def function_of(name: str, form: str = "(observation)") -> Any:
    """Run the file of `model.py:fn`, and return the function, or the object with `predict`.

    Args:
        form: the function's parameters, for a hint.
    """
    path, attribute = place_of(name)
    function = getattr(_module(path), attribute, None)
    if not (callable(function) or hasattr(function, "predict")):
        message = f"'{path}' has no function '{attribute}', nor an object of that name with `predict`"
        raise SpecError([Diagnostic("E713", None, message, f"def {attribute or 'act'}{form}: ...")])
    return function


def _module(path: Path) -> Any:
    """Run a file as a module; as for a script, modules in its folder can be imported."""
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
