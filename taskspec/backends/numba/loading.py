"""Kernels as machine code: compiled once by Numba, kept on disk, and loaded without Numba by the processes that follow.

Importing Numba and what it imports takes longer than everything else that a warm start does. A kernel has plain numbers
as arguments and needs nothing of Numba's while it runs, so that LLVM's loader is enough.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding as llvm

from taskspec.backends.numba import store
from taskspec.backends.numba.store import KernelStore
from taskspec.backends.numba.target import target_machine
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.display import visible
from taskspec.base.limits import how_to_raise, limits

RATE, LONG = 5000, 20
"""Characters of a kernel that are compiled in a second, nominally; and seconds that are worth a line of warning."""
_LIBRARY = ("compile", "draws", "runtime", "target")
_UNREACHED = (
    "NRT_Free", "numba_do_raise", "numba_gil_ensure", "numba_gil_release", "numba_runtime_build_excinfo_struct", "numba_unpickle",
)  # fmt: skip
"""Functions of Numba that report exceptions, which the code of a kernel names but, since it raises none, never calls."""


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
def load(source: str) -> LoadedKernel:
    """The kernel of a generated module, from the cache if it has been compiled before on such a machine.

    Raises:
        SpecError: E314, when it would take too long to compile.
    """
    with _kept() as kept:
        name = f"{_name(source)}.o"
        code = None if kept is None else kept.read(name)
        if code is None:
            _weigh(source)
            code = import_module("taskspec.backends.numba.compile").machine_code(source)
            if kept is not None:
                kept.write(name, code)
    return _linked(code)


def _weigh(source: str) -> None:
    """Say that a kernel takes long to compile, or refuse it: worked out from its length, before any time is spent."""
    seconds, most = len(source) // RATE, limits().compiling
    if seconds > most:
        message = f"Numba would take about {seconds:,} seconds to compile this task; the limit is {most:,}"
        hint = f'`backend="numpy"` needs no compilation; or {how_to_raise("compiling", seconds)}'
        raise SpecError([Diagnostic("E314", None, message, hint)])
    if seconds >= LONG:
        words = (
            f'Numba compiles this task, which takes about {seconds} seconds this once; backend="numpy" starts at once'
        )
        logging.getLogger("taskspec").warning(f"taskspec: {words}")


@contextmanager
def _kept() -> Iterator[KernelStore | None]:
    """What earlier processes compiled; None where nothing can be kept. If that is for safety, it is said."""
    with ExitStack() as stack:
        found = None
        try:
            found = stack.enter_context(store.opened(cache_folder() / "numba")) if store.SUPPORTED else None
        except store.NotPrivateError as error:
            _say_once(f"taskspec: compiled kernels are not kept, since {visible(str(error))}")
        except OSError:
            pass
        yield found


@lru_cache
def _say_once(message: str) -> None:
    logging.getLogger("taskspec").warning(message)


def _name(source: str) -> str:
    """A name for all that the machine code follows from."""
    machine = (llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    versions = (version("numba"), version("llvmlite"), str(object.__basicsize__))
    made_of = (source, _library(), *versions, *machine)
    return hashlib.sha256("\0".join(made_of).encode()).hexdigest()[:32]


@lru_cache(maxsize=1)
def _library() -> str:
    """The text of the functions that kernels are made of, and of what compiles them."""
    here = Path(__file__).parent
    return "\0".join((here / f"{name}.py").read_text(encoding="utf-8") for name in _LIBRARY)


# -- in memory ----------------------------------------------------------------------------------------------------


Run = Callable[[Array], int]
"""Runs a kernel over the memory that it is bound to, with an array of actions."""


@dataclass(frozen=True)
class LoadedKernel:
    """The machine code of a generated module."""

    _method: _PyMethodDef
    _engine: llvm.ExecutionEngine  # the code is its own, and goes when it does

    def bound(self, memory: Array) -> Run:
        """The kernel as a built-in function of the array of actions, for a vector of addresses, uint64.

        The kernel and whatever the addresses point to must be kept while it is used.
        """
        run: Run = _new_function(ctypes.byref(self._method), memory, None)
        return run


class _PyMethodDef(ctypes.Structure):
    """CPython's structure of that name."""

    _fields_ = (
        ("ml_name", ctypes.c_char_p),
        ("ml_meth", ctypes.c_void_p),
        ("ml_flags", ctypes.c_int),
        ("ml_doc", ctypes.c_char_p),
    )


_METH_O = 0x8
_new_function = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)(
    ("PyCFunction_NewEx", ctypes.pythonapi)
)


def _linked(code: bytes) -> LoadedKernel:
    """The function `kernel` of an object file."""
    never = ctypes.cast(ctypes.pythonapi.Py_FatalError, ctypes.c_void_p).value
    for name in _UNREACHED:
        if llvm.address_of_symbol(name) is None:
            llvm.add_symbol(name, never)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return LoadedKernel(_PyMethodDef(b"run", engine.get_function_address("kernel"), _METH_O, None), engine)
