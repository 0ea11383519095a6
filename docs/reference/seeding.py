"""The contract of docs/reference/seeding.md as a program: the random words, and the real draws made of them.

It imports nothing of taskspec, and the tests compare every backend with it. Floats are float32, each operation rounded once, in
the order written here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

STEP, RESET, CONSTANT = 0, 2**31, 2**31 + 2**30


def words(seed: int, phase: int, n: int, count: int) -> list[int]:
    """The first words of step or reset number n, or of the constant whose name has the CRC-32 n."""
    key = [seed % 2**32, seed // 2**32 % 2**32]
    key.append(key[0] ^ key[1] ^ 0x1BD11BDA)
    found: list[int] = []
    for slot in range((count + 1) // 2):
        x, y = (n + key[0]) % 2**32, (slot + phase + key[1]) % 2**32
        for i in range(20):
            turn = [13, 15, 26, 6, 17, 29, 16, 24][i % 8]
            x = (x + y) % 2**32
            y = (y << turn | y >> 32 - turn) % 2**32 ^ x
            if i % 4 == 3:
                k = i // 4 + 1
                x, y = (x + key[k % 3]) % 2**32, (y + key[(k + 1) % 3] + k) % 2**32
        found += [x, y]
    return found[:count]


F = np.float32  # rounds to nearest, halves to even


def polynomial(x: F, *coefficients: float) -> F:
    """c0 + x * (c1 + x * (c2 + ...))"""
    *rest, value = map(F, coefficients)
    for c in reversed(rest):
        value = c + x * value
    return value


def split(x: F) -> tuple[F, F]:
    """e and log(m) of x = m * 2**e, with m from sqrt(1/2) to sqrt(2)."""
    i = int(F(x).view(np.int32)) - 0x3F3504F3
    m = np.int32((i & 0x007FFFFF) + 0x3F3504F3).view(F)
    s = (m - F(1)) / (m + F(1))
    return F(i >> 23), s * polynomial(s * s, 2, 0.66666776, 0.39977533, 0.29872006)


def log(x: F) -> F:
    e, log_m = split(x)
    return e * F(0.693147181) + log_m


def exp(x: F) -> F:
    y = min(max(x, F(-87)), F(88))
    k = np.rint(y * F(1.44269504))
    f = (y - k * F(0.693359375)) - k * F(-0.000212194440)
    p = polynomial(f, 0.5, 0.16666518, 0.041666206, 0.008368954, 0.0013950604)
    return F(0) if x < F(-87) else ((f * f) * p + f + F(1)) * F(2.0**k)


def exponential(w: int) -> F:
    e, log_m = split(F((w ^ 2**32 - 1) >> 1) + F(0.5))
    return (F(31) - e) * F(0.693147181) - log_m


def normals(v: int, w: int) -> tuple[F, F]:
    r = np.sqrt(exponential(v) * F(2))
    signed = (w * 2 + 2**31) % 2**32 - 2**31
    x = F(signed) * F(2**-31)
    q = x * x
    sine = x * polynomial(q, 1.5707963, -0.64596337, 0.079688482, -0.0046722279, 0.00015082053)
    cosine = polynomial(q, 0.99999994, -1.2336982, 0.25365075, -0.020810629, 0.00085819111)
    return r * (-cosine if w >= 2**31 else cosine), r * sine


def gamma(w: Sequence[int], alpha: float) -> tuple[F, F]:
    """Marsaglia and Tsang (2000), with four tries, from nine words: g and s of the variate g * exp(-s)."""
    a = min(max(F(alpha), F(2**-100)), F(2**100))
    d = (a + F(1) if a < F(1) else a) - F(1 / 3)
    scale, value = F(1 / 3) / np.sqrt(d), d
    for x, word in reversed(list(zip([*normals(w[0], w[1]), *normals(w[2], w[3])], w[4:8], strict=True))):
        root = x * scale + F(1)
        cube = root * root * root
        if root > 0 and exponential(word) + (F(0.5) * x * x + d * ((F(1) - cube) + log(cube))) > 0:
            value = d * cube
    return value, exponential(w[8]) / a if a < F(1) else F(0)


def dirichlet(w: Sequence[int], alpha: Sequence[float]) -> list[F]:
    """Gamma variates over their sum; in logarithms, since those of small concentrations are too small for float32."""
    pairs = [gamma(w[9 * i : 9 * i + 9], a) for i, a in enumerate(alpha)]
    largest = max(g for g, _ in pairs)
    logs = [log(max(g / largest, F(2**-126))) - s for g, s in pairs]
    parts = [exp(x - max(logs)) for x in logs]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return [part / total if part / total > F(2**-126) else F(0) for part in parts]


def truncated(u: float, low: float, high: float) -> float:
    """A standard normal between bounds, from a uniform number: the inverse of its distribution function."""
    if low + high > 0:
        return -truncated(u, -high, -low)
    bottom, top = distribution(low), distribution(high)
    p = bottom + u * (top - bottom)
    return quantile(p) if p > 0 else high


def horner(x: float, *coefficients: float) -> float:
    """The first coefficient belongs to the highest power."""
    value = coefficients[0]
    for c in coefficients[1:]:
        value = value * x + c
    return value


def distribution(x: float) -> float:
    """The fit of erfc in Numerical Recipes."""
    z = abs(x) * math.sqrt(0.5)
    t = 1 / (1 + 0.5 * z)
    fit = horner(t, 0.17087277, -0.82215223, 1.48851587, -1.13520398, 0.27886807, -0.18628806, 0.09678418, 0.37409196,
                 1.00002368, -1.26551223)  # fmt: skip
    tail = 0.5 * t * math.exp(fit - z * z)
    return tail if x < 0 else 1 - tail


def quantile(p: float) -> float:
    """Acklam's approximation of the inverse of a normal distribution function."""
    rest = min(p, 1 - p)
    if rest < 0.02425:
        s = math.sqrt(-2 * math.log(rest))
        above = horner(s, -0.007784894002430293, -0.3223964580411365, -2.400758277161838, -2.549732539343734,
                       4.374664141464968, 2.938163982698783)  # fmt: skip
        below = horner(s, 0.007784695709041462, 0.3224671290700398, 2.445134137142996, 3.754408661907416, 1)
        return above / below if p < 0.5 else -above / below
    q = p - 0.5
    above = horner(q * q, -39.69683028665376, 220.9460984245205, -275.9285104469687, 138.357751867269, -30.66479806614716,
                   2.506628277459239)  # fmt: skip
    below = horner(
        q * q, -54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572, 1
    )
    return above * q / below
