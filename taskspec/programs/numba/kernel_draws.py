"""Random words and variates in generated kernels: `taskspec.language.draws`, operation for operation.

No branches, no calls of a C library, no look-ups: a loop over lanes of such code becomes one over vectors of lanes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from taskspec.language.draws import LARGEST_ALPHA, LEAST, SMALLEST_ALPHA
from taskspec.language.draws.threefry import PARITY, ROTATIONS
from taskspec.programs.numba.runtime import apart, as_f32, as_i32, f32, f64, i32, i64, inner, part, select, u32, u64

# -- words --------------------------------------------------------------------------------------------------------


@intrinsic
def threefry(typing: Any, k0: Any, k1: Any, c0: Any, c1: Any) -> Any:
    """Threefry-2x32-20 of one block (see `draws.threefry`), as instructions: as statements it compiles slowly."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        def number(n: int) -> Any:
            return context.get_constant(types.uint32, n)

        add = builder.add
        xor = builder.xor
        keys = (args[0], args[1], xor(xor(args[0], args[1]), number(PARITY)))
        x0 = add(args[2], keys[0])
        x1 = add(args[3], keys[1])
        for i in range(1, 6):
            for r in ROTATIONS[~i & 1]:
                x0 = add(x0, x1)
                x1 = xor(builder.or_(builder.shl(x1, number(r)), builder.lshr(x1, number(32 - r))), x0)
            x0 = add(x0, keys[i % 3])
            x1 = add(add(x1, keys[(i + 1) % 3]), number(i))
        return context.make_tuple(builder, signature.return_type, (x0, x1))

    words = (types.uint32,) * 4
    return types.UniTuple(types.uint32, 2)(*words), codegen


@inner
def step_words(n: Any, words: Any, width: Any, slots: Any, k0: Any, k1: Any, steps: Any) -> None:
    """Words 0 to 2 slots - 1 of the present step of n lanes, a row of `width` for each."""
    for slot in range(slots):
        first = part(words, 2 * slot * width)
        second = part(words, (2 * slot + 1) * width)
        for j in range(n):
            first[j], second[j] = threefry(k0[j], k1[j], steps[j], u32(slot))


@inner
def reset_words(m: Any, lanes: Any, words: Any, width: Any, slots: Any, k0: Any, k1: Any, episodes: Any) -> None:
    """Words of the next reset of m lanes."""
    for slot in range(slots):
        first = part(words, 2 * slot * width)
        second = part(words, (2 * slot + 1) * width)
        for i in range(m):
            j = u64(lanes[i])
            first[i], second[i] = threefry(k0[j], k1[j], episodes[j], u32(slot + 0x80000000))


# -- float32 polynomials, as in taskspec.language.draws -----------------------------------------------------------------


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
def normals(n: Any, words: Any, width: Any, size: Any) -> None:
    """Replace `size` rows of words by standard normals in float32."""
    for k in range(0, size, 2):
        _make_normals(n, part(words, k * width), part(words, (k + 1) * width))


@apart
def _make_normals(n: Any, radius: Any, angle: Any) -> None:
    for j in range(n):
        a, b = _pair(radius[j], angle[j])
        radius[j] = u32(as_i32(a))
        angle[j] = u32(as_i32(b))


@inner
def exponentials(n: Any, words: Any, width: Any, size: Any) -> None:
    """Replace `size` rows of words by exponential variates."""
    for k in range(size):
        row = part(words, k * width)
        for j in range(n):
            row[j] = u32(as_i32(exponential32(row[j])))


# -- variates, a word at a time -----------------------------------------------------------------------------------


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
    """Count the ascending thresholds that are at most the word."""
    low = 0
    high = len(table)
    while low < high:
        middle = (low + high) >> 1
        if table[middle] <= word:
            low = middle + 1
        else:
            high = middle
    return low


@inner
def weighted(word: Any, weights: Any) -> Any:
    """Draw an outcome in proportion to float32 weights (a tuple)."""
    total = f32(0)
    for w in weights:
        total = total + select(f32(w) > f32(0), f32(w), f32(0))
    target = uniform32(word) * total
    partial = f32(0)
    outcome = i64(0)
    for w in weights:  # an index might be out of range, for all that Numba knows, and raise an exception
        partial = partial + select(f32(w) > f32(0), f32(w), f32(0))
        outcome += select(partial <= target, 1, 0)
    return min(outcome, i64(len(weights) - 1))


@inner
def poisson(words: Any, rate: Any, bound: Any, terms: Any) -> Any:
    """Draw a count at a rate of at most `bound`, shared among the words (a tuple)."""
    share = min(select(f32(rate) > f32(0), f32(rate), f32(0)), f32(bound)) / f32(len(words))
    total = term = f32(1)
    for k in range(1, terms + 1):
        term = term * share / f32(k)
        total = total + term
    count = 0
    for word in words:
        target = uniform32(word) * total
        term = f32(1)
        partial = f32(1)
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
def gamma_parts(w: Any, alpha: Any) -> Any:
    """g and s of a gamma variate g exp(-s) of unit scale, from nine words (a tuple); s is 0 unless alpha < 1."""
    shape = select(f32(alpha) > f32(SMALLEST_ALPHA), f32(alpha), f32(SMALLEST_ALPHA))
    shape = select(shape < f32(LARGEST_ALPHA), shape, f32(LARGEST_ALPHA))
    small = shape < f32(1)
    d = select(small, shape + f32(1), shape) - f32(1 / 3)
    scale = f32(1 / 3) / f32(math.sqrt(d))
    x0, x1 = _pair(w[0], w[1])
    x2, x3 = _pair(w[2], w[3])
    value = d
    for x, word in ((x3, w[7]), (x2, w[6]), (x1, w[5]), (x0, w[4])):
        candidate, accepted = _attempt(x, word, d, scale)
        value = select(accepted, candidate, value)
    return value, select(small, exponential32(w[8]) / shape, f32(0))


@inner
def gamma(w: Any, alpha: Any) -> Any:
    value, shrink = gamma_parts(w, alpha)
    sample = value * exp32(-shrink)
    return f64(select(sample > f32(LEAST), sample, f32(0)))


@inner
def log_share(value: Any, largest: Any, shrink: Any) -> Any:
    """Logarithm of a gamma variate, less a summand that is common to the gammas of a draw."""
    ratio = value / largest
    return log32(select(ratio > f32(LEAST), ratio, f32(LEAST))) - shrink


@inner
def share(part: Any, total: Any) -> Any:
    limited = part / total
    return f64(select(limited > f32(LEAST), limited, f32(0)))
