"""Building blocks of generated kernels: selects without branches, and arrays over addresses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

f32, f64, i32, i64, u32, u64 = np.float32, np.float64, np.int32, np.int64, np.uint32, np.uint64

inner = njit(error_model="numpy", nogil=True)


@intrinsic
def select(typing: Any, condition: Any, a: Any, b: Any) -> Any:
    """`a if condition else b`, both worked out: no branch."""
    a, b = types.unliteral(a), types.unliteral(b)
    result = typing.unify_types(a, b)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        x, y = (context.cast(builder, v, t, result) for v, t in zip(args[1:], signature.args[1:], strict=True))
        return builder.select(args[0], x, y)

    return result(types.boolean, a, b), codegen


@intrinsic
def pointer(typing: Any, address: Any) -> Any:
    """An address as a pointer."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.uint64), codegen


def _bits(source: Any, target: Any) -> Any:
    @intrinsic
    def view(typing: Any, x: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.bitcast(args[0], context.get_value_type(target))

        return target(source), codegen

    return view


as_f32, as_i32 = _bits(types.int32, types.float32), _bits(types.float32, types.int32)


@inner
def f64s(address: Any, at: Any, n: Any) -> Any:
    """n float64 numbers in memory, from number `at` on."""
    return carray(pointer(u64(address + u64(at * 8))), (n,), np.float64)


@inner
def i64s(address: Any, at: Any, n: Any) -> Any:
    return carray(pointer(u64(address + u64(at * 8))), (n,), np.int64)


@inner
def u32s(address: Any, at: Any, n: Any) -> Any:
    return carray(pointer(u64(address + u64(at * 4))), (n,), np.uint32)


@inner
def f32s(address: Any, at: Any, n: Any) -> Any:
    return carray(pointer(u64(address + u64(at * 4))), (n,), np.float32)


@inner
def bools(address: Any, at: Any, n: Any) -> Any:
    return carray(pointer(u64(address + u64(at))), (n,), np.bool_)
