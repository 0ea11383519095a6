"""Random words and variates in JAX, and the array forms that XLA compiles well; 32-bit numbers only.

Words and variates equal `taskspec.language.draws`, to the bit. XLA computes a product and the sum that it feeds with one
rounding, a quotient by a constant as a product, and a quotient by a root as one by `rsqrt`, so values that must be
rounded in between pass through `Rounding`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import jax.numpy as jnp
from jax import lax

from taskspec.base.arrays import AnyArray
from taskspec.language.draws import (
    GAMMA_WORDS,
    LARGEST_ALPHA,
    LEAST,
    LN2,
    LN2_HIGH,
    LN2_LOW,
    LOG2E,
    SMALLEST_ALPHA,
    C,
    E,
    L,
    S,
    poisson_terms,
)
from taskspec.language.draws.threefry import PARITY, ROTATIONS
from taskspec.language.expressions.batch import Runtime

xp: Any = jnp
"""The array library of entries of `taskspec.language.expressions.variates`."""
BIAS = 1 << 31
"""Words are compared as int32, less this, where ints are signed."""
UNROLLED = 8
"""Blocks of words up to this many are worked out one by one, more of them as one array."""
CHAIN = 32
"""Tables up to this many cells are chains of selects, which stay within one loop; a gather does not."""


# -- words --------------------------------------------------------------------------------------------------------


def threefry(k0: AnyArray, k1: AnyArray, c0: AnyArray, c1: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Threefry-2x32-20, elementwise on uint32 arrays."""
    keys = (k0, k1, k0 ^ k1 ^ jnp.uint32(PARITY))
    x0 = c0 + k0
    x1 = c1 + k1
    for i in range(1, 6):
        for r in ROTATIONS[~i & 1]:
            x0 = x0 + x1
            x1 = ((x1 << jnp.uint32(r)) | (x1 >> jnp.uint32(32 - r))) ^ x0
        x0 = x0 + keys[i % 3]
        x1 = x1 + keys[(i + 1) % 3] + jnp.uint32(i)
    return x0, x1


class RandomWords:
    """The random words of a phase for many lanes: word k is half k & 1 of block k >> 1."""

    def __init__(self, k0: AnyArray, k1: AnyArray, n: AnyArray, phase: int, count: int) -> None:
        self._blocks: list[tuple[AnyArray, AnyArray]] = []
        self._rows: tuple[AnyArray, AnyArray] | None = None
        slots = (count + 1) >> 1
        if slots <= UNROLLED:
            self._blocks = [threefry(k0, k1, n, jnp.uint32(phase + slot)) for slot in range(slots)]
        else:
            slot = jnp.arange(slots, dtype=jnp.uint32)[:, None] + jnp.uint32(phase)
            self._rows = threefry(k0, k1, n, slot)

    def word(self, k: int) -> AnyArray:
        """Word k of every lane: uint32 (N,)."""
        if self._rows is None:
            return self._blocks[k >> 1][k & 1]
        return self._rows[k & 1][k >> 1]

    def signed(self, k: int) -> AnyArray:
        """Word k less 2**31, as int32."""
        return lax.bitcast_convert_type(self.word(k) ^ jnp.uint32(BIAS), jnp.int32)

    def rows(self, first: int, count: int) -> AnyArray:
        """Words first, first + 1, ...: uint32 (count, N)."""
        if self._rows is None or first & 1:
            return jnp.stack([self.word(first + k) for k in range(count)])
        place = slice(first >> 1, (first + count + 1) >> 1)
        return jnp.stack([half[place] for half in self._rows], 1).reshape(-1, self._rows[0].shape[-1])[:count]


# -- float32 polynomials ------------------------------------------------------------------------------------------


def _bits(x: AnyArray) -> AnyArray:
    return lax.bitcast_convert_type(x, jnp.int32)


def _real(bits: AnyArray) -> AnyArray:
    return lax.bitcast_convert_type(bits, jnp.float32)


