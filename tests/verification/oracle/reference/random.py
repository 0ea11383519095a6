"""Random words and what draws make of them, transcribed from `docs/reference/seeding.md`.

Reals are computed in float32, each operation rounded once.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np

from tests.verification.oracle.reference.values import Number, as_float

F = np.float32
WORD = 2**32
ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
PARITY = 0x1BD11BDA

STEP = 0
RESET = 2**31
INSTANCE = 2**31 + 2**30
GAMMA_WORDS = 9


def threefry(key: tuple[int, int], counter: tuple[int, int]) -> tuple[int, int]:
    """Threefry-2x32 with 20 rounds."""
    keys = (*key, key[0] ^ key[1] ^ PARITY)
    x = (counter[0] + keys[0]) % WORD
    y = (counter[1] + keys[1]) % WORD
    for group in range(5):
        for r in ROTATIONS[group % 2]:
            x = (x + y) % WORD
            y = ((y << r | y >> (32 - r)) % WORD) ^ x
        x = (x + keys[(group + 1) % 3]) % WORD
        y = (y + keys[(group + 2) % 3] + group + 1) % WORD
    return x, y


@lru_cache(maxsize=4096)
def _slot(seed: int, n: int, slot: int) -> tuple[int, int]:
    return threefry((seed % WORD, seed // WORD % WORD), (n % WORD, slot % WORD))


def words(seed: int, phase: int, n: int) -> Callable[[int, int], list[int]]:
    """The words of one step or reset: a function of the first word and of how many are wanted."""
    return lambda first, count: [_slot(seed, n, phase + w // 2)[w % 2] for w in range(first, first + count)]


# ------------------------------------------------------------------------------ finite draws


def exact_category(word: int, shares: Sequence[Number]) -> int:
    sums = list(itertools.accumulate(Fraction(p) for p in shares))
    return sum(round(WORD * s / sums[-1]) <= word for s in sums[:-1])


def exact_flag(word: int, share: Number) -> bool:
    return word < round(WORD * Fraction(share))


def weighted_category(word: int, shares: Sequence[Number]) -> int:
    positive = [F(as_float(p)) if p > 0 else F(0) for p in shares]
    sums = list(itertools.accumulate(positive))
    target = uniform(word) * sums[-1]
    return int(sum(s <= target for s in sums[:-1]))


def weighted_flag(word: int, share: Number) -> bool:
    return bool(uniform(word) < F(as_float(share)))


def uniform(word: int) -> np.float32:
    return F(word >> 8) * F(2.0**-24)


# ------------------------------------------------------------------------------ logarithm, exponential, circle

LN2 = F(0.693147181)
LOG = tuple(map(F, (0.66666776, 0.39977533, 0.29872006)))
EXP = tuple(map(F, (0.5, 0.16666518, 0.041666206, 0.008368954, 0.0013950604)))
SINE = tuple(map(F, (1.5707963, -0.64596337, 0.079688482, -0.0046722279, 0.00015082053)))
COSINE = tuple(map(F, (0.99999994, -1.2336982, 0.25365075, -0.020810629, 0.00085819111)))
ROOT_HALF = F(math.sqrt(0.5))


def horner(x: np.float32, coefficients: Sequence[np.float32]) -> np.float32:
    total = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = c + x * total
    return total


def split(x: np.float32) -> tuple[int, np.float32]:
    """`(e, log m)` where x is m 2^e and m lies in [sqrt(1/2), sqrt(2))."""
    mantissa, e = math.frexp(float(x))  # in [1/2, 1)
    m = F(mantissa)
    if m < ROOT_HALF:
        m = m * F(2)
        e = e - 1
    s = (m - F(1)) / (m + F(1))
    return e, s * (F(2) + s * s * horner(s * s, LOG))


def log(x: np.float32) -> np.float32:
    e, log_m = split(x)
    return F(e) * LN2 + log_m


def exp(x: np.float32) -> np.float32:
    if x < F(-87):
        return F(0)
    y = min(x, F(88))
    k = np.rint(y * F(1.44269504))
    f = (y - k * F(0.693359375)) - k * F(-2.12194440e-4)
    return ((f * f) * horner(f, EXP) + f + F(1)) * F(2.0 ** int(k))


def standard_exponential(word: int) -> np.float32:
    v = F((WORD - 1 - word) >> 1) + F(0.5)
    e, log_m = split(v)
    return F(31 - e) * LN2 - log_m


def normal_pair(radius: int, angle: int) -> tuple[np.float32, np.float32]:
    r = np.sqrt(standard_exponential(radius) * F(2))
    signed = (angle << 1) % WORD
    x = F(signed - WORD if signed >= WORD // 2 else signed) * F(2.0**-31)
    sine = x * horner(x * x, SINE)
    cosine = horner(x * x, COSINE)
    return r * (-cosine if angle >= WORD // 2 else cosine), r * sine


def exponential(block: Sequence[int]) -> list[float]:
    return [float(standard_exponential(w)) for w in block]


def normal(block: Sequence[int]) -> list[float]:
    pairs = (normal_pair(block[i], block[i + 1]) for i in range(0, len(block), 2))
    return [float(x) for pair in pairs for x in pair]


# ------------------------------------------------------------------------------ counts and shares


@lru_cache(maxsize=512)
def poisson_thresholds(rate: float) -> tuple[int, ...]:
    """The words at which the counts 1, 2, ... begin: weights run down and up from the mode by products alone."""
    weights = {int(rate): 1.0}
    for k in range(int(rate), 0, -1):
        weight = weights[k] * (k / rate)
        if weight < 2.0**-80:
            break
        weights[k - 1] = weight
    for k in itertools.count(int(rate) + 1):
        weight = weights[k - 1] * (rate / k)
        if weight < 2.0**-80:
            break
        weights[k] = weight
    sums = list(itertools.accumulate(Fraction(weights.get(k, 0)) for k in range(max(weights) + 1)))
    return tuple(round(WORD * s / sums[-1]) for s in sums[:-1])


def exact_poisson(word: int, rate: Number) -> int:
    return sum(t <= word for t in poisson_thresholds(as_float(rate)))


def weighted_poisson(word: int, rate: Number) -> int:
    """A rate known only at run time, at most 64: the running sums of rate^k / k!, in float32."""
    share = F(max(0.0, as_float(rate)))
    term = F(1)
    sums = [F(1)]
    for k in range(1, 400):
        term = term * share / F(k)
        sums.append(sums[-1] + term)
    target = uniform(word) * sums[-1]
    return int(sum(s <= target for s in sums[:-1]))


def gamma(block: Sequence[int], alpha: Number) -> tuple[np.float32, np.float32]:
    """g and s of a gamma variate g * exp(-s), by the method of Marsaglia and Tsang, of nine words."""
    shape = min(max(F(as_float(alpha)), F(2.0**-100)), F(2.0**100))
    small = shape < F(1)
    raised = shape + F(1) if small else shape
    d = raised - F(1 / 3)
    scale = F(1 / 3) / np.sqrt(d)
    value = d
    for x, word in zip((*normal_pair(*block[0:2]), *normal_pair(*block[2:4])), block[4:8], strict=True):
        accepted, candidate = gamma_try(x, word, d, scale)
        if accepted:
            value = candidate
            break
    return value, standard_exponential(block[8]) / shape if small else F(0)


def gamma_value(block: Sequence[int], alpha: Number) -> float:
    value, shrink = gamma(block, alpha)
    found = value * exp(-shrink)
    return float(found) if found > F(2.0**-126) else 0.0


def gamma_try(x: np.float32, word: int, d: np.float32, scale: np.float32) -> tuple[bool, np.float32]:
    root = x * scale + F(1)
    if root <= F(0):
        return False, F(0)
    v = root * root * root
    margin = F(0.5) * x * x + d * ((F(1) - v) + log(v))
    return bool(standard_exponential(word) + margin > F(0)), d * v


def dirichlet(block: Sequence[int], alphas: Sequence[Number]) -> list[float]:
    pieces = [block[i * GAMMA_WORDS : (i + 1) * GAMMA_WORDS] for i in range(len(alphas))]
    gammas = [gamma(words, alpha) for words, alpha in zip(pieces, alphas, strict=True)]
    largest = max(value for value, _ in gammas)
    logs = [log(max(value / largest, F(2.0**-126))) - shrink for value, shrink in gammas]
    parts = [exp(x - max(logs)) for x in logs]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return [float(part / total) if part / total > F(2.0**-126) else 0.0 for part in parts]


# ------------------------------------------------------------------------------ normals between bounds


def truncated(u: float, low: float, high: float) -> float:
    """A standard normal between two bounds, by its inverse distribution function, where there is less mass above 0 than below."""
    if low + high > 0:
        return -truncated(u, -high, -low)
    bottom = below(low)
    top = below(high)
    p = bottom + u * (top - bottom)
    return inverse(p) if p > 0 else high


def powers(x: float, coefficients: Sequence[float]) -> float:
    value = 0.0
    for c in coefficients:
        value = value * x + c
    return value


def below(x: float) -> float:
    z = abs(x) * math.sqrt(0.5)
    t = 1 / (1 + 0.5 * z)
    tail = 0.5 * t * math.exp(powers(t, ERFC) - z * z)
    return tail if x < 0 else 1 - tail


def inverse(p: float) -> float:
    rest = p if p < 0.5 else 1 - p
    if rest >= 0.02425:
        q = p - 0.5
        return powers(q * q, CENTRE[0]) * q / powers(q * q, CENTRE[1])
    s = math.sqrt(-2 * math.log(rest)) if rest > 0 else math.inf
    found = powers(s, OUTSIDE[0]) / powers(s, OUTSIDE[1]) if rest > 0 else -math.inf
    return found if p < 0.5 else -found


ERFC = (0.17087277, -0.82215223, 1.48851587, -1.13520398, 0.27886807, -0.18628806, 0.09678418, 0.37409196, 1.00002368,
        -1.26551223)  # fmt: skip
CENTRE = (
    (
        -39.69683028665376,
        220.9460984245205,
        -275.9285104469687,
        138.357751867269,
        -30.66479806614716,
        2.506628277459239,
    ),
    (-54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572, 1),
)
OUTSIDE = (
    (-0.007784894002430293, -0.3223964580411365, -2.400758277161838, -2.549732539343734, 4.374664141464968,
     2.938163982698783),
    (0.007784695709041462, 0.3224671290700398, 2.445134137142996, 3.754408661907416, 1),
)  # fmt: skip
