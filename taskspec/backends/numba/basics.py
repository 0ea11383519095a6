"""Building blocks of generated kernels: selects without branches, and numbers at addresses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

f32, f64, i32, i64, u32, u64 = np.float32, np.float64, np.int32, np.int64, np.uint32, np.uint64

inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Compile a function that kernels call, and nothing else does."""


@intrinsic
def select(typing: Any, condition: Any, a: Any, b: Any) -> Any:
    """`a if condition else b`, both worked out: no branch."""
    a, b = types.unliteral(a), types.unliteral(b)
    result = typing.unify_types(a, b)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        x, y = (context.cast(builder, v, t, result) for v, t in zip(args[1:], signature.args[1:], strict=True))
        return builder.select(args[0], x, y)

    return result(types.boolean, a, b), codegen


def _bits(source: Any, target: Any) -> Any:
    @intrinsic
    def view(typing: Any, x: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.bitcast(args[0], context.get_value_type(target))

        return target(source), codegen

    return view


as_f32, as_i32 = _bits(types.int32, types.float32), _bits(types.float32, types.int32)


def _numbers(dtype: Any) -> Any:
    """`view(address, at)`: a pointer to numbers in memory, from number `at` on.

    An array would say as much, but a function with many of those compiles slowly.
    """

    @intrinsic
    def view(typing: Any, address: Any, at: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = builder.inttoptr(args[0], context.get_value_type(dtype).as_pointer())
            return builder.gep(pointer, [args[1]])

        return types.CPointer(dtype)(types.uint64, types.int64), codegen

    return view


f64s, f32s = _numbers(types.float64), _numbers(types.float32)
i64s, u64s, u32s = _numbers(types.int64), _numbers(types.uint64), _numbers(types.uint32)
flags = _numbers(types.uint8)


# -- called by CPython, with objects ------------------------------------------------------------------------------

boxed = types.ExternalFunction("PyLong_FromLongLong", types.uint64(types.int64))
release = types.ExternalFunction("PyEval_SaveThread", types.uint64())
acquire = types.ExternalFunction("PyEval_RestoreThread", types.void(types.uint64))
_HEAD = object.__basicsize__ // 8


@inner
def numbers_of(array: Any) -> Any:
    """The address of the numbers of an array object: what follows its head (`PyArrayObject` of NumPy's C interface)."""
    return u64s(array, i64(_HEAD))[0]
