"""Chains without an end: the expected total along a Markov chain that is left in the end, enclosed.

A candidate v of v = g + P v comes from a linear solver, or from repeated substitution, and need not be trusted. What is
proved rests on a second candidate w >= 0 with w - P w >= c > 0 in every state, checked with outward rounding: it shows
that the chain is left, and that a residual of at most r moves the solution by at most (r / c) w.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from taskspec.exact.model.failure import refuse, scipy_module, scipy_sparse
from taskspec.exact.planning.certified.following import Bound

Array = np.ndarray[Any, Any]
Image = Callable[[Bound], Bound]
"""P x with a bound of its error, from x; both (S,)."""
DIRECT = 3000
"""States up to which equations are solved directly."""
WORK = 300_000_000
"""Non-zeros that repeated substitution may go through."""
SWEEP = 10_000
"""Non-zeros that would take as long as starting to go through them does."""


@dataclass(frozen=True)
class Chain:
    """Equations v = gain + P v over the states `inside` (S,); v is 0 elsewhere.

    `matrix` (S, S) is P in floats, for candidates; `image` is P with its bounds, for proofs.
    """

    matrix: Any
    image: Image
    inside: Array

    def solved(self, gain: Array) -> Array:
        """A candidate solution (S,).

        Raises:
            SpecError: (E712) where equations that are solved directly have no solution, since the chain is never left.
        """
        inside = np.flatnonzero(self.inside)
        found = np.zeros(len(self.inside))
        if len(inside):
            solve = _direct if len(inside) <= DIRECT else _substituted
            found[inside] = solve(self.matrix[inside][:, inside], gain[inside])
        return found

    def enclosed(self, gain: Bound) -> Bound:
        """The solution with a bound of its error.

        Raises:
            SpecError: (E712) where it cannot be shown that the chain is left.
        """
        value = self.solved(gain.value)
        image = self.image(Bound(value, np.zeros_like(value)))
        off = np.abs(gain.value + image.value - value) + gain.error + image.error
        off += 4e-16 * (np.abs(gain.value) + np.abs(image.value) + np.abs(value))
        residual = float(np.max(off[self.inside], initial=0.0))
        ratio, w = self.decay()
        return Bound(value, np.where(self.inside, residual * ratio * w * (1 + 1e-12), 0.0))

    def decay(self) -> tuple[float, Array]:
        """1/c and w >= 0 with w - P w >= c > 0 inside; SpecError (E712) where none is found."""
        inside = self.inside
        w = np.maximum(self.solved(inside.astype(np.float64)), 0.0)
        w = np.where(inside & np.isfinite(w), w, 0.0)
        image = self.image(Bound(w, np.zeros_like(w)))
        c = float(np.min((w - image.value - image.error - 4e-16 * (w + image.value))[inside], initial=np.inf))
        if not c > 0:
            _refuse_unending()
        return 1 / c * (1 + 1e-12), w


def _refuse_unending() -> NoReturn:
    refuse("it cannot be shown that episodes end", "give the task a horizon, or a discount below 1")


def _direct(matrix: Any, gain: Array) -> Array:
    """The solution by sparse LU, refined once."""
    left = scipy_sparse().identity(len(gain), format="csc") - matrix.tocsc()
    try:
        factors = scipy_module("linalg").splu(left)
    except RuntimeError:  # singular
        _refuse_unending()
    found = factors.solve(gain)
    found = found + factors.solve(gain - left @ found)
    if not np.isfinite(found).all():
        _refuse_unending()
    return np.asarray(found)


def _substituted(matrix: Any, gain: Array) -> Array:
    """The solution by repeated substitution, as far as `WORK` goes."""
    value, before = gain, np.inf
    for _ in range(WORK // (SWEEP + matrix.nnz + len(gain)) + 1):
        better = gain + matrix @ value
        gap = float(np.max(np.abs(better - value)))
        value = better
        if gap <= 1e-16 * float(np.max(np.abs(value))) or not np.isfinite(gap) or (gap >= before and gap < 1e-12):
            break
        before = gap
    return value
