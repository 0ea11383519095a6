"""Compiles generated kernels and keeps them on disk, so that the next process starts warm.

A kernel is written to a file in the user's cache, named after its content and the versions that matter, and imported from
there; Numba keeps the machine code beside it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba

import taskspec
from taskspec.backends.numba import basics, draws, lanes, operators


def cache_folder() -> Path:
    """`$TASKSPEC_CACHE`, or `taskspec` in the user's cache folder."""
    own = os.environ.get("TASKSPEC_CACHE")
    if own:
        return Path(own)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", str(Path.home()))
    else:
        base = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    return Path(base) / "taskspec"


@lru_cache(maxsize=64)
def load(source: str) -> ModuleType:
    """The module of a kernel's source, its functions compiled when first called."""
    key = _key(source)
    try:
        path = _written(source, cache_folder() / "numba" / key / "kernel.py")
        cached = True
    except OSError:  # nowhere to write: compile in memory
        path, cached = Path(tempfile.mkdtemp()) / "kernel.py", False
        path.write_text(source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"taskspec_kernel_{key}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__.update(outer=_outer(cached), apart=apart)
    sys.modules[module.__name__] = module  # where Numba looks when it loads machine code from its cache
    spec.loader.exec_module(module)
    return module


def _key(source: str) -> str:
    """A name for all that the machine code follows from, but the machine itself, which Numba checks."""
    made_of = (source, taskspec.__version__, numba.__version__, _library())
    return hashlib.sha256("\0".join(made_of).encode()).hexdigest()[:32]


@lru_cache(maxsize=1)
def _library() -> str:
    """The text of the functions that kernels are made of."""
    files = [module.__file__ for module in (basics, draws, lanes, operators)]
    return "\0".join(Path(file).read_text(encoding="utf-8") for file in files if file is not None)


def _written(source: str, path: Path) -> Path:
    """The file, written once and whole. What stands there is run only if it is this very text."""
    if not path.is_file() or path.read_text(encoding="utf-8") != source:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".py")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(source)
        Path(name).replace(path)
    return path


def _outer(cached: bool) -> Any:
    return numba.njit(error_model="numpy", nogil=True, cache=cached)


def apart(function: Any) -> Any:
    """Compile with the promise that no two array arguments share memory, which saves the loop from checking."""
    compiled = numba.njit(error_model="numpy", nogil=True)(function)
    compiler: Any = getattr(compiled, "_compiler", None)
    plain = getattr(compiler, "_customize_flags", None)
    if plain is not None:  # private to Numba, hence optional

        def customized(flags: Any) -> Any:
            flags = plain(flags)
            flags.noalias = True
            return flags

        compiler._customize_flags = customized
    return compiled
