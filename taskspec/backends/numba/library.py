"""What the names in generated kernels mean: scalar functions that compile to vector instructions.

No branches, no calls of a C library where a polynomial serves, no look-ups: a loop over lanes of such code becomes
one over vectors of lanes. The random words and the float32 functions are those of `taskspec.draws`, operation for operation.
"""

from __future__ import annotations

import math
from math import atan2, exp, inf, log, nan, sqrt, tan, tanh  # noqa: F401  # for generated code
from typing import Any

import numpy as np
from numba import carray, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

f32, f64, i32, i64, u32, u64 = np.float32, np.float64, np.int32, np.int64, np.uint32, np.uint64
INT_MAX = 2147483647.0

inner = njit(error_model="numpy", nogil=True)


# -- what Numba has no words for ----------------------------------------------------------------------------------


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


# -- random words -------------------------------------------------------------------------------------------------


@inner
def _mix(x0: Any, x1: Any, r: Any) -> Any:
    x0 = u32(x0 + x1)
    return x0, u32(u32(u32(x1 << u32(r)) | u32(x1 >> u32(32 - r))) ^ x0)


@inner
def _four(x0: Any, x1: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    x0, x1 = _mix(x0, x1, a)
    x0, x1 = _mix(x0, x1, b)
    x0, x1 = _mix(x0, x1, c)
    return _mix(x0, x1, d)


@inner
def threefry(k0: Any, k1: Any, c0: Any, c1: Any) -> Any:
    """Threefry-2x32-20 of one block (see `taskspec.draws.threefry`)."""
    k2 = u32(k0 ^ k1 ^ u32(0x1BD11BDA))
    x0, x1 = _four(u32(c0 + k0), u32(c1 + k1), 13, 15, 26, 6)
    x0, x1 = _four(u32(x0 + k1), u32(x1 + k2 + u32(1)), 17, 29, 16, 24)
    x0, x1 = _four(u32(x0 + k2), u32(x1 + k0 + u32(2)), 13, 15, 26, 6)
    x0, x1 = _four(u32(x0 + k0), u32(x1 + k1 + u32(3)), 17, 29, 16, 24)
    x0, x1 = _four(u32(x0 + k1), u32(x1 + k2 + u32(4)), 13, 15, 26, 6)
    return u32(x0 + k2), u32(x1 + k0 + u32(5))


@inner
def step_words(n: Any, words: Any, width: Any, slots: Any, k0: Any, k1: Any, steps: Any) -> None:
    """Words 0 to 2 slots - 1 of the present step of n lanes, a row of `width` for each."""
    for slot in range(slots):
        first, second = u32s(words, 2 * slot * width, n), u32s(words, (2 * slot + 1) * width, n)
        for j in range(n):
            first[j], second[j] = threefry(k0[j], k1[j], steps[j], u32(slot))


@inner
def reset_words(m: Any, lanes: Any, words: Any, width: Any, slots: Any, k0: Any, k1: Any, episodes: Any) -> None:
    """Words of the next reset of m lanes."""
    for slot in range(slots):
        first, second = u32s(words, 2 * slot * width, m), u32s(words, (2 * slot + 1) * width, m)
        for i in range(m):
            j = u64(lanes[i])
            first[i], second[i] = threefry(k0[j], k1[j], episodes[j], u32(slot + 0x80000000))


# -- float32 polynomials, as in taskspec.draws.polynomials --------------------------------------------------------


@inner
def _split(x: Any) -> Any:
    bits = i32(as_i32(x) - i32(0x3F3504F3))
    e = i32(bits >> i32(23))
    m = as_f32(i32(i32(bits & i32(0x007FFFFF)) + i32(0x3F3504F3)))
    s = (m - f32(1)) / (m + f32(1))
    z = s * s
    return e, s * (f32(2) + z * (f32(0.66666776) + z * (f32(0.39977533) + z * f32(0.29872006))))


@inner
def log32(x: Any) -> Any:
    e, log_m = _split(x)
    return f32(e) * f32(0.693147181) + log_m


@inner
def exp32(x: Any) -> Any:
    y = min(max(x, f32(-87)), f32(88))
    k = f32(np.rint(y * f32(1.44269504)))
    f = (y - k * f32(0.693359375)) - k * f32(-2.12194440e-4)
    p = f32(0.0083689540) + f * f32(0.0013950604)
    p = f32(0.5) + f * (f32(0.16666518) + f * (f32(0.041666206) + f * p))
    power = as_f32(i32(i32(i32(k) + i32(127)) << i32(23)))
    return select(x < f32(-87), f32(0), ((f * f) * p + f + f32(1)) * power)


@inner
def uniform32(word: Any) -> Any:
    return f32(i32(word >> u32(8))) * f32(2.0**-24)


@inner
def exponential32(word: Any) -> Any:
    v = f32(i32(u32(~word) >> u32(1))) + f32(0.5)
    e, log_m = _split(v)
    return f32(i32(i32(31) - e)) * f32(0.693147181) - log_m


@inner
def _pair(radius: Any, angle: Any) -> Any:
    r = f32(math.sqrt(exponential32(radius) * f32(2)))
    x = f32(i32(u32(angle << u32(1)))) * f32(2.0**-31)
    z = x * x
    sine = x * (f32(1.5707963) + z * (f32(-0.64596337) + z * (f32(0.079688482)
        + z * (f32(-0.0046722279) + z * f32(0.00015082053)))))  # fmt: skip
    cosine = f32(0.99999994) + z * (f32(-1.2336982) + z * (f32(0.25365075)
        + z * (f32(-0.020810629) + z * f32(0.00085819111))))  # fmt: skip
    cosine = as_f32(i32(as_i32(cosine) ^ i32(angle & u32(0x80000000))))
    return r * cosine, r * sine


@inner
def normals(n: Any, words: Any, out: Any, width: Any, first: Any, size: Any) -> None:
    """Standard normals `first` to `first + size` from the words of the same numbers, as float32 rows."""
    for k in range(first, first + size, 2):
        radius, angle = u32s(words, k * width, n), u32s(words, (k + 1) * width, n)
        a, b = f32s(out, k * width, n), f32s(out, (k + 1) * width, n)
        for j in range(n):
            a[j], b[j] = _pair(radius[j], angle[j])


@inner
def exponentials(n: Any, words: Any, out: Any, width: Any, first: Any, size: Any) -> None:
    for k in range(first, first + size):
        row, made = u32s(words, k * width, n), f32s(out, k * width, n)
        for j in range(n):
            made[j] = exponential32(row[j])


# -- draws, a word at a time --------------------------------------------------------------------------------------


@inner
def uniform(word: Any) -> Any:
    return f64(i32(word >> u32(8))) * 2.0**-24


@inner
def bernoulli(word: Any, p: Any) -> Any:
    return uniform32(word) < f32(p)


@inner
def index(word: Any, n: Any) -> Any:
    return i64(u64(u64(word) * u64(n)) >> u64(32))


@inner
def search(table: Any, word: Any) -> Any:
    """How many of the ascending thresholds are at most the word."""
    low, high = 0, len(table)
    while low < high:
        middle = (low + high) >> 1
        if table[middle] <= word:
            low = middle + 1
        else:
            high = middle
    return low


@inner
def weighted(word: Any, weights: Any) -> Any:
    """An outcome in proportion to float32 weights (a tuple)."""
    total = f32(0)
    for w in weights:
        total = total + select(f32(w) > f32(0), f32(w), f32(0))
    target, partial, outcome = uniform32(word) * total, f32(0), i64(0)
    for k in range(len(weights) - 1):
        w = f32(weights[k])
        partial = partial + select(w > f32(0), w, f32(0))
        outcome += select(partial <= target, 1, 0)
    return outcome


@inner
def poisson(words: Any, rate: Any, bound: Any, terms: Any) -> Any:
    """A count at a rate of at most `bound`, shared among the words (a tuple)."""
    share = min(select(f32(rate) > f32(0), f32(rate), f32(0)), f32(bound)) / f32(len(words))
    total = term = f32(1)
    for k in range(1, terms + 1):
        term = term * share / f32(k)
        total = total + term
    count = 0
    for word in words:
        target, term, partial = uniform32(word) * total, f32(1), f32(1)
        for k in range(1, terms + 1):
            count += select(partial <= target, 1, 0)
            term = term * share / f32(k)
            partial = partial + term
    return count


@inner
def _attempt(x: Any, word: Any, d: Any, scale: Any) -> Any:
    root = x * scale + f32(1)
    positive = root > f32(0)
    root = select(positive, root, f32(1))
    v = root * root * root
    margin = f32(0.5) * x * x + d * ((f32(1) - v) + log32(v))
    return d * v, positive & (exponential32(word) + margin > f32(0))


@inner
def gamma(w: Any, alpha: Any) -> Any:
    """A gamma variate of unit scale from nine words (a tuple)."""
    shape = max(f32(alpha), f32(2.0**-100))
    small = shape < f32(1)
    d = select(small, shape + f32(1), shape) - f32(1 / 3)
    scale = f32(1 / 3) / f32(math.sqrt(d))
    x0, x1 = _pair(w[0], w[1])
    x2, x3 = _pair(w[2], w[3])
    value = d
    for x, word in ((x3, w[7]), (x2, w[6]), (x1, w[5]), (x0, w[4])):
        candidate, accepted = _attempt(x, word, d, scale)
        value = select(accepted, candidate, value)
    shrink = select(small, exponential32(w[8]) / shape, f32(0))
    return f64(value * exp32(-shrink))


# -- operators ----------------------------------------------------------------------------------------------------


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
    if b == 0.0:
        return a / b
    if not (math.isfinite(a) and math.isfinite(b)):
        return math.nan
    return np.floor_divide(a, b)


@inner
def mod_real(a: Any, b: Any) -> Any:
    """The remainder with the divisor's sign; where both are finite it is exact, as C's fmod is."""
    if b == 0.0 or not math.isfinite(a):
        return math.nan
    r = np.fmod(a, b)
    if r != 0.0 and ((r < 0.0) != (b < 0.0)):
        r += b
    return math.copysign(0.0, b) if r == 0.0 else r


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
def position(i: Any, n: Any) -> Any:
    i = select(i < 0, i + n, i)
    return select(i < 0, 0, select(i > n - 1, n - 1, i))


@inner
def _quarters(x: Any) -> Any:
    """x as a number of quarter turns, modulo 4, and the rest in [-pi/4, pi/4] (Cody and Waite, three parts).

    The rest is exact to 1e-16 for |x| < 1e6, and beyond that to the precision of x itself.
    """
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
    return select(q >= 2.0, -value, value)


@inner
def cos(x: Any) -> Any:
    q, r = _quarters(x)
    value = select((q == 1.0) | (q == 3.0), _sine(r), _cosine(r))
    return select((q == 1.0) | (q == 2.0), -value, value)


# -- lanes that end -----------------------------------------------------------------------------------------------


@inner
def gather(n: Any, flags: Any, lanes: Any) -> Any:
    """The numbers of the lanes whose flag is set, and how many they are; `lanes` has room for n + 1."""
    m: Any = 0
    for j in range(n):
        lanes[m] = j
        m += i64(flags[j])
    return m


@inner
def keep_reals(m: Any, lanes: Any, rows: Any, every: Any, first: Any, n: Any, seen: Any, final: Any) -> None:
    """Copy rows of float32 observations of some lanes from `seen` to `final`."""
    for k in range(rows):
        a, b = f32s(seen, k * every + first, n), f32s(final, k * every + first, n)
        for i in range(m):
            j = u64(lanes[i])
            b[j] = a[j]


@inner
def keep_ints(m: Any, lanes: Any, rows: Any, every: Any, first: Any, n: Any, seen: Any, final: Any) -> None:
    for k in range(rows):
        a, b = i64s(seen, k * every + first, n), i64s(final, k * every + first, n)
        for i in range(m):
            j = u64(lanes[i])
            b[j] = a[j]


@inner
def show(n: Any, reals: Any, width: Any, number: Any, size: Any, seen: Any, row: Any, every: Any, first: Any) -> None:
    """Copy rows of drawn float32 numbers into rows of observations."""
    for k in range(size):
        a, b = f32s(reals, (number + k) * width, n), f32s(seen, (row + k) * every + first, n)
        for j in range(n):
            b[j] = a[j]


@inner
def show_some(
    m: Any,
    lanes: Any,
    reals: Any,
    width: Any,
    number: Any,
    size: Any,
    seen: Any,
    row: Any,
    every: Any,
    first: Any,
    n: Any,
) -> None:
    for k in range(size):
        a, b = f32s(reals, (number + k) * width, m), f32s(seen, (row + k) * every + first, n)
        for i in range(m):
            b[u64(lanes[i])] = a[i]
