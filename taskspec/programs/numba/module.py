"""The generated module of a task, in a file, so that Numba keeps what it compiles of it on disk.

Python calls its functions, which run loops on the memory of an environment.
"""

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
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.variates import VARIATES, WordLayout
from taskspec.language.task.task import Task
from taskspec.programs import indent
from taskspec.programs.numba import kernel_draws, runtime
from taskspec.programs.numba.loops import LoopFunction, Program, action_places, advance, begin, check
from taskspec.programs.vector_program import Mode

BAD = -1
"""Result of `step` for an action outside the action space; nothing has changed then."""
_MATH = sorted({name for operator in OPERATORS.values() for name in operator.kernel.names})
_IMPORTS = [
    "import numpy as np", "",
    "from taskspec.programs.numba.runtime import *  # noqa: F403",
    "from taskspec.programs.numba.kernel_draws import *  # noqa: F403",
    f"from math import {', '.join(_MATH)}", "",
]  # fmt: skip


def generate(task: Task, mode: Mode) -> tuple[str, Program]:
    """Write the source of the module, with the layout of its memory."""
    p = Program(task, mode)
    advancing = advance(p)
    beginning = begin(p)
    functions = [check(p).lines, advancing.lines, beginning.lines, _step(p, advancing, beginning)]
    again = _blocks(p, ["late = gather(n, chosen, lanes)", *_begin(p, beginning)])  # in the lanes that are chosen
    functions.append(["@kernel", "def reset(memory, pitch, start, stop, scratch):", *indent(again)])
    text = repr(f"{task.id}: a block of lanes at a time, for Numba. Generated; autoreset is {mode!r}.")
    tables = []
    for name, array in p.constants.items():
        tables.append(f"{name} = np.array({array.tolist()}, np.{array.dtype})")
    head = [text, "", *_IMPORTS, *tables, ""]
    for function in functions:
        head += ["", *function, ""]
    return "\n".join(head), p


def _step(p: Program, advancing: LoopFunction, beginning: LoopFunction) -> list[str]:
    """Check all actions, then step the lanes from `start` to `stop`; return how many episodes ended."""
    body = [
        f"given = part(actions, first * {len(action_places(p))})",
        *_fill(p, p.step_words, "step_words(n", "k0, k1, steps", "n"),
        f"count = advance({', '.join(['n', 'given', *advancing.rows])})",
    ]
    for shown in advancing.shown:
        body.append(f"show(n, r_{shown.word}, i64({p.width}), i64({shown.size}), {shown.row}, pitch)")
    again = _begin(p, beginning)
    if p.mode == "next_step":
        body = [*_LATE, *body, *_UNDO, "if late > 0:", *indent(again)]
    elif p.mode == "same_step" and not p.inline_reset:
        keep = []
        for rows in p.seen:
            keep.append(f"keep(late, lanes, i64({len(rows)}), {rows[0]}, {p.final[rows[0]]}, pitch)")
        body += ["if count > 0:", *indent(["late = gather(n, ended, lanes)", *keep, *again])]
    lines = [
        "if check(len(actions), part(actions, i64(0))) > 0:",
        f"    return {BAD}",
        "total = 0",
        *_blocks(p, [*body, "total += count"]),
        "return total",
    ]
    return ["@kernel", "def step(memory, pitch, start, stop, scratch, actions):", *indent(lines)]


def _blocks(p: Program, body: list[str]) -> list[str]:
    rows = [f"{row} = {p.rows[row]}" for row in p.rows_in(body)]
    lines = [f"n = min({p.block}, stop - first)", *rows, *body]
    return [f"for first in range(start, stop, {p.block}):", *indent(lines)]


_LATE = ["late = gather(n, ended, lanes)", "for i in range(late):", "    time[u64(lanes[i])] = 0"]
"""The step's results for lanes that begin again are dropped; but it may look things up by the time."""
_UNDO = [
    "for i in range(late):",
    "    j = u64(lanes[i])",
    "    count -= i64(ended[j])",
    "    steps[j] = u32(steps[j] - u32(1))",
    "    reward[j] = 0.0",
    "    terminated[j] = truncated[j] = ended[j] = False",
]
"""Lanes that begin again in this step take none."""


def _begin(p: Program, beginning: LoopFunction) -> list[str]:
    lines = _fill(p, p.reset_words, "reset_words(late, lanes", "k0, k1, episodes", "late")
    lines.append(f"begin({', '.join(['late', *beginning.rows])})")
    for shown in beginning.shown:
        lines.append(f"show_some(late, lanes, r_{shown.word}, i64({p.width}), i64({shown.size}), {shown.row}, pitch)")
    return lines


def _fill(p: Program, words: WordLayout, call: str, keys: str, n: str) -> list[str]:
    if not words.count:
        return []
    lines = [f"{call}, w_0, i64({p.width}), i64({(words.count + 1) // 2}), {keys})"]
    for draw in words.draws:
        loop = VARIATES[draw.base].loop
        if loop is not None:
            lines.append(f"{loop}({n}, w_{words.first[draw.site]}, i64({p.width}), i64({draw.type.size}))")
    return lines


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
    folder = private_folder(cache_folder() / "numba") or Path(_temporary().name)
    file = folder / digest / "kernel.py"
    if not file.is_file() or file.read_text(encoding="utf-8") != source:
        _check_compile_time(source)
        write_text(file, source)
    name = f"taskspec_kernel_{digest}"  # by which Numba finds the module again
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


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="taskspec-", ignore_cleanup_errors=True)
