"""Random draws: variates as pure functions of random words (`threefry`), the same to the bit on every machine.

A singular name takes Python integers and gives one Python value (`index`); its plural takes uint32 arrays and is elementwise
(`indices`). Where a variate takes several words, they lie along the first axis. Finite draws compare integers.

Real draws are float32 numbers from + - * / sqrt, casts and integer bit tricks alone, each operation rounded once, in the
order written here; a library's functions differ in their last digits from machine to machine. Each function is elementwise and
can be transcribed line by line for any backend (`view` reinterprets bits, `astype` converts, to nearest even). A compiler that
fuses a product with the sum that it feeds changes last digits; where the product is exact, that is noted.
Coefficients are minimax fits (Lawson iteration in float64), rounded to float32.

Words taken: uniform, bernoulli, exponential, index and categorical draws 1; n normals `normal_words`; a permutation of n
things n; a Poisson of dynamic rate `poisson_words`; gammas and a Dirichlet of n parts `gamma_words`.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taskspec.base.limits import Limits
from taskspec.language.draws.threefry import CHUNK, Words
from taskspec.language.draws.threefry import POLICY as POLICY
from taskspec.language.draws.threefry import RESET as RESET
from taskspec.language.draws.threefry import STEP as STEP
from taskspec.language.draws.threefry import TEACHER as TEACHER
from taskspec.language.draws.threefry import block as block
from taskspec.language.draws.threefry import lane_seeds as lane_seeds
from taskspec.language.draws.threefry import lanes_ahead as lanes_ahead
from taskspec.language.draws.threefry import lanes_block as lanes_block
from taskspec.language.draws.threefry import rows as rows
from taskspec.language.draws.threefry import words as words

xp: Any = np
"""The array library of entries of `taskspec.language.expressions.variates`; the library for JAX has its own."""
Reals = NDArray[np.float32]
Ints = NDArray[np.int32]

F = np.float32
LOG2E = F(1.44269504)
LN2 = F(0.693147181)
LN2_HIGH = F(0.693359375)  # 355/512: times a whole number below 2**15 it is exact
LN2_LOW = F(-2.12194440e-4)
SQRT_HALF_BITS = np.int32(0x3F3504F3)
FRACTION_BITS = np.int32(0x007FFFFF)
SIGN_BIT = np.uint32(0x80000000)

# log m = s (2 + z (L0 + z (L1 + z L2))), s = (m - 1)/(m + 1), z = s²; fit within 2e-11
L = tuple(map(F, (0.66666776, 0.39977533, 0.29872006)))
# exp f = 1 + f + f² (E0 + f (E1 + ...)), |f| <= log(2)/2; fit within 4e-9
E = tuple(map(F, (0.5, 0.16666518, 0.041666206, 0.008368954, 0.0013950604)))
# sin(πx/2) = x (S0 + z (S1 + ...)), z = x², |x| <= 1; fit within 4e-9
S = tuple(map(F, (1.5707963, -0.64596337, 0.079688482, -0.0046722279, 0.00015082053)))
# cos(πx/2) = C0 + z (C1 + ...); fit within 5e-8
C = tuple(map(F, (0.99999994, -1.2336982, 0.25365075, -0.020810629, 0.00085819111)))

GAMMA_TRIES = 4
GAMMA_WORDS = 9  # two pairs for the normals of four tries, four for their tests, one for alpha < 1
SMALLEST_ALPHA = F(2**-100)
LARGEST_ALPHA = F(2**100)
LEAST = F(2**-126)  # the least normal float32; some machines flush what is below it

NEVER = 1 << 32  # a threshold above every word
POISSON_SHARE = 64  # the largest mean of one sequential search: exp(64) is well inside float32
FAINTEST = 2.0**-80  # the least weight of a count in a Poisson table, relative to the weight of the mode

# -- float32 functions


def split(x: Reals) -> tuple[Ints, Reals]:
    """``(e, log m)`` with x = m 2^e and m in [√½, √2), for positive normal x."""
    bits = x.view(np.int32) - SQRT_HALF_BITS
    e = bits >> np.int32(23)
    m = ((bits & FRACTION_BITS) + SQRT_HALF_BITS).view(np.float32)
    s = (m - F(1)) / (m + F(1))
    z = s * s
    return e, s * (F(2) + z * (L[0] + z * (L[1] + z * L[2])))


def log(x: Reals) -> Reals:
    """Return the natural logarithm of positive normal x, within 2e-7 (1 + |log x|)."""
    e, log_m = split(x)
    return e.astype(np.float32) * LN2 + log_m


def exp(x: Reals) -> Reals:
    """Exponential of x, with a relative error of at most 2e-7: 0 below -87, exp(88) above 88."""
    y = np.minimum(np.maximum(x, F(-87)), F(88))
    k = np.rint(y * LOG2E)
    f = (y - k * LN2_HIGH) - k * LN2_LOW  # the first product is exact
    p = E[0] + f * (E[1] + f * (E[2] + f * (E[3] + f * E[4])))
    power = ((k.astype(np.int32) + np.int32(127)) << np.int32(23)).view(np.float32)
    return np.where(x < F(-87), F(0), ((f * f) * p + f + F(1)) * power)


def direction(words: Words) -> tuple[Reals, Reals]:
    """Return a point ``(cos, sin)`` of the unit circle for each word, within 3e-7.

    The lower 31 bits, as a signed fraction x of [-1, 1], give the angle πx/2 of a point of the
    right half circle, and the top bit moves it to the left half: no quadrants, no selection.
    """
    x = (words << np.uint32(1)).view(np.int32).astype(np.float32) * F(2**-31)  # exact
    z = x * x
    sine = x * (S[0] + z * (S[1] + z * (S[2] + z * (S[3] + z * S[4]))))
    cosine = C[0] + z * (C[1] + z * (C[2] + z * (C[3] + z * C[4])))
    return (cosine.view(np.uint32) ^ (words & SIGN_BIT)).view(np.float32), sine


def normal_pair(radius: Words, angle: Words) -> tuple[Reals, Reals]:
    """Return two independent standard normals for each pair of words, by Box and Muller; |x| <= 6.67."""
    r = np.sqrt(exponentials(radius) * F(2))  # exact product
    cosine, sine = direction(angle)
    return r * cosine, r * sine


# -- reals


def uniform(word: int) -> float:
    """(w >> 8) 2^-24, in [0, 1): exact in float32."""
    return (word >> 8) * 2**-24


def uniforms(words: Words) -> Reals:
    """`uniform`, elementwise: float32 of the same shape."""
    return (words >> np.uint32(8)).view(np.int32).astype(np.float32) * F(2**-24)


def bernoulli(word: int, p: float) -> bool:
    """Return True with a probability p known only at run time: uniform < p, with p rounded to float32."""
    return uniform(word) < (float(F(p)) if -1 <= p <= 2 else p)  # beyond, it might be no float32


def bernoullis(words: Words, p: ArrayLike) -> NDArray[np.bool_]:
    """`bernoulli`, elementwise; p broadcasts."""
    return uniforms(words) < np.asarray(p, np.float32)


def exponentials(words: Words) -> Reals:
    """-log U, for U = (v + 1/2) 2^-31 and v the 31 upper bits of the inverted word: in [0, 22.2], float32 of the same shape.

    It grows with the word. U lies in [2^-32, 1], so the logarithm is always finite; 31 bits and a
    half, against the 24 of a float32 uniform, carry the tail on to where the words themselves end.
    """
    v = (~words >> np.uint32(1)).view(np.int32).astype(np.float32) + F(0.5)
    e, log_m = split(v)
    return (np.int32(31) - e).astype(np.float32) * LN2 - log_m


def normal_words(n: int) -> int:
    """Count the words that n normals take: n, made even."""
    return n + (n & 1)


def normals(words: Words, n: int) -> Reals:
    """Return standard normals: float32 (n, ...) from words (normal_words(n), ...).

    Words 2i and 2i + 1 give normals 2i and 2i + 1. The result keeps the memory order of the words,
    so ``normals(block.T, n).T`` has the draws of one step side by side.
    """
    out = np.empty_like(words, np.float32)
    pairs = len(words) // 2
    step = max(1, CHUNK * pairs // max(1, words.size // 2))
    for i in range(0, 2 * pairs, 2 * step):
        radius = words[i : i + 2 * step : 2]
        angle = words[i + 1 : i + 2 * step : 2]
        first, second = normal_pair(radius, angle)
        out[i : i + 2 * step : 2] = first
        out[i + 1 : i + 2 * step : 2] = second
    return out[:n]


def gamma_words(n: int) -> int:
    """Count the words that n gamma variates take, or a Dirichlet draw of n parts."""
    return GAMMA_WORDS * n


def dirichlets(words: Words, alphas: ArrayLike) -> Reals:
    """Dirichlet shares: float32 (n, ...) from words (9 n, ...) and alphas (n,) or (n, ...).

    Gamma variates over their sum, from first to last; in logarithms, so that small alphas, whose gammas all vanish in float32,
    still give a share of 1 to somebody. The largest gamma is taken out first, so that gammas of large alphas, which differ in
    their last digits only, keep these. Shares up to LEAST are 0.
    """
    value, shrink = _gamma_parts(words, alphas)
    logs = log(np.maximum(value / value.max(axis=0), LEAST)) - shrink
    parts = exp(logs - logs.max(axis=0))
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    shares: Reals = parts / total
    return np.where(shares > LEAST, shares, F(0))


def gammas(words: Words, alphas: ArrayLike) -> Reals:
    """Gamma variates: float32 (n, ...) from words (9 n, ...) and alphas (n,) or (n, ...); those up to LEAST are 0."""
    value, shrink = _gamma_parts(words, alphas)
    values = value * exp(-shrink)
    return np.where(values > LEAST, values, F(0))


def _gamma_parts(words: Words, alphas: ArrayLike) -> tuple[Reals, Reals]:
    """``(g, s)``, (n, ...) each: the gamma variate of shape alpha and scale 1 is g exp(-s), and s is 0 unless alpha < 1.

    Marsaglia and Tsang, "A simple method for generating gamma variables", 2000, with alpha raised by one and the result
    multiplied by U^(1/alpha) where alpha < 1. A try fails with probability under 0.05, and after GAMMA_TRIES failures the mode
    stands in: less than 7e-6 of all draws.
    """
    with np.errstate(over="ignore"):
        alpha = np.asarray(alphas, np.float32)
    rest = words.shape[1:]
    n = len(words) // GAMMA_WORDS
    if alpha.ndim == 1:
        alpha = alpha.reshape(n, *(1,) * len(rest))
    words = np.moveaxis(words.reshape(n, GAMMA_WORDS, *rest), 1, 0)
    shape: Reals = np.where(alpha > SMALLEST_ALPHA, alpha, SMALLEST_ALPHA)
    shape = np.where(shape < LARGEST_ALPHA, shape, LARGEST_ALPHA)
    small = shape < F(1)
    raised: Reals = np.where(small, shape + F(1), shape)
    d = raised - F(1 / 3)
    scale = F(1 / 3) / np.sqrt(d)
    x = (*normal_pair(words[0], words[1]), *normal_pair(words[2], words[3]))
    value = d
    for i in reversed(range(GAMMA_TRIES)):
        root = x[i] * scale + F(1)
        positive = root > F(0)
        root = np.where(positive, root, F(1))
        v = root * root * root
        margin = F(0.5) * x[i] * x[i] + d * ((F(1) - v) + log(v))
        accepted = positive & (exponentials(words[4 + i]) + margin > F(0))
        value = np.where(accepted, d * v, value)
    shrink = np.where(small, exponentials(words[8]) / shape, F(0))
    return value, shrink


# -- indices


def index(word: int, n: int) -> int:
    """Return an integer below n, for 0 < n < 2^31: (w n) >> 32.

    With 32 bits alone and n <= 2^16: ((w >> 16) n + ((w & 0xffff) n >> 16)) >> 16.
    """
    return word * n >> 32


def indices(words: Words, n: ArrayLike) -> Ints:
    """`index`, elementwise: int32; n broadcasts."""
    product = words.astype(np.uint64) * np.asarray(n).astype(np.uint64)
    return (product >> np.uint64(32)).astype(np.int32)


def thresholds(probabilities: Sequence[Fraction | float]) -> tuple[int, ...]:
    """Return the k - 1 words at which outcomes 1 to k - 1 begin: round(2^32 x cumulative probability).

    Fractions are exact, floats are taken at their exact value, and all are relative to their total.
    An outcome of probability 0 has no words: where it comes first, outcome 1 begins at word 0;
    where it comes last, it begins at 2^32 (`NEVER`), which no word reaches. Thresholds that must
    fit 32 bits may drop the `NEVER` at their end, or go through `threshold_table`.

    Weights that are no distribution are read as by `weighted_categoricals`: a negative weight and NaN
    count as 0; where all do, or the total is infinite, the outcome is the last one.
    """
    weights = []
    for p in probabilities:
        weights.append(p if p > 0 else Fraction(0))
    if not 0 < sum(weights) < math.inf:
        return (0,) * (len(weights) - 1)
    cumulative = list(accumulate(Fraction(w) for w in weights))
    return tuple(round(NEVER * c / cumulative[-1]) for c in cumulative[:-1])


def categorical(word: int, thresholds: Sequence[int]) -> int:
    """Return the outcome of a word: how many thresholds are at most the word."""
    return bisect_right(thresholds, word)


def categoricals(words: Words, thresholds: Sequence[int] | Words) -> Ints:
    """`categorical`, elementwise: int32 of the same shape. Thresholds as uint32 are those a word can reach."""
    reached = thresholds
    if not isinstance(thresholds, np.ndarray):
        reached = reachable(thresholds)
    if len(reached) > 8:
        return np.searchsorted(reached, words, side="right").astype(np.int32)
    result = np.zeros(words.shape, np.int32)
    for threshold in reached:
        result += words >= threshold
    return result


def reachable(thresholds: Sequence[int]) -> Words:
    return np.array([t for t in thresholds if t < NEVER], np.uint32)


def threshold_table(distributions: Sequence[Sequence[Fraction | float]]) -> tuple[Words, Ints]:
    """Thresholds of distributions of one size; a row is chosen at run time.

    Gives thresholds (rows, k - 1), where `NEVER` has become 2^32 - 1, and the last outcome of
    positive probability (rows,), to which a draw is limited so that the difference cannot show.
    """
    table = np.array([thresholds(row) for row in distributions], np.uint64)
    last = (table < NEVER).sum(axis=1, dtype=np.int32)
    return np.minimum(table, np.uint64(NEVER - 1)).astype(np.uint32), last


def row_categoricals(words: Words, row: NDArray[np.integer], table: Words, last: Ints) -> Ints:
    """Return draws from rows of a `threshold_table`: int32 of the shape of the words."""
    reached: Ints = (words[..., None] >= table[row]).sum(axis=-1, dtype=np.int32)
    return np.minimum(reached, last[row])


def weighted_categorical(word: int, weights: Sequence[float]) -> int:
    """Return an outcome in proportion to float32 weights; see `weighted_categoricals`."""
    return int(weighted_categoricals(np.array([word], np.uint32), np.asarray(weights)[:, None])[0])


def weighted_categoricals(words: Words, weights: ArrayLike) -> Ints:
    """Return outcomes in proportion to weights (k, ...) known only at run time: int32 (...).

    How many of the first k - 1 running sums are at most uniform × total. That product rounds to
    less than the total, and a weight of 0 (as a negative one and NaN count) leaves the running sum
    as it was, so outcomes of no weight are never drawn, unless all are.
    """
    with np.errstate(over="ignore"):  # what no float32 holds is infinite
        weight = np.asarray(weights, np.float32)
    sums = list(accumulate(np.where(weight > F(0), weight, F(0))))
    target = uniforms(words) * sums[-1]
    result = np.zeros(target.shape, np.int32)
    for partial in sums[:-1]:
        result += partial <= target
    return result


def permutation(words: Sequence[int]) -> tuple[int, ...]:
    """Return the order that sorts the words, equal words keeping theirs."""
    return tuple(sorted(range(len(words)), key=words.__getitem__))


def permutations(words: Words) -> Ints:
    """`permutation` along the first axis: int32 (n, ...) from words (n, ...)."""
    return np.argsort(words, axis=0, kind="stable").astype(np.int32)


# -- counts


@lru_cache(maxsize=256)
def poisson_table(rate: float) -> tuple[int, tuple[int, ...]]:
    """``(first, thresholds)``: a draw is first + categorical(word, thresholds).

    The weights run down and up from the mode by + * / alone, so the table is the same everywhere;
    it holds every count that has a word. The rate is limited to [0, 100000], NaN to 0.
    """
    if rate > 0:
        rate = min(rate, Limits.poisson)
    else:
        rate = 0.0
    mode = int(rate)
    below: list[float] = []
    weight = 1.0
    for k in range(mode, 0, -1):
        weight *= k / rate
        if weight < FAINTEST:
            break
        below.append(weight)
    above: list[float] = []
    weight = rate / (mode + 1)
    while weight >= FAINTEST:
        above.append(weight)
        weight *= rate / (mode + 1 + len(above))
    table = thresholds([*reversed(below), 1.0, *above])
    empty = table.count(0)
    return mode - len(below) + empty, tuple(t for t in table[empty:] if t < NEVER)


def poisson_words(bound: float) -> int:
    """Count the words that a Poisson draw takes, with rates of at most ``bound``."""
    return max(1, math.ceil(bound / POISSON_SHARE))


def poisson_terms(bound: float) -> int:
    """Largest count among the terms that one word is compared with."""
    first, table = poisson_table(bound / poisson_words(bound))
    return first + len(table)


def poissons(words: Words, rate: ArrayLike, bound: float) -> Ints:
    """Poisson draws: int32 (...) from words (poisson_words(bound), ...) and rates (...).

    The rate is limited to [0, bound] and shared equally among the words. Each word is searched for
    in the running sums of rate^k / k!, times their total: no exponential is needed, and the search
    has a fixed length. As the sums are float32, a probability is off by at most 1e-6.
    """
    given = np.asarray(rate, np.float32)
    limited: Reals = np.minimum(np.where(given > F(0), given, F(0)), F(bound))
    share: Reals = limited / F(poisson_words(bound))
    sums = list(_exponential_sums(share, poisson_terms(bound)))
    target = uniforms(words) * sums[-1]
    counts = np.zeros(target.shape, np.int32)
    for partial in sums[:-1]:
        below = partial <= target
        if not below.any():
            break  # nor is any later sum: most rates are far below their bound
        counts += below
    return counts.sum(axis=0, dtype=np.int32)


def _exponential_sums(rate: Reals, terms: int) -> Iterator[Reals]:
    term = total = np.ones_like(rate)
    yield total
    for k in range(1, terms + 1):
        term = term * rate / F(k)
        total = total + term
        yield total
