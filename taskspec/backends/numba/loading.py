"""Kernels as machine code: compiled once by Numba, kept on disk, and loaded without Numba by later processes.

Importing Numba and reading its own cache takes longer than the rest of a warm start (docs/vector.md). A kernel has plain
numbers as arguments and needs nothing of Numba's while it runs, so that LLVM's loader is enough.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import stat
import sys
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
    name = f"{_cache_key(source)}.o"
    folder = _open_cache()
    try:
        code = None if folder is None else read(folder, name)
        if code is None:
            _check_compile_time(source)
            code = import_module("taskspec.backends.numba.runtime").machine_code(source, _target_machine())
            if folder is not None:
                write(folder, name, code)
    finally:
        if folder is not None:
            os.close(folder)
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
    """Return a hash of everything that machine code depends on."""
    runtime = "\0".join(
        (Path(__file__).parent / name).read_text(encoding="utf-8") for name in ("runtime.py", "kernel_draws.py")
    )
    machine = (llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    versions = (version("numba"), version("llvmlite"), str(object.__basicsize__))
    return hashlib.sha256("\0".join((source, runtime, *versions, *machine)).encode()).hexdigest()[:32]


# -- on disk ------------------------------------------------------------------------------------------------------
#
# Machine code is run as it is found. So it is read only from a folder of this user that nobody else may write to, and only
# from regular files of this user's own. The folder is held open while it is used: nothing can take its place after it was
# checked. Every file begins with the SHA-256 hash of its name and content, so that damaged files are compiled again.

HASH_SIZE = 32
LARGEST = 256 * 2**20
"""Bytes of a file that are read at most."""
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_SUPPORTED = hasattr(os, "geteuid") and os.open in os.supports_dir_fd
"""Whether the system can check who may write to a folder. Windows cannot, and keeps nothing."""


class NotPrivateError(OSError):
    """A folder that somebody else may have written to; the message says why."""


def cache_folder() -> Path:
    """Return `$TASKSPEC_CACHE`, or `taskspec` in the user's cache folder."""
    own = os.environ.get("TASKSPEC_CACHE")
    if own:
        return Path(own)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", str(Path.home()))
    else:
        base = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    return Path(base) / "taskspec"


def _open_cache() -> int | None:
    """Return a descriptor of the folder of kernels, which is made if there is none; None if it cannot be used."""
    path = cache_folder() / "numba"
    if not _SUPPORTED:
        return None
    try:
        return open_private(path)
    except NotPrivateError as error:
        _warn_once(f"taskspec: compiled kernels are not kept, since {visible(str(error))}")
    except OSError:
        pass
    return None


@lru_cache
def _warn_once(message: str) -> None:
    logging.getLogger("taskspec").warning(message)


def open_private(path: Path) -> int:
    """Return a descriptor of a folder that this user alone may enter.

    Raises:
        NotPrivateError: somebody else may write to it; the message says why.
        OSError: it cannot be used.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        path.mkdir(0o700)
    if path.is_symlink():
        raise NotPrivateError(f"{path} is a symbolic link")
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        found = os.fstat(folder)
        if found.st_uid != os.geteuid():
            raise NotPrivateError(f"{path} belongs to another user")
        if found.st_mode & _OTHERS_WRITE:
            mode = stat.S_IMODE(found.st_mode)
            raise NotPrivateError(f"others may write to {path} (mode {mode:o}; `chmod 700` closes it)")
        if found.st_mode & _OTHERS:
            os.fchmod(folder, 0o700)
    except BaseException:
        os.close(folder)
        raise
    return folder


def read(folder: int, name: str) -> bytes | None:
    """Return the content that was written under a name; None where there is none, or it is damaged."""
    try:
        handle = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
        with os.fdopen(handle, "rb") as file:
            found = os.fstat(handle)
            own = found.st_uid == os.geteuid() and not found.st_mode & _OTHERS_WRITE
            if not stat.S_ISREG(found.st_mode) or not own or found.st_size > LARGEST:
                return None
            whole = file.read()
    except OSError:
        return None
    content = whole[HASH_SIZE:]
    return content if whole[:HASH_SIZE] == _hash(name, content) else None


def write(folder: int, name: str, content: bytes) -> None:
    """Keep a content, complete or not at all: it is written under another name and then moved."""
    unfinished = f".{name}.{os.urandom(8).hex()}"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    with suppress(OSError):
        handle = os.open(unfinished, flags, 0o600, dir_fd=folder)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_hash(name, content) + content)
            os.replace(unfinished, name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(OSError):
                os.unlink(unfinished, dir_fd=folder)
            raise


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
    """Return this machine as a target. An engine made with it becomes its owner."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=3, reloc="default", codemodel="jitdefault", jit=True
    )
