"""An entry of the table of base variates, and outcomes with their probabilities, as entries list them."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from taskspec.base.arrays import AnyArray, Array
from taskspec.language.expressions.ir import Draw, Node
from taskspec.language.expressions.operators.entry import NodeMaker
from taskspec.language.expressions.types import EVERYTHING, Args, Interval, Kind

Flat = tuple[Any, ...]
Words = Sequence[int]
Bounds = Callable[[Node], Interval]
Comparison = Callable[[NodeMaker, Draw, Sequence[Node], int], list[Node] | None]
Draws = Any
"""Variates over arrays of words, and `xp`: `taskspec.language.draws` for NumPy, `taskspec.programs.jax.library` for JAX.

Words are uint32 and lie along the first axis, the lanes along the last one. Functions have the names that `draws` gives.
"""
LaneWriter = Any
"""The emitter of the scalar program: `taskspec.programs.lane_form`."""
KernelWriter = Any
"""The emitter of a kernel, without branches: `taskspec.programs.numba.kernel`.

Statements may use the functions of `taskspec.programs.numba.runtime` and `taskspec.programs.numba.kernel_draws`.
"""


class ProbabilityArithmetic(Protocol):
    """The arithmetic in which probabilities are worked out: floats, or rationals."""

    def argument(self, draw: Draw, arg: AnyArray) -> AnyArray:
        """First argument of a draw, rates and probabilities, (*shape, N)."""

    def otherwise(self, draw: Draw, p: AnyArray) -> AnyArray:
        """One minus the probabilities of conditions (*shape, N), the first argument of a draw, within 0 and 1."""

    def ratio(self, part: AnyArray, whole: AnyArray) -> AnyArray:
        """Ints divided by ints."""

    def times(self, a: AnyArray, b: AnyArray) -> AnyArray:
        """Joint probability of two that are positive."""


Outcomes = tuple[AnyArray, AnyArray]
"""Values (K, *shape) and their probabilities (K, N or 1)."""


@dataclass(frozen=True, slots=True)
class Enumeration:
    """The outcomes of a variate that exact analysis goes through.

    `count` bounds how many there are, given bounds of nodes. `table` gives their values (K, *shape) and probabilities
    (K, N or 1) from arguments (*shape, N or 1). A probability takes so many rounded `steps`, as a row is rounded, added up
    and divided for each element, and is made of so many `inputs`, which the arguments give. With a `tail` there are
    infinitely many, of irrational probabilities; those left out weigh less than 1e-20 for each element. `weighted` says
    whether the arguments are what outcomes weigh, and `by_row` whether a row of a constant table is taken as it is written.
    """

    count: Callable[[Draw, Bounds], float]
    table: Callable[[Draw, list[AnyArray], ProbabilityArithmetic], Outcomes]
    steps: Callable[[Draw], int] = lambda draw: 6 * draw.type.size
    inputs: Callable[[Draw], int] = lambda draw: draw.type.size
    tail: bool = False
    weighted: bool = True
    by_row: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Variate:
    """A base variate: what draws are made of, and all that anyone needs to know of it.

    `words` is how many random words a draw takes. `many` is its value over arrays, (size, N) of any width, from a library,
    its arguments (*shape, N or 1) and its words (count, N); `one` the same of a single draw on Python numbers, where that is
    simpler than a batch of one. All backends give the same to the bit. `many` is None for what stands in exact models only, and
    is never drawn.

    Values that depend on draws alone are worked out in blocks by `many`. Where a distribution depends on the state, the scalar
    program has the form `lane`, or else calls `one`. Kernels have the expressions `kernel`, one for each element; or a `loop` of
    `taskspec.programs.numba.kernel_draws` makes float32 numbers of the words, each of its own, before the step. `compared` gives
    the elements as comparisons of words (ints, less a bias) with known thresholds, where it can.

    `mean` is what a draw is replaced by where a reward is linear in it; variates with `outcomes` are gone through.
    `sorts` says that it sorts its words, which is costly; `passes`, how many times `many` goes through them. `cut`: its bounds
    are where the way it is made ends, and nothing in mathematics.
    """

    name: str
    kind: Kind
    many: Callable[[Draws, Draw, Sequence[AnyArray], AnyArray], AnyArray] | None
    one: Callable[[Draw, list[Flat], Words], Flat] | None = None
    words: Callable[[Draw], int] = lambda draw: draw.type.size
    bounds: Callable[[Draw, Args], Interval] = lambda draw, args: EVERYTHING
    outcomes: Enumeration | None = None
    mean: Callable[[NodeMaker, Draw], Node] | None = None
    lane: Callable[[LaneWriter, Draw, Sequence[str]], list[str]] | None = None
    kernel: Callable[[KernelWriter, Draw, Sequence[str]], list[str]] | None = None
    loop: str | None = None
    compared: Comparison = lambda b, draw, words, bias: None
    sorts: bool = False
    passes: Callable[[Draw], int] = lambda draw: 1
    cut: bool = False


# -- arguments and words of each element --------------------------------------------------------------------------


def stretched(flat: Flat, size: int) -> Flat:
    if len(flat) == 1:
        return flat * size
    return flat


def rows(x: Draws, draw: Draw, arg: AnyArray) -> AnyArray:
    """Broadcast an argument to one row for each element of a draw: (size, N or 1)."""
    flat = arg.reshape(-1, arg.shape[-1])
    return x.xp.broadcast_to(flat, (draw.type.size, flat.shape[1]))


def groups(draw: Draw, words: Sequence[str]) -> list[str]:
    """Words of each element, as the source of a tuple."""
    step = len(words) // draw.type.size
    return [f"({', '.join(words[k : k + step])},)" for k in range(0, len(words), step)]


# -- outcomes -----------------------------------------------------------------------------------------------------

FAINTEST = 5e-324
"""The least weight of possible outcomes, so that a product of small probabilities does not make them impossible."""


def product(draw: Draw, rows: Sequence[Array], dtype: Any) -> Outcomes:
    """Independent elements: element e takes value k with probability rows[e][k]."""
    shape = draw.type.shape
    if shape == ():
        return np.arange(len(rows[0]), dtype=dtype), rows[0]
    digits = np.array(list(itertools.product(*(range(len(r)) for r in rows))), dtype=np.int64)
    p = rows[0][digits[:, 0]]
    for e in range(1, len(rows)):
        p = both(p, rows[e][digits[:, e]])
    return digits.reshape(-1, *shape).astype(dtype), p


def both(a: Array, b: Array) -> Array:
    """Products of probabilities: more than 0 where both of them are."""
    product = once(operator.mul, a, b)
    lost = once(operator.eq, product, np.zeros_like(product))
    if not lost.any():
        return product
    return np.where(lost & (a > 0) & (b > 0), FAINTEST, product)


def once(op: Callable[[Any, Any], Any], a: Array, b: Array) -> Array:
    """Elementwise operation on two arrays of one shape; on objects, such as fractions, once for each distinct pair."""
    if a.dtype != object or a.shape != b.shape:
        return np.asarray(op(a, b))
    names = []
    for x in (a, b):
        names.append(np.unique(np.fromiter(map(id, x.flat), np.int64, x.size), return_inverse=True)[1])
    _, at, back = np.unique(names[0] * (b.size + 1) + names[1], return_index=True, return_inverse=True)
    return np.asarray(op(a.reshape(-1)[at], b.reshape(-1)[at]))[back].reshape(a.shape)


def each(arg: Array, size: int) -> list[Array]:
    """Split an argument into one row for each element."""
    flat = list(arg.reshape(-1, arg.shape[-1]))
    if len(flat) == 1:
        return flat * size
    return flat


def within(p: Array) -> Array:
    """Clamp probabilities of conditions as the sampler does: within 0 and 1, 0 for nan."""
    return np.minimum(np.maximum(np.where(p == p, p, 0), 0), 1)


def clean(p: Array) -> Array:
    """Clean rows of probabilities (K, N) as the sampler does: no negative ones, relative to the total.

    Where the total is 0, or infinite, it is the last one.
    """
    p = np.where(p > 0, p, 0)
    with np.errstate(over="ignore"):
        total = p.sum(axis=0)
    if (total != 1).any():
        is_none = (total == 0) | (total == math.inf)  # of fractions as well
        p = np.where(is_none, 0, p) / np.where(is_none, 1, total)
        p[-1] = np.where(is_none, 1, p[-1])
    return p


def power(base: float, exponent: int) -> float:
    if exponent * math.log(max(1.0, base)) > 690:
        return 1e300
    return float(base) ** exponent