class Rounding:
    """Round a value to float32 before anything else is done with it, as in NumPy.

    A negative zero is added, which changes nothing, and which the compiler cannot tell from another number: bits 0 and 2
    of a square are never both set, for a square is 0, 1 or 4 modulo 8. If a product is fused with a sum, then with this
    one. The number squared is one of the random words that the values follow from, so that it is known while compiling
    only where they are, too.
    """

    def __init__(self, words: AnyArray) -> None:
        square = words * words
        zero = square & (square >> 2) & 1
        self._zero = lax.bitcast_convert_type(zero ^ jnp.uint32(1 << 31), jnp.float32)

    def __call__(self, x: AnyArray) -> AnyArray:
        return x + self._zero

    def horner(self, z: AnyArray, coefficients: Sequence[Any]) -> AnyArray:
        """Evaluate a polynomial in z, the constant coefficient first."""
        *rest, value = coefficients
        for c in reversed(rest):
            value = c + self(z * value)
        return value


def _split(x: AnyArray, rounded: Rounding) -> tuple[AnyArray, AnyArray]:
    bits = _bits(x) - jnp.int32(0x3F3504F3)
    m = _real((bits & jnp.int32(0x007FFFFF)) + jnp.int32(0x3F3504F3))
    s = (m - 1) / (m + 1)
    return bits >> 23, rounded(s * rounded.horner(s * s, (2, *L)))


def log(x: AnyArray, rounded: Rounding) -> AnyArray:
    e, log_m = _split(x, rounded)
    return rounded(e.astype(jnp.float32) * LN2) + log_m


def exp(x: AnyArray, rounded: Rounding) -> AnyArray:
    y = jnp.minimum(jnp.maximum(x, -87), 88)
    k = jnp.rint(y * LOG2E)
    f = (y - k * LN2_HIGH) - rounded(k * LN2_LOW)
    power = _real((k.astype(jnp.int32) + 127) << 23)
    return jnp.where(x < -87, 0, (rounded((f * f) * rounded.horner(f, E)) + f + 1) * power)


def uniforms(words: AnyArray) -> AnyArray:
    return (words >> 8).astype(jnp.int32).astype(jnp.float32) * 2**-24


def exponentials(words: AnyArray, rounded: Rounding | None = None) -> AnyArray:
    rounded = rounded or Rounding(words)
    v = (~words >> 1).astype(jnp.int32).astype(jnp.float32) + 0.5
    e, log_m = _split(v, rounded)
    return rounded((31 - e).astype(jnp.float32) * LN2) - log_m


def normal_pair(radius: AnyArray, angle: AnyArray) -> tuple[AnyArray, AnyArray]:
    rounded = Rounding(radius)
    r = jnp.sqrt(exponentials(radius, rounded) * 2)
    x = lax.bitcast_convert_type(angle << 1, jnp.int32).astype(jnp.float32) * 2**-31
    z = x * x
    sine = x * rounded.horner(z, S)
    cosine = rounded.horner(z, C)
    sign = lax.bitcast_convert_type(angle & jnp.uint32(1 << 31), jnp.int32)
    return rounded(r * _real(_bits(cosine) ^ sign)), rounded(r * sine)


# -- variates of `taskspec.language.draws`, with the lanes last ------------------------------------------------------


def normals(words: AnyArray, n: int) -> AnyArray:
    a, b = normal_pair(words[0::2], words[1::2])
    return jnp.stack([a, b], 1).reshape(-1, a.shape[-1])[:n]


def bernoullis(words: AnyArray, p: AnyArray) -> AnyArray:
    return uniforms(words) < p


def indices(words: AnyArray, n: AnyArray) -> AnyArray:
    """(word * n) >> 32 in 32 bits, for 0 < n < 2**31: from products of 16-bit halves."""
    n = jnp.asarray(n).astype(jnp.uint32)
    (a, b), (c, d) = (words >> 16, words & 0xFFFF), (n >> 16, n & 0xFFFF)
    middle = a * d + ((b * d) >> 16)
    low = (middle & 0xFFFF) + b * c
    return (a * c + (middle >> 16) + (low >> 16)).astype(jnp.int32)


