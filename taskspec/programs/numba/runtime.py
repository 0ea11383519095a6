"""Compilation of kernels, and the functions that they call: selects, operators, and lanes whose episodes end."""

from __future__ import annotations

import math
from math import inf, nan  # noqa: F401  # for generated code
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np
from numba import njit, types
from numba.extending import intrinsic

from taskspec.programs import run

f32 = np.float32
f64 = np.float64
i32 = np.int32
i64 = np.int64
u32 = np.uint32
u64 = np.uint64

# -- compilation --------------------------------------------------------------------------------------------------


def machine_code(source: str, machine: llvm.TargetMachine) -> bytes:
    """Compile a generated module to an object file, in which CPython can call the function `kernel`.

    The code raises no exceptions: what would report them is missing when it is loaded without Numba.
    """
    namespace: dict[str, Any] = {}
    run(source, "<taskspec kernel>", namespace)
    compiled = numba.cfunc(types.uint64(types.uint64, types.uint64), error_model="numpy")(namespace["kernel"])
    text = compiled.inspect_llvm()
    if "picklebuf" in text:  # Numba's name for the arguments of an exception
        raise AssertionError(f"a kernel that may raise an exception:\n{source}")
    module = llvm.parse_assembly(text)
    module.get_function(compiled.native_name).name = "kernel"
    return machine.emit_object(module)


inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Compile a function that only kernels call."""


def apart(function: Any) -> Any:
    """Compile with the promise that no two array arguments share memory, so that loops need not check."""
    compiled = inner(function)
    compiler: Any = getattr(compiled, "_compiler", None)
    default_flags = getattr(compiler, "_customize_flags", None)
    if default_flags is not None:  # private to Numba, hence optional

        def without_aliases(flags: Any) -> Any:
            flags = default_flags(flags)
            flags.noalias = True
            return flags

        compiler._customize_flags = without_aliases
    return compiled


# -- building blocks: selects without branches, and numbers at addresses ------------------------------------------


@intrinsic
def select(typing: Any, condition: Any, a: Any, b: Any) -> Any:
    """Return `a if condition else b` without a branch: both are evaluated."""
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


def _numbers(dtype: Any) -> Any:
    """`view(address, at)`: a pointer to numbers in memory, from number `at` on."""

    @intrinsic
    def view(typing: Any, address: Any, at: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = builder.inttoptr(args[0], context.get_value_type(dtype).as_pointer())
            return builder.gep(pointer, [args[1]])

        return types.CPointer(dtype)(types.uint64, types.int64), codegen

    return view


f64s = _numbers(types.float64)
f32s = _numbers(types.float32)
i64s = _numbers(types.int64)
u64s = _numbers(types.uint64)
u32s = _numbers(types.uint32)
flags = _numbers(types.uint8)


# -- called by CPython, with objects ------------------------------------------------------------------------------

boxed = types.ExternalFunction("PyLong_FromLongLong", types.uint64(types.int64))
release = types.ExternalFunction("PyEval_SaveThread", types.uint64())
acquire = types.ExternalFunction("PyEval_RestoreThread", types.void(types.uint64))
_HEAD = object.__basicsize__ // 8


@inner
def numbers_of(array: Any) -> Any:
    """Return the address of the numbers of an array object: what follows its head (`PyArrayObject` of NumPy's C
    interface).
    """
    return u64s(array, i64(_HEAD))[0]


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
    """Return the exact quotient rounded down, as Python and NumPy do; a / b may have been rounded up."""
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
    """Return the remainder with the divisor's sign; where both are finite it is exact, as C's fmod is."""
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


@inner
def gather(n: Any, flags: Any, lanes: Any) -> Any:
    """Return the numbers of the lanes whose flag is set, and how many they are; `lanes` has room for n + 1."""
    m: Any = 0
    for j in range(n):
        lanes[m] = j
        m += i64(flags[j])
    return m


def _keeper(numbers: Any) -> Any:
    @inner
    def keep(m: Any, lanes: Any, rows: Any, every: Any, first: Any, n: Any, seen: Any, final: Any) -> None:
        for k in range(rows):
            a = numbers(seen, k * every + first)
            b = numbers(final, k * every + first)
            for i in range(m):
                j = u64(lanes[i])
                b[j] = a[j]

    return keep


keep_reals = _keeper(f32s)
"""Copy rows of float32 observations of some lanes from `seen` to `final`."""
keep_ints = _keeper(i64s)
"""Copy rows of int64 observations."""


@inner
def show(n: Any, reals: Any, width: Any, number: Any, size: Any, seen: Any, row: Any, every: Any, first: Any) -> None:
    """Copy rows of drawn float32 numbers into rows of observations."""
    for k in range(size):
        a = f32s(reals, (number + k) * width)
        b = f32s(seen, (row + k) * every + first)
        for j in range(n):
            b[j] = a[j]


@inner
def show_some(
    m: Any, lanes: Any, reals: Any, width: Any, number: Any, size: Any, seen: Any, row: Any, every: Any, first: Any,
    n: Any,
) -> None:  # fmt: skip
    for k in range(size):
        a = f32s(reals, (number + k) * width)
        b = f32s(seen, (row + k) * every + first)
        for i in range(m):
            b[u64(lanes[i])] = a[i]
