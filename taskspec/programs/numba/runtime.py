"""Compilation of kernels, and the functions that they call: selects, pointers, operators, and lanes whose episodes end."""

from __future__ import annotations

import math
from math import inf, nan  # noqa: F401  # for generated code
from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

f32 = np.float32
f64 = np.float64
i32 = np.int32
i64 = np.int64
u32 = np.uint32
u64 = np.uint64

# -- compilation --------------------------------------------------------------------------------------------------

kernel = njit(cache=True, nogil=True, error_model="numpy")
"""Compile a function that Python calls."""
inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Compile a function that only kernels call."""


def apart(function: Any) -> Any:
    """Compile with the promise that no two pointers share memory: loops of many rows do not become vector code without it."""
    dispatcher = inner(function)
    compiler: Any = getattr(dispatcher, "_compiler", None)
    default_flags = getattr(compiler, "_customize_flags", None)
    if default_flags is not None:  # private to Numba, hence optional

        def without_aliases(flags: Any) -> Any:
            flags = default_flags(flags)
            flags.noalias = True
            return flags

        compiler._customize_flags = without_aliases
    return dispatcher


# -- selects without branches, and floats as bits -----------------------------------------------------------------


@intrinsic
def select(typing: Any, condition: Any, a: Any, b: Any) -> Any:
    """Select `a if condition else b` without a branch: both are evaluated."""
    a = types.unliteral(a)
    b = types.unliteral(b)
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


as_f32 = _bits(types.int32, types.float32)
as_i32 = _bits(types.float32, types.int32)


# -- pointers: a row as an argument of a loop, which compiles sooner than an array, and whose references are not counted ---


def _pointer(dtype: Any) -> Any:
    """`numbers(source, at)`: a pointer to number `at` of an array or behind a pointer, as one to a type (None: the same)."""

    @intrinsic
    def numbers(typing: Any, source: Any, at: Any) -> Any:
        result = types.CPointer(dtype or source.dtype)

        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            data = args[0]
            if isinstance(source, types.Array):
                data = context.make_array(source)(context, builder, data).data
            data = builder.bitcast(data, context.get_value_type(result))
            return builder.gep(data, [args[1]])

        return result(source, types.int64), codegen

    return numbers


part = _pointer(None)
f64s = _pointer(types.float64)
f32s = _pointer(types.float32)
i64s = _pointer(types.int64)
u32s = _pointer(types.uint32)
flags = _pointer(types.uint8)


# -- operators of more than one expression; sine and cosine are polynomials, for speed ----------------------------

INT_MAX = 2147483647.0


@inner
def floordiv_int(a: Any, b: Any) -> Any:
    d = select(b == 0, 1, b)
    q = a // d
    return select(b == 0, 0, q)


@inner
def mod_int(a: Any, b: Any) -> Any:
    d = select(b == 0, 1, b)
    return select(b == 0, 0, a % d)


@inner
def floordiv_real(a: Any, b: Any) -> Any:
    """Round the exact quotient down, as Python and NumPy do; a / b may have been rounded up."""
    if b == 0.0:
        return a / b
    if not (math.isfinite(a) and math.isfinite(b)):
        return math.nan
    rest = np.fmod(a, b)
    quotient = (a - rest) / b - select((rest != 0.0) & ((rest < 0.0) != (b < 0.0)), 1.0, 0.0)
    floor = np.floor(quotient)
    return select(quotient == 0.0, math.copysign(0.0, a / b), floor + select(quotient - floor > 0.5, 1.0, 0.0))


@inner
def mod_real(a: Any, b: Any) -> Any:
    """Remainder with the divisor's sign; where both are finite it is exact, as C's fmod is."""
    if b == 0.0 or not math.isfinite(a):
        return math.nan
    r = np.fmod(a, b)
    if r != 0.0 and ((r < 0.0) != (b < 0.0)):
        r += b
    if r == 0.0:
        return math.copysign(0.0, b)
    return r


@inner
def pow_(a: Any, b: Any) -> Any:
    return math.pow(a, b)


@inner
def min2(a: Any, b: Any) -> Any:
    return select((a <= b) | (b != b), a, b)


@inner
def max2(a: Any, b: Any) -> Any:
    return select((a >= b) | (b != b), a, b)


@inner
def _whole(x: Any) -> Any:
    x = select(x == x, x, 0.0)
    x = select(x > INT_MAX, INT_MAX, x)
    return i32(select(x < -INT_MAX, -INT_MAX, x))


@inner
def floor(x: Any) -> Any:
    return _whole(np.floor(x))


@inner
def ceil(x: Any) -> Any:
    return _whole(np.ceil(x))


@inner
def round_(x: Any) -> Any:
    return _whole(np.rint(x))


@inner
def _quarters(x: Any) -> Any:
    """x as a number of quarter turns, modulo 4, and the rest in [-pi/4, pi/4] (Cody and Waite, three parts)."""
    small = abs(x) < 1e15
    y = select(small, x, x - x)
    k = np.rint(y * 0.6366197723675814)
    rest = ((y - k * 1.5707963267341256) - k * 6.077100506303966e-11) - k * 2.0222662487959506e-21
    return k - 4.0 * np.floor(k * 0.25), rest


@inner
def _sine(r: Any) -> Any:
    """Coefficients of fdlibm."""
    z = r * r
    p = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06
        + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))  # fmt: skip
    return r + (z * r) * (-1.66666666666666324348e-01 + z * p)


@inner
def _cosine(r: Any) -> Any:
    z = r * r
    p = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05
        + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))  # fmt: skip
    h = 0.5 * z
    w = 1.0 - h
    return w + (((1.0 - w) - h) + z * z * p)


@inner
def sin(x: Any) -> Any:
    q, r = _quarters(x)
    value = select((q == 1.0) | (q == 3.0), _cosine(r), _sine(r))
    return select(x == 0.0, x, select(q >= 2.0, -value, value))  # -0.0 too


@inner
def cos(x: Any) -> Any:
    q, r = _quarters(x)
    value = select((q == 1.0) | (q == 3.0), _sine(r), _cosine(r))
    return select((q == 1.0) | (q == 2.0), -value, value)


# -- lanes whose episodes end -------------------------------------------------------------------------------------


@apart
def gather(n: Any, flags: Any, lanes: Any) -> Any:
    """Numbers of the lanes whose flag is set, and their count; `lanes` has room for n + 1."""
    m: Any = 0
    for j in range(n):
        lanes[m] = u32(j)
        m += i64(flags[j])
    return m


@inner
def keep(m: Any, lanes: Any, rows: Any, seen: Any, final: Any, pitch: Any) -> None:
    """Copy rows of observations of some lanes from `seen` to `final`."""
    for k in range(rows):
        a = part(seen, k * pitch)
        b = part(final, k * pitch)
        for i in range(m):
            j = u64(lanes[i])
            b[j] = a[j]


@inner
def show(n: Any, reals: Any, width: Any, size: Any, seen: Any, pitch: Any) -> None:
    """Copy rows of drawn numbers into rows of observations."""
    for k in range(size):
        a = part(reals, k * width)
        b = part(seen, k * pitch)
        for j in range(n):
            b[j] = a[j]


@inner
def show_some(m: Any, lanes: Any, reals: Any, width: Any, size: Any, seen: Any, pitch: Any) -> None:
    for k in range(size):
        a = part(reals, k * width)
        b = part(seen, k * pitch)
        for i in range(m):
            b[u64(lanes[i])] = a[i]