def categoricals(words: AnyArray, thresholds: AnyArray) -> AnyArray:
    """Count the ascending thresholds (uint32) that are at most the word."""
    outcomes = jnp.searchsorted(thresholds, words.reshape(-1), side="right")
    return outcomes.astype(jnp.int32).reshape(words.shape)


def weighted_categoricals(words: AnyArray, weights: AnyArray) -> AnyArray:
    """Draw outcomes in proportion to weights (k, ...)."""
    rounded = Rounding(words[0])  # XLA adds up constants first
    partial = [jnp.where(weights[0] > 0, weights[0], 0)]
    for weight in weights[1:]:
        partial.append(rounded(partial[-1] + jnp.where(weight > 0, weight, 0)))
    target = uniforms(words) * partial[-1]
    reached = [(p <= target).astype(jnp.int32) for p in partial[:-1]]
    return sum(reached, jnp.zeros(target.shape, jnp.int32))


def poissons(words: AnyArray, rate: AnyArray, bound: float) -> AnyArray:
    """Draw counts at rates (...) of at most `bound`, each shared among its words (k, ...)."""
    rounded = Rounding(words[:1])
    share = jnp.minimum(jnp.where(rate > 0, rate, 0), bound)[None] / rounded(jnp.float32(len(words)))
    term = total = jnp.ones_like(share)
    sums = [total]
    for k in range(1, poisson_terms(bound) + 1):
        term = rounded(term * share / rounded(jnp.float32(k)))
        total = total + term
        sums.append(total)
    target = uniforms(words) * total
    counts = sum(((s <= target).astype(jnp.int32) for s in sums[:-1]), jnp.zeros(target.shape, jnp.int32))
    return counts.sum(axis=0)


def permutations(words: AnyArray) -> AnyArray:
    return jnp.argsort(words, axis=0, stable=True).astype(jnp.int32)


def dirichlets(words: AnyArray, alphas: AnyArray) -> AnyArray:
    """Gamma variates over their sum, in logarithms."""
    value, shrink, rounded = _gamma_parts(words, alphas)
    ratio = jnp.maximum(value / value.max(axis=0), LEAST)
    logs = log(ratio, rounded) - shrink
    parts = rounded(exp(logs - logs.max(axis=0), rounded))
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    shares = parts / total
    return jnp.where(shares > LEAST, shares, 0)


def gammas(words: AnyArray, alphas: AnyArray) -> AnyArray:
    value, shrink, rounded = _gamma_parts(words, alphas)
    values = rounded(value * rounded(exp(-shrink, rounded)))
    return jnp.where(values > LEAST, values, 0)


def _gamma_parts(words: AnyArray, alphas: AnyArray) -> tuple[AnyArray, AnyArray, Rounding]:
    """g and s of gamma variates g exp(-s) by Marsaglia and Tsang, and what rounds for them."""
    words = words.reshape(-1, GAMMA_WORDS, words.shape[-1])
    alpha = jnp.where(alphas > SMALLEST_ALPHA, alphas, SMALLEST_ALPHA)
    alpha = jnp.where(alpha < LARGEST_ALPHA, alpha, LARGEST_ALPHA)
    rounded = Rounding(words[:, 0])
    small = alpha < 1
    d = jnp.where(small, alpha + 1, alpha) - 1 / 3
    scale = (1 / 3) / rounded(jnp.sqrt(d))
    x = (*normal_pair(words[:, 0], words[:, 1]), *normal_pair(words[:, 2], words[:, 3]))
    value = d
    for i in (3, 2, 1, 0):
        candidate, accepted = _attempt(x[i], words[:, 4 + i], d, scale, rounded)
        value = jnp.where(accepted, candidate, value)
    return value, jnp.where(small, exponentials(words[:, 8]) / rounded(alpha), 0), rounded


