"""Kernels as machine code: compiled once by Numba, kept on disk, and loaded without Numba by later processes.

Importing Numba and reading its own cache takes longer than the rest of a warm start (docs/howto/vector.md). A kernel has plain
numbers as arguments and needs nothing of Numba's while it runs, so that LLVM's loader is enough.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import stat
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding as llvm

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import spec_error
from taskspec.base.display import visible
from taskspec.base.limits import how_to_raise, limits

RATE = 5000
"""Characters of a kernel that are compiled in a second, nominally."""
LONG = 20
"""Seconds of compilation that are worth a warning."""


@lru_cache(maxsize=64)
def load(source: str) -> LoadedKernel:
    """Return the kernel of a generated module, from the cache if it was compiled before on such a machine.

    Raises:
        SpecError: E314, when it would take too long to compile.
    """
    folder = private_folder(cache_folder() / "numba")
    code = None
    if folder is not None:
        file = folder / f"{_cache_key(source)}.o"
        code = read(file)
    if code is None:
        _check_compile_time(source)
        code = import_module("taskspec.programs.numba.runtime").machine_code(source, _target_machine())
        if folder is not None:
            write(file, code)
    return _linked(code)


def _check_compile_time(source: str) -> None:
    """Warn of a kernel that takes long to compile, or refuse it, by its length."""
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


def _cache_key(source: str) -> str:
    folder = Path(__file__).parent
    runtime = (folder / "runtime.py").read_text(encoding="utf-8")
    draws = (folder / "kernel_draws.py").read_text(encoding="utf-8")
    machine = (llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    versions = (version("numba"), version("llvmlite"), str(object.__basicsize__))
    return hashlib.sha256("\0".join((source, runtime, draws, *versions, *machine)).encode()).hexdigest()[:32]


# -- on disk ------------------------------------------------------------------------------------------------------
#
# Machine code is run without further checks, so it is read only from a folder of this user that nobody else may write to,
# and only from regular files of this user's own. Every file begins with the SHA-256 hash of its name and content, so that
# damaged files are compiled again.

HASH_SIZE = 32
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_folder() -> Path:
    """Return `$TASKSPEC_CACHE`, or `taskspec` in the user's cache folder."""
    own = os.environ.get("TASKSPEC_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))) / "taskspec"


def private_folder(path: Path) -> Path | None:
    """Return a folder that this user alone may enter, which is made if there is none; None if it cannot be used.

    A warning says so where somebody else may write to it.
    """
    if not hasattr(os, "geteuid"):  # Windows cannot say who may write to a folder, and keeps nothing
        return None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(0o700, exist_ok=True)
        found = path.lstat()
        problem = ""
        if stat.S_ISLNK(found.st_mode):
            problem = f"{path} is a symbolic link"
        elif found.st_uid != os.geteuid():
            problem = f"{path} belongs to another user"
        elif found.st_mode & _OTHERS_WRITE:
            mode = stat.S_IMODE(found.st_mode)
            problem = f"others may write to {path} (mode {mode:o}; `chmod 700` closes it)"
        if problem:
            _warn_once(f"taskspec: compiled kernels are not kept, since {visible(problem)}")
            return None
        path.chmod(0o700)
    except OSError:
        return None
    return path


@lru_cache
def _warn_once(message: str) -> None:
    logging.getLogger("taskspec").warning(message)


def read(file: Path) -> bytes | None:
    """Return the content that was written to a file; None where there is none, or it is damaged."""
    try:
        found = file.lstat()
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & _OTHERS_WRITE:
            return None
        whole = file.read_bytes()
    except OSError:
        return None
    content = whole[HASH_SIZE:]
    if whole[:HASH_SIZE] == _hash(file.name, content):
        return content
    return None


def write(file: Path, content: bytes) -> None:
    """Keep a content, complete or not at all: it is written to another file, which is then moved."""
    unfinished = file.with_name(f".{file.name}.{os.urandom(8).hex()}")
    with suppress(OSError):
        try:
            unfinished.write_bytes(_hash(file.name, content) + content)
            unfinished.chmod(0o600)
            unfinished.replace(file)
        finally:
            unfinished.unlink(missing_ok=True)


def _hash(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\0" + content).digest()


# -- in memory ----------------------------------------------------------------------------------------------------

Run = Callable[[Array], int]
"""Runs a kernel over the memory that it is bound to, with an array of actions."""
_UNREACHED = (
    "NRT_Free", "numba_do_raise", "numba_gil_ensure", "numba_gil_release", "numba_runtime_build_excinfo_struct", "numba_unpickle",
)  # fmt: skip
"""Functions of Numba that report exceptions. Kernels name them but never call them, since they raise no exceptions."""


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


@dataclass(frozen=True)
class LoadedKernel:
    """The machine code of a generated module, which is freed with the engine."""

    _method: _PyMethodDef
    _engine: llvm.ExecutionEngine

    def bound(self, memory: Array) -> Run:
        """Return the kernel as a built-in function of the array of actions, for a vector of addresses, uint64.

        The kernel, and everything that the addresses point to, must be kept while the function is used.
        """
        run: Run = _new_function(ctypes.byref(self._method), memory, None)
        return run


def _linked(code: bytes) -> LoadedKernel:
    """Load the function `kernel` of an object file."""
    never = ctypes.cast(ctypes.pythonapi.Py_FatalError, ctypes.c_void_p).value
    for name in _UNREACHED:
        if llvm.address_of_symbol(name) is None:
            llvm.add_symbol(name, never)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return LoadedKernel(_PyMethodDef(b"run", engine.get_function_address("kernel"), _METH_O, None), engine)


def _target_machine() -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=3, reloc="default", codemodel="jitdefault", jit=True
    )
