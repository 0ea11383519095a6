"""Generated modules in files, so that Numba keeps what it compiles of them on disk."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import logging
import os
import pickle
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba

from taskspec.base.diagnostics import spec_error
from taskspec.base.display import visible
from taskspec.base.files import write_text
from taskspec.base.limits import how_to_raise, limits
from taskspec.programs.numba import kernel_draws, runtime

RATE = 5000
"""Characters of a module that are compiled in a second, nominally."""
LONG = 20
"""Seconds of compilation that are worth a warning."""
_DAMAGED = (OSError, pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError, ValueError)
"""Errors of reading a file that Numba kept, or of writing one."""
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


@cache
def load(source: str) -> ModuleType:
    """Import a generated module from a file in a folder that is named by the hash of all that is compiled.

    Raises:
        SpecError: E314, when it would take too long to compile.
    """
    parts = (source, inspect.getsource(runtime), inspect.getsource(kernel_draws))
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
    folder = private_folder(cache_folder() / "numba") or _temporary_folder()
    file = folder / digest / "kernel.py"
    if not file.is_file() or file.read_text(encoding="utf-8") != source:
        _check_compile_time(source)
        write_text(file, source)
    return _imported(f"taskspec_kernel_{digest}", file)


def _imported(name: str, file: Path) -> ModuleType:
    """Import a file as a module of a name, by which Numba finds the module again."""
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def compiled(function: Any, *arguments: Any) -> Callable[..., Any]:
    """Get a function of a generated module for such arguments, as Numba compiled it now or earlier.

    Calls skip Numba's dispatch by types, which takes as long as everything else that is done once in a step.
    """
    types = tuple(map(numba.typeof, arguments))
    try:
        return function.compile(types)
    except _DAMAGED:
        shutil.rmtree(function.stats.cache_path, ignore_errors=True)
        return function.compile(types)


def _check_compile_time(source: str) -> None:
    """Warn of a module that takes long to compile, or refuse it, by its length."""
    seconds = len(source) // RATE
    most = limits().compiling
    if seconds > most:
        message = f"Numba would take about {seconds:,} seconds to compile this task; the limit is {most:,}"
        hint = f'`backend="numpy"` needs no compilation; or {how_to_raise("compiling", seconds)}'
        raise spec_error("E314", message, hint)
    if seconds >= LONG:
        words = (
            f'Numba compiles this task, which takes about {seconds} seconds this once; backend="numpy" starts at once'
        )
        logging.getLogger("taskspec").warning(f"taskspec: {words}")


# -- the folder ---------------------------------------------------------------------------------------------------
#
# Numba runs what it finds there, so the folder must be one that nobody else may write to.


def cache_folder() -> Path:
    """Locate the cache: `$TASKSPEC_CACHE`, or `taskspec` in the user's cache folder."""
    own = os.environ.get("TASKSPEC_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))) / "taskspec"


def private_folder(path: Path) -> Path | None:
    """Make a folder that this user alone may enter; None if it cannot be used.

    A warning says so where somebody else may write to it.
    """
    if not hasattr(os, "geteuid"):  # Windows cannot say who may write to a folder
        return None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(0o700, exist_ok=True)
        status = path.lstat()
        problem = ""
        if stat.S_ISLNK(status.st_mode):
            problem = f"{path} is a symbolic link"
        elif status.st_uid != os.geteuid():
            problem = f"{path} belongs to another user"
        elif status.st_mode & _OTHERS_WRITE:
            mode = stat.S_IMODE(status.st_mode)
            problem = f"others may write to {path} (mode {mode:o}; `chmod 700` closes it)"
        if problem:
            _warn_once(f"taskspec: compiled kernels are not kept, since {visible(problem)}")
            return None
        path.chmod(0o700)
        with tempfile.TemporaryFile(dir=path):
            return path
    except OSError:
        return None


@cache
def _warn_once(message: str) -> None:
    logging.getLogger("taskspec").warning(message)


def _temporary_folder() -> Path:
    return Path(_temporary().name)


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="taskspec-", ignore_cleanup_errors=True)