def _attempt(x: AnyArray, word: AnyArray, d: AnyArray, scale: AnyArray, rounded: Rounding) -> tuple[AnyArray, AnyArray]:
    root = rounded(x * scale) + 1
    positive = root > 0
    root = jnp.where(positive, root, 1)
    v = rounded(root * root * root)
    margin = rounded(0.5 * x * x) + rounded(d * ((1 - v) + log(v, rounded)))
    return d * v, positive & (exponentials(word) + margin > 0)


# -- array forms --------------------------------------------------------------------------------------------------


class JaxRuntime(Runtime):
    """Short vectors are indexed, and their elements replaced, by chains of selects."""

    def __init__(self) -> None:
        super().__init__(jnp, jnp.int32, jnp.float32)

    def look_up(self, table: AnyArray, i: AnyArray, axis: int) -> AnyArray:
        """Look up cells of a constant table at the indices i (N,): (N,), or (k, N) for a table (k, n)."""
        if table.shape[-1] > CHAIN:
            return jnp.take(table, i, axis=axis, mode="clip")
        if axis == 0:
            return _chain([table[k] for k in range(len(table))], i)
        return jnp.stack([self.look_up(row, i, 0) for row in table])

    def index(self, x: AnyArray, i: AnyArray) -> AnyArray:
        if x.ndim != 2 or i.ndim != 1 or x.shape[0] > CHAIN:
            return super().index(x, i)
        return _chain(list(x), i)

    def as_real(self, x: AnyArray) -> AnyArray:
        """For XLA the product of a converted condition is 0 wherever the condition fails, times infinity and nan as well."""
        x = jnp.asarray(x)
        if x.dtype.kind == "b":
            return jnp.where(x, self.real(1), self.real(0))
        return x.astype(self.real)

    def div(self, a: AnyArray, b: AnyArray) -> AnyArray:
        """Divide with one rounding, as NumPy.

        XLA turns quotients by constants, by roots and of quotients into products, which are rounded twice. It does not see
        through selects that depend on both operands.
        """
        unknown = (a != a) | (b != b)
        quotient = a / jnp.where(unknown, jnp.nan, b)
        return jnp.where(unknown, jnp.nan, quotient)

    def cumsum(self, x: AnyArray) -> AnyArray:
        """Without the 0.0 that JAX's own begins with, and left to right where that is not too long."""
        if x.shape[0] > CHAIN:
            return lax.associative_scan(jnp.add, x, axis=0)
        return jnp.stack(list(accumulate(x)))

    def argsort(self, x: AnyArray) -> AnyArray:
        """Sort stably; NumPy 1 and JAX have different arguments for it."""
        return jnp.argsort(x, axis=0).astype(self.int)

    def floordiv(self, a: AnyArray, b: AnyArray) -> AnyArray:
        """Zeros with the sign of the quotient, as C and Python have them."""
        floor = super().floordiv(a, b)
        if floor.dtype.kind != "f":
            return floor
        return jnp.where(floor == 0, jnp.copysign(0.0, jnp.copysign(1.0, a) * jnp.copysign(1.0, b)), floor)

    def mod(self, a: AnyArray, b: AnyArray) -> AnyArray:
        """Zeros with the sign of the divisor."""
        rest = super().mod(a, b)
        if rest.dtype.kind != "f":
            return rest
        return jnp.where(rest == 0, jnp.copysign(0.0, b), rest)

    def put(self, x: AnyArray, i: AnyArray, value: AnyArray) -> AnyArray:
        """Row by row, so that XLA sees what each row is made of; else it works out all of them for every use of one."""
        if x.ndim != 2 or x.shape[0] > CHAIN:
            return super().put(x, i, value)
        return jnp.stack([jnp.where(i == k, value, row) for k, row in enumerate(x)])


def _chain(cells: Sequence[AnyArray], i: AnyArray) -> AnyArray:
    picked = jnp.broadcast_to(cells[-1], jnp.broadcast_shapes(cells[-1].shape, i.shape))
    for k, cell in enumerate(cells[:-1]):
        picked = jnp.where(i == k, cell, picked)
    return picked


RUNTIME = JaxRuntime()
