"""Random variates as pure functions of random words.

A singular name takes Python integers and gives one Python value (`normal`); its plural takes uint32 arrays and is
elementwise (`normals`). Where a variate takes several words, they lie along the first axis. Both forms give the same values
to the bit: finite draws compare integers, and reals are float32 from the operations of `polynomials`, each rounded once, in
the order written. Real draws are defined here, finite ones in `finite`.

Words taken: uniform, bernoulli, exponential, index and categorical draws 1; n normals `normal_words`; a permutation of n
things n; a Poisson of dynamic rate `poisson_words`; a Dirichlet of n parts `dirichlet_words`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taskspec.draws import polynomials
from taskspec.draws.polynomials import F, Reals
from taskspec.draws.threefry import CHUNK, Words

GAMMA_TRIES = 4
GAMMA_WORDS = 9  # two pairs for the normals of four tries, four for their tests, one for alpha < 1
SMALLEST_ALPHA = F(2**-100)
LARGEST_ALPHA = F(2**100)
LEAST = F(2**-126)  # the least normal float32; some machines flush what is below it

# -- reals


def uniform(word: int) -> float:
    """(w >> 8) 2^-24, in [0, 1): exact in float32."""
    return (word >> 8) * 2**-24


def uniforms(words: Words) -> Reals:
    """`uniform`, elementwise: float32 of the same shape."""
    return polynomials.uniform(words)


def bernoulli(word: int, p: float) -> bool:
    """True with a probability p known only at run time: uniform < p, with p rounded to float32."""
    return uniform(word) < (float(F(p)) if -1 <= p <= 2 else p)  # beyond, it might be no float32


def bernoullis(words: Words, p: ArrayLike) -> NDArray[np.bool_]:
    """`bernoulli`, elementwise; p broadcasts."""
    return uniforms(words) < np.asarray(p, np.float32)


def exponential(word: int) -> float:
    """Return a standard exponential: `polynomials.exponential` of one word."""
    return float(exponentials(np.array([word], np.uint32))[0])


def exponentials(words: Words) -> Reals:
    """Standard exponentials, elementwise: float32 of the same shape."""
    return polynomials.exponential(words)


def normal_words(n: int) -> int:
    """Return how many words n normals take: one each, made even."""
    return n + (n & 1)


def normal(words: Sequence[int], n: int) -> tuple[float, ...]:
    """n standard normals from ``normal_words(n)`` words: `polynomials.normal_pair` of each pair."""
    return tuple(normals(np.array(words, np.uint32), n).tolist())


def normals(words: Words, n: int) -> Reals:
    """Standard normals: float32 (n, ...) from words (normal_words(n), ...).

    Words 2i and 2i + 1 give normals 2i and 2i + 1. The result keeps the memory order of the words,
    so ``normals(block.T, n).T`` has the draws of one step side by side.
    """
    out = np.empty_like(words, np.float32)
    pairs = len(words) // 2
    step = max(1, CHUNK * pairs // max(1, words.size // 2))
    for i in range(0, 2 * pairs, 2 * step):
        radius = words[i : i + 2 * step : 2]
        angle = words[i + 1 : i + 2 * step : 2]
        first, second = polynomials.normal_pair(radius, angle)
        out[i : i + 2 * step : 2] = first
        out[i + 1 : i + 2 * step : 2] = second
    return out[:n]


def dirichlet_words(n: int) -> int:
    """Return how many words a Dirichlet draw of n parts takes."""
    return GAMMA_WORDS * n


def dirichlet(words: Sequence[int], alphas: Sequence[float]) -> tuple[float, ...]:
    """Shares that add up to 1, from ``dirichlet_words(len(alphas))`` words; see `dirichlets`."""
    shares = dirichlets(np.array(words, np.uint32)[:, None], np.asarray(alphas)[:, None])
    return tuple(shares[:, 0].tolist())


def dirichlets(words: Words, alphas: ArrayLike) -> Reals:
    """Dirichlet shares: float32 (n, ...) from words (9 n, ...) and alphas (n,) or (n, ...).

    Gamma variates over their sum, from first to last; in logarithms, so that small alphas, whose gammas all vanish in float32,
    still give a share of 1 to somebody. The largest gamma is taken out first, so that those of large alphas, which differ in
    their last digits only, keep these. Shares up to LEAST are 0.
    """
    value, shrink = _gamma_parts(words, alphas)
    logs = polynomials.log(np.maximum(value / value.max(axis=0), LEAST)) - shrink
    parts = polynomials.exp(logs - logs.max(axis=0))
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    shares: Reals = parts / total
    return np.where(shares > LEAST, shares, F(0))


def gamma_words(n: int) -> int:
    """Return how many words n gamma variates take."""
    return GAMMA_WORDS * n


def gamma(words: Sequence[int], alphas: Sequence[float]) -> tuple[float, ...]:
    """Gamma variates of given shapes and scale 1, from ``gamma_words(len(alphas))`` words; see `gammas`."""
    return tuple(gammas(np.array(words, np.uint32)[:, None], np.asarray(alphas)[:, None])[:, 0].tolist())


def gammas(words: Words, alphas: ArrayLike) -> Reals:
    """Gamma variates: float32 (n, ...) from words (9 n, ...) and alphas (n,) or (n, ...); those up to LEAST are 0."""
    value, shrink = _gamma_parts(words, alphas)
    found = value * polynomials.exp(-shrink)
    return np.where(found > LEAST, found, F(0))


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
    alpha = alpha.reshape(n, *(1,) * len(rest)) if alpha.ndim == 1 else alpha
    words = np.moveaxis(words.reshape(n, GAMMA_WORDS, *rest), 1, 0)
    shape: Reals = np.where(alpha > SMALLEST_ALPHA, alpha, SMALLEST_ALPHA)
    shape = np.where(shape < LARGEST_ALPHA, shape, LARGEST_ALPHA)
    small = shape < F(1)
    raised: Reals = np.where(small, shape + F(1), shape)
    d = raised - F(1 / 3)
    scale = F(1 / 3) / np.sqrt(d)
    x = (*polynomials.normal_pair(words[0], words[1]), *polynomials.normal_pair(words[2], words[3]))
    value = d
    for i in reversed(range(GAMMA_TRIES)):
        candidate, accepted = _gamma_try(x[i], words[4 + i], d, scale)
        value = np.where(accepted, candidate, value)
    shrink = np.where(small, polynomials.exponential(words[8]) / shape, F(0))
    return value, shrink


def _gamma_try(x: Reals, word: Words, d: Reals, scale: Reals) -> tuple[Reals, NDArray[np.bool_]]:
    root = x * scale + F(1)
    positive = root > F(0)
    root = np.where(positive, root, F(1))
    v = root * root * root
    margin = F(0.5) * x * x + d * ((F(1) - v) + polynomials.log(v))
    return d * v, positive & (polynomials.exponential(word) + margin > F(0))
