"""Outcomes of single draws with their probabilities, as entries of the table list them."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.ir import Draw

FAINTEST = 5e-324
"""What possible outcomes weigh at least, so that a product of small probabilities does not make them impossible."""


def product(draw: Draw, rows: Sequence[Array], dtype: Any) -> tuple[Array, Array]:
    """Independent elements: element e takes value k with probability rows[e][k]."""
    shape = draw.type.shape
    if shape == ():
        return np.arange(len(rows[0]), dtype=dtype), rows[0]
    digits = np.array(list(itertools.product(*(range(len(r)) for r in rows))), dtype=np.int64)
    p: Any = 1
    for e, row in enumerate(rows):
        p = both(p, row[digits[:, e]]) if e else row[digits[:, e]]
    return digits.reshape(-1, *shape).astype(dtype), p


def both(a: Array, b: Array) -> Array:
    """Products of probabilities: more than 0 where both of them are."""
    found = once(operator.mul, a, b)
    lost = once(operator.eq, found, np.zeros_like(found))
    if not lost.any():
        return found
    return np.where(lost & (a > 0) & (b > 0), FAINTEST, found)


def once(op: Callable[[Any, Any], Any], a: Array, b: Array) -> Array:
    """Return an operation on two arrays of one shape; of objects, such as fractions, each pair is looked at once."""
    if a.dtype != object or a.shape != b.shape:
        return np.asarray(op(a, b))
    names = [np.unique(np.fromiter(map(id, x.flat), np.int64, x.size), return_inverse=True)[1] for x in (a, b)]
    _, at, back = np.unique(names[0] * (b.size + 1) + names[1], return_index=True, return_inverse=True)
    return np.asarray(op(a.reshape(-1)[at], b.reshape(-1)[at]))[back].reshape(a.shape)


def each(arg: Array, size: int) -> list[Array]:
    """Return an argument with one row for each element."""
    flat = arg.reshape(-1, arg.shape[-1])
    return list(flat) * size if len(flat) == 1 else list(flat)


def within(p: Array) -> Array:
    """Return probabilities of conditions as the sampler reads them: within 0 and 1, and 0 for nan."""
    return np.minimum(np.maximum(np.where(p == p, p, 0), 0), 1)


def clean(p: Array) -> Array:
    """Return rows of probabilities (K, N) as the sampler reads them: no negative ones, relative to the total.

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
    """`base ** exponent`; 1e300 stands for all that is beyond it, as it is finite for all that."""
    return 1e300 if exponent * math.log(max(1.0, base)) > 690 else float(base) ** exponent
