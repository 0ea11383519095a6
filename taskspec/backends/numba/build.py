"""Compiles the source of a generated kernel into machine code."""

from __future__ import annotations

import linecache
from typing import Any

import llvmlite.binding as llvm
import numba
from numba import types

from taskspec.backends.kernelmemory import STEP, WHAT
from taskspec.backends.numba.basics import i64, inner, u64s
from taskspec.backends.numba.compile import target_machine


_boxed = types.ExternalFunction("PyLong_FromLongLong", types.uint64(types.int64))
_release = types.ExternalFunction("PyEval_SaveThread", types.uint64())
_acquire = types.ExternalFunction("PyEval_RestoreThread", types.void(types.uint64))
_WORDS = object.__basicsize__ // 8
"""Length of the head of an object; in an array, the address of its numbers follows (NumPy's `PyArrayObject`)."""


def machine_code(source: str) -> bytes:
    """The object file of a generated module, with a function `kernel` that CPython can call.

    `kernel(memory, data)` is given two arrays, the addresses of the program's memory and the actions, as CPython passes
    objects: their addresses. It runs the module's `run` and gives its result as an int.

    Raises:
        NotImplementedError: the code may raise an exception, which the generator never writes.
    """
    file = "<taskspec kernel>"
    namespace: dict[str, Any] = {"apart": apart}
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    exec(compile(source, file, "exec"), namespace)  # noqa: S102  # generated from checked nodes, never from a spec's text
    run = inner(namespace["run"])

    def kernel(memory: Any, data: Any) -> Any:
        m = u64s(memory, i64(_WORDS), i64(1))[0]
        numbers = u64s(data, i64(_WORDS), i64(1))[0]
        if u64s(m, i64(WHAT), i64(1))[0] != STEP:
            return _boxed(run(m, numbers))
        thread = _release()
        total = run(m, numbers)
        _acquire(thread)
        return _boxed(total)

    compiled = numba.cfunc(types.uint64(types.uint64, types.uint64), error_model="numpy")(kernel)
    text = compiled.inspect_llvm()
    if "picklebuf" in text:  # what Numba calls the arguments of an exception
        raise NotImplementedError(f"a kernel that raises exceptions:\n{source}")
    module = llvm.parse_assembly(text)
    module.get_function(compiled.native_name).name = "kernel"
    return target_machine().emit_object(module)  # type: ignore[no-any-return]


def apart(function: Any) -> Any:
    """Compile with the promise that no two array arguments share memory, which saves the loop from checking."""
    compiled = numba.njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)
    compiler: Any = getattr(compiled, "_compiler", None)
    plain = getattr(compiler, "_customize_flags", None)
    if plain is not None:  # private to Numba, hence optional

        def customized(flags: Any) -> Any:
            flags = plain(flags)
            flags.noalias = True
            return flags

        compiler._customize_flags = customized
    return compiled
