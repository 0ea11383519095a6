"""Array forms that are more than one expression: what `rt.` means in the array templates of the operator table.

Arrays carry the batch axis last, so that a scalar of every lane, shape (N,), broadcasts against a vector of every
lane, shape (n, N). `xp` is NumPy or a namespace like it (`jax.numpy`).
"""

from __future__ import annotations

from functools import cache
from typing import Any

from taskspec.lang.types import INT_MAX

Array = Any

UNSORTED = 16
"""Vectors up to this many elements are sorted by a network."""


@cache
def network(n: int) -> list[tuple[int, int]]:
    """Comparators of Batcher's odd-even merge sort (Knuth, TAOCP 3, algorithm 5.2.2M)."""
    pairs, t = [], max(1, (n - 1).bit_length())
    p = 1 << (t - 1)
    while p > 0:
        q, r, d = 1 << (t - 1), 0, p
        while d > 0:
            pairs += [(i, i + d) for i in range(n - d) if i & p == r]
            d, q, r = q - p, q >> 1, p
        p >>= 1
    return pairs


class Runtime:
    """Helpers over an array namespace, with the integer and real types that the backend computes in."""

    def __init__(self, xp: Any, int_dtype: Any, real_dtype: Any) -> None:
        self.xp, self.int, self.real = xp, int_dtype, real_dtype

    # -- conversions ----------------------------------------------------------------------------------------------

    def as_int(self, x: Array) -> Array:
        return self.xp.asarray(x).astype(self.int)

    def as_real(self, x: Array) -> Array:
        return self.xp.asarray(x).astype(self.real)

    def to_int(self, x: Array) -> Array:
        """A whole-numbered real as an int: saturating, nan as 0. The clamp is a hair wider, for float32."""
        xp = self.xp
        inside = xp.clip(xp.where(xp.isnan(x), 0, x), -INT_MAX, INT_MAX)
        if self.real != xp.float32:
            return inside.astype(self.int)
        whole = xp.where(xp.abs(inside) < INT_MAX, inside, 0).astype(self.int)
        return xp.where(x >= INT_MAX, INT_MAX, xp.where(x <= -INT_MAX, -INT_MAX, whole))

    # -- arithmetic at the awkward points -------------------------------------------------------------------------

    def _is_int(self, a: Array, b: Array) -> bool:
        return all(self.xp.asarray(v).dtype.kind in "iub" for v in (a, b))

    def floordiv(self, a: Array, b: Array) -> Array:
        xp = self.xp
        zero = b == 0
        if self._is_int(a, b):
            return xp.where(zero, 0, a // xp.where(zero, 1, b))
        finite = xp.isfinite(a) & xp.isfinite(b)
        quotient = xp.where(finite, a, 0) // xp.where(finite & ~zero, b, 1)
        return xp.where(zero, a / b, xp.where(finite, quotient, xp.nan))

    def mod(self, a: Array, b: Array) -> Array:
        xp = self.xp
        zero = b == 0
        if self._is_int(a, b):
            return xp.where(zero, 0, a % xp.where(zero, 1, b))
        usable = xp.isfinite(a) & ~zero
        return xp.where(usable, xp.where(usable, a, 0) % xp.where(usable, b, 1), xp.nan)

    def pow(self, a: Array, b: Array) -> Array:
        a, b = self.as_real(a), self.as_real(b)
        # With a single exponent for all NumPy takes short cuts, and a square root differs from a power at -0.0 and -inf.
        return self.xp.power(a, b + self.xp.zeros_like(a))

    def min2(self, a: Array, b: Array) -> Array:
        """The first of equals; `fmin` gives either 0.0 or -0.0 of the two."""
        return self.xp.where((a <= b) | (b != b), a, b)

    def max2(self, a: Array, b: Array) -> Array:
        return self.xp.where((a >= b) | (b != b), a, b)

    def sign(self, x: Array) -> Array:
        x = self.xp.asarray(x)
        return (x > 0).astype(x.dtype) - (x < 0).astype(x.dtype)

    # -- reductions over all elements of each lane ----------------------------------------------------------------

    def rows(self, x: Array) -> Array:
        """One row for every element."""
        return x.reshape(-1, x.shape[-1])

    def sum(self, x: Array) -> Array:
        """Left to right, as the reference adds."""
        rows = self.rows(x)
        total = rows[0]
        for row in rows[1:]:
            total = total + row
        return total

    def prod(self, x: Array) -> Array:
        rows = self.rows(x)
        total = rows[0]
        for row in rows[1:]:
            total = total * row
        return total

    def count(self, x: Array) -> Array:
        return self.rows(x).astype(self.int).sum(axis=0)

    def any(self, x: Array) -> Array:
        return self.rows(x).any(axis=0)

    def all(self, x: Array) -> Array:
        return self.rows(x).all(axis=0)

    def _without_nan(self, rows: Array, worst: float) -> Array:
        if rows.dtype.kind in "iub":
            return rows
        return self.xp.where(rows != rows, worst, rows)

    def argmin(self, x: Array) -> Array:
        """Nan counts as +inf, which ties with a real +inf only where nothing smaller exists."""
        return self._best(self.rows(x), 1)

    def argmax(self, x: Array) -> Array:
        return self._best(self.rows(x), -1)

    def _best(self, rows: Array, direction: int) -> Array:
        """Index of the first best number; of the first element where every element is nan."""
        xp = self.xp
        keys = self._without_nan(rows, direction * xp.inf)
        found = xp.argmin(keys, axis=0) if direction > 0 else xp.argmax(keys, axis=0)
        if rows.dtype.kind in "iub":
            return found.astype(self.int)
        first_number = xp.argmax(rows == rows, axis=0)
        hidden = xp.take_along_axis(rows, found[None], axis=0)[0]
        return xp.where(hidden != hidden, first_number, found).astype(self.int)

    def min(self, x: Array) -> Array:
        rows = self.rows(x)
        return self.xp.take_along_axis(rows, self.argmin(x)[None], axis=0)[0]

    def max(self, x: Array) -> Array:
        rows = self.rows(x)
        return self.xp.take_along_axis(rows, self.argmax(x)[None], axis=0)[0]

    # -- vectors --------------------------------------------------------------------------------------------------

    def sort(self, x: Array) -> Array:
        """Ascending along the first axis; short vectors by a network, which takes a few operations for all lanes."""
        n, x = x.shape[0], self.without_sign(x)
        if n > UNSORTED:
            return self.xp.sort(x, axis=0)
        rows = list(x)
        # Of two, fmin passes over nan and maximum keeps it: so nan moves last.
        least = self.xp.minimum if x.dtype.kind in "iub" else self.xp.fmin
        for i, j in network(n):
            rows[i], rows[j] = least(rows[i], rows[j]), self.xp.maximum(rows[i], rows[j])
        return self.xp.stack(rows)

    def without_sign(self, x: Array) -> Array:
        """The numbers with 0.0 for -0.0. A sum with 0.0 would do, but XLA takes it for the number itself."""
        return x if x.dtype.kind in "iub" else self.xp.where(x == 0, 0.0, x)

    def argsort(self, x: Array) -> Array:
        return self.xp.argsort(x, axis=0, kind="stable").astype(self.int)

    def cumsum(self, x: Array) -> Array:
        return self.xp.cumsum(x, axis=0)

    # -- structure ------------------------------------------------------------------------------------------------

    def stack(self, *parts: Array) -> Array:
        alike = all(p.shape == parts[0].shape for p in parts)
        return self.xp.stack(parts if alike else self.xp.broadcast_arrays(*parts))

    def fill(self, x: Array, shape: tuple[int, ...]) -> Array:
        """A scalar of every lane in each place of a shape."""
        return self.xp.broadcast_to(x, (*shape, self.xp.asarray(x).shape[-1]))

    def concat(self, *parts: Array) -> Array:
        lanes = max(p.shape[-1] for p in parts)
        return self.xp.concatenate([self.xp.broadcast_to(p, (*p.shape[:-1], lanes)) for p in parts])

    def index(self, x: Array, i: Array) -> Array:
        """Rows of x (n, ..., N) at the indices i (..., N) of each lane."""
        xp = self.xp
        if x.shape[-1] == 1:
            picked = xp.take(x[..., 0], i, axis=0)  # (*i.shape, *row)
            return xp.moveaxis(picked, i.ndim - 1, -1)
        lanes = xp.arange(x.shape[-1])
        picked = x[(i, *(slice(None),) * (x.ndim - 2), lanes)]
        return picked if x.ndim == 2 else xp.moveaxis(picked, i.ndim - 1, -1)

    def put(self, x: Array, i: Array, value: Array) -> Array:
        xp = self.xp
        here = xp.arange(x.shape[0]).reshape(-1, *(1,) * (x.ndim - 1)) == i
        return xp.where(here, value, x)

    def swap(self, x: Array, i: Array, j: Array) -> Array:
        at_i, at_j = self.index(x, i), self.index(x, j)
        return self.put(self.put(x, i, at_j), j, at_i)
