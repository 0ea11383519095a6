"""A batch in which every kind of end occurs, in the forms that rollout buffers have."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from taskspec.base.arrays import Array

GRID = 8
"""Numbers of batches are multiples of 1/8, which floats hold exactly."""


@dataclass(frozen=True, eq=False)
class RolloutBatch:
    """T steps of N = 4 environments side by side, by the convention of `taskspec.exact.oracle.estimators`.

    Attributes:
        rewards, values: (T, N).
        next_values: (T, N), of the observations that steps returned, before any reset; not 0 after a termination.
        terminated, truncated: bool (T, N), as steps returned them.
        ratios: (T, N), pi(a | s) / mu(a | s), from 1/8 to 4.
    """

    rewards: Array
    values: Array
    next_values: Array
    terminated: Array
    truncated: Array
    ratios: Array

    @property
    def dones(self) -> Array:
        """bool (T, N), terminated or truncated."""
        return np.asarray(self.terminated | self.truncated)

    @property
    def starts(self) -> Array:
        """bool (T, N), whether each row is the first of an episode: `dones` of the row before, as CleanRL stores them."""
        return np.concatenate([np.ones_like(self.dones[:1]), self.dones[:-1]])

    @property
    def last_values(self) -> Array:
        """(N,), of the observations that the last row returned."""
        return np.asarray(self.next_values[-1])

    @property
    def log_ratios(self) -> Array:
        """float64 (T, N), the logarithms of the ratios: log-probabilities of the learner minus those of the actor."""
        return np.log(self.ratios.astype(np.float64))


def batch(steps: int = 12, seed: int = 0, *, exact: bool = False) -> RolloutBatch:
    """Return a random batch in which each environment has terminations and truncations, and their last rows differ.

    In the last row environment 0 goes on, 1 terminates, 2 is truncated, and 3 does both at once.

    Args:
        steps: T, at least 8.
        seed: of the numbers, and of the rows of the ends.
        exact: fractions in object arrays, the same numbers; else float64.

    Returns:
        The batch.
    """
    rng = np.random.default_rng(seed)
    shape = (steps, 4)
    rewards = rng.integers(-2 * GRID, 2 * GRID + 1, shape)
    values = rng.integers(-4 * GRID, 4 * GRID + 1, shape)
    others = rng.integers(-4 * GRID, 4 * GRID + 1, shape)
    ratios = rng.integers(1, 4 * GRID + 1, shape)
    terminated = np.zeros(shape, np.bool_)
    truncated = np.zeros(shape, np.bool_)
    for lane in range(4):
        first, second, third = np.sort(rng.choice(steps - 2, 3, replace=False))
        terminated[[first, third], lane] = True
        truncated[[second, third], lane] = True
    terminated[-1] = [False, True, False, True]
    truncated[-1] = [False, False, True, True]
    next_values = np.concatenate([values[1:], others[-1:]])
    next_values = np.where(terminated | truncated, others, next_values)
    scaled = [_scaled(each, exact) for each in (rewards, values, next_values, ratios)]
    return RolloutBatch(scaled[0], scaled[1], scaled[2], terminated, truncated, scaled[3])


def _scaled(whole: Array, exact: bool) -> Array:
    if exact:
        return np.asarray(whole.astype(object) * Fraction(1, GRID))
    return whole / GRID
