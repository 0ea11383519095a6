"""Compiles the source of a generated kernel into machine code."""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
import numba
from numba import types

from taskspec.backends.emit.source import run
from taskspec.backends.numba.target import target_machine


def machine_code(source: str) -> bytes:
    """The object file of a generated module, with its function `kernel`, which CPython can call.

    The code raises no exceptions: what would report them is not there when it is loaded without Numba.
    """
    namespace: dict[str, Any] = {"apart": apart}
    run(source, "<taskspec kernel>", namespace)
    compiled = numba.cfunc(types.uint64(types.uint64, types.uint64), error_model="numpy")(namespace["kernel"])
    text = compiled.inspect_llvm()
    if "picklebuf" in text:  # what Numba calls the arguments of an exception
        raise AssertionError(f"a kernel that may raise an exception:\n{source}")
    module = llvm.parse_assembly(text)
    module.get_function(compiled.native_name).name = "kernel"
    return target_machine().emit_object(module)


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
