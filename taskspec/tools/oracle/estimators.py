"""Estimators on a batch, each by its published definition: obvious, slow (T^2 operations), and in fractions if given those.

The convention of all functions here. Arrays are (T,), or (T, N) for N environments side by side. Row t is one step:

- `values[t]`: the value V of the observation that the step started from
- `rewards[t]`, `terminated[t]`, `truncated[t]`: what this step returned, not the step before or after it
- `next_values[t]`: the value V of the observation that this step returned, before any reset (`next_values` makes them from
  the values of a buffer)

- A *termination* is an end of the world: nothing follows, and `next_values[t]` is not looked at.
- A *truncation* is a cut: `next_values[t]` replaces the rewards that would have followed. With both flags a step terminates.
- A *reset in the middle* of a batch lies between a step with either flag and the row after it. That row belongs to the next
  episode, and nothing of it enters the rows before.
- The *last row* of a batch is a cut, too, unless it terminates.
- Arrays of another shape are refused (E713).
- Where environments reset in a step of their own (Gymnasium's `AutoresetMode.NEXT_STEP`), that row is no step of any episode:
  its own result means nothing, and it changes no other row.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import misused
from taskspec.tools.oracle.tables import plain


def numbers(*values: Any) -> list[Array]:
    """Return numbers and arrays in one arithmetic.

    Args:
        values: numbers, lists, arrays of NumPy or JAX, tensors.

    Returns:
        Object arrays, if some value has fractions and none has floats; else float64.
    """
    arrays = [plain(value) for value in values]
    kinds = {type(x) for each in arrays if each.dtype == object for x in each.reshape(-1)}
    is_float = float in kinds or any(each.dtype.kind == "f" for each in arrays)
    if Fraction in kinds and not is_float:
        return [each.astype(object) for each in arrays]
    return [each.astype(np.float64) for each in arrays]


def flags(*values: Any) -> list[Array]:
    """Return flags, bool arrays."""
    return [plain(value).astype(np.bool_) for value in values]


def check_shapes(**arrays: Array) -> None:
    """Refuse (E713) arrays of another shape than the first, which NumPy might spread over each other; single numbers may be."""
    first, *others = arrays
    shape = arrays[first].shape
    for name in others:
        if arrays[name].shape not in ((), shape):
            hint = f"reshape it, as in `{name}.reshape({first}.shape)`"
            misused(f"`{first}` has shape {shape}, and `{name}` has {arrays[name].shape}", hint)


# -- values of a buffer -----------------------------------------------------------------------------------------------


def next_values(values: Any, last_values: Any, terminated: Any, truncated: Any, final_values: Any = None) -> Array:
    """Return the values of the observations that steps returned, from those that a rollout buffer holds.

    Args:
        values: (T,) or (T, N), of the observations that steps started from.
        last_values: () or (N,), of the observations after the last row.
        terminated, truncated: bool, (T,) or (T, N).
        final_values: (T,) or (T, N), of the last observations of episodes (`info["final_obs"]`), looked at in truncated rows
            alone. Without them no truncation may stand before the last row.

    Returns:
        (T,) or (T, N); row t is values[t + 1] where the episode goes on, final_values[t] where it was truncated, 0 where it
        terminated, last_values in the last row.

    Raises:
        SpecError: E713 for a truncation whose final value is not given.
    """
    values, last_values = numbers(values, last_values)
    terminated, truncated = flags(terminated, truncated)
    values_after = np.concatenate([values[1:], np.broadcast_to(last_values, values[:1].shape)])
    cut = truncated & ~terminated
    if final_values is None:
        if cut[:-1].any():
            misused("a truncated step before the last row needs the value of its last observation", "`final_values`")
    else:
        (final_values,) = numbers(final_values)
        values_after = np.where(cut, final_values, values_after)
    return np.where(terminated, 0, values_after)


def _followed(terminated: Array, values: Array) -> Array:
    return np.where(terminated, 0, values)


def _goes_on(terminated: Array, truncated: Array) -> Array:
    """Return whether the next row continues the episode, bool (T, ...): not after an end, nor after the last row."""
    continues = ~(terminated | truncated)
    continues[-1] = False
    return continues


# -- returns and advantages -------------------------------------------------------------------------------------------


def td_errors(rewards: Any, values: Any, next_values: Any, terminated: Any, gamma: Any) -> Array:
    """Return the TD errors, delta_t = r_t + gamma V(s_{t+1}) - V(s_t), with V = 0 after a termination.

    Args:
        rewards, values, next_values, terminated: (T,) or (T, N), by the convention of this module.
        gamma: the discount.

    Returns:
        (T,) or (T, N), in the unit of the reward.

    Source: R. Sutton and A. Barto, Reinforcement Learning (2018), equation (6.5).
    """
    rewards, values, next_values, gamma = numbers(rewards, values, next_values, gamma)
    (terminated,) = flags(terminated)
    check_shapes(rewards=rewards, values=values, next_values=next_values, terminated=terminated)
    return np.asarray(rewards + gamma * _followed(terminated, next_values) - values)


def monte_carlo(rewards: Any, terminated: Any, truncated: Any, gamma: Any, next_values: Any = 0) -> Array:
    """Return the returns, G_t = r_t + gamma r_{t+1} + gamma^2 r_{t+2} + ..., up to the end of the episode.

    Args:
        rewards, terminated, truncated: (T,) or (T, N), by the convention of this module.
        gamma: the discount.
        next_values: (T,) or (T, N), that cuts are worth; 0 leaves out what would have followed, which is biased.

    Returns:
        (T,) or (T, N), in the unit of the reward.

    Source: Sutton and Barto (2018), equation (3.8).
    """
    rewards, gamma, next_values = numbers(rewards, gamma, next_values)
    return n_step_returns(
        rewards, np.broadcast_to(next_values, rewards.shape), terminated, truncated, gamma, len(rewards)
    )


def n_step_returns(rewards: Any, next_values: Any, terminated: Any, truncated: Any, gamma: Any, n: int) -> Array:
    """Return the n-step returns, G_t = r_t + ... + gamma^(n-1) r_{t+n-1} + gamma^n V(s_{t+n}).

    Where the episode ends, or the batch, after m < n steps, it is the m-step return.

    Args:
        rewards, next_values, terminated, truncated: (T,) or (T, N), by the convention of this module.
        gamma: the discount.
        n: how many rewards are summed, at least 1.

    Returns:
        (T,) or (T, N), in the unit of the reward.

    Source: Sutton and Barto (2018), equation (7.1).
    """
    if n < 1:
        misused(f"an n-step return sums at least one reward, not {n}")
    rewards, next_values, gamma = numbers(rewards, next_values, gamma)
    terminated, truncated = flags(terminated, truncated)
    check_shapes(rewards=rewards, next_values=next_values, terminated=terminated, truncated=truncated)
    goes_on = _goes_on(terminated, truncated)
    after = _followed(terminated, next_values)
    G = np.zeros_like(rewards)
    for t in range(len(rewards)):
        going = np.ones(rewards.shape[1:], np.bool_)
        for k in range(min(n, len(rewards) - t)):
            is_last = ~goes_on[t + k] | (k == n - 1)
            paid = gamma**k * rewards[t + k] + np.where(is_last, gamma ** (k + 1) * after[t + k], 0)
            G[t] = G[t] + np.where(going, paid, 0)
            going = going & ~is_last
    return np.asarray(G)


def lambda_returns(rewards: Any, next_values: Any, terminated: Any, truncated: Any, gamma: Any, lam: Any) -> Array:
    """Return the lambda-returns, G_t = r_t + gamma ((1 - lambda) V(s_{t+1}) + lambda G_{t+1}).

    Where the episode does not go on, or the batch ends, V(s_{t+1}) stands in place of G_{t+1}.

    Args:
        rewards, next_values, terminated, truncated: (T,) or (T, N), by the convention of this module.
        gamma: the discount.
        lam: lambda, from 0 (one step) to 1 (Monte Carlo).

    Returns:
        (T,) or (T, N), in the unit of the reward.

    Source: Sutton and Barto (2018), equation (12.18) with a constant lambda.
    """
    rewards, next_values, gamma, lam = numbers(rewards, next_values, gamma, lam)
    terminated, truncated = flags(terminated, truncated)
    check_shapes(rewards=rewards, next_values=next_values, terminated=terminated, truncated=truncated)
    goes_on = _goes_on(terminated, truncated)
    after = _followed(terminated, next_values)
    G = np.zeros_like(rewards)
    later = after[-1]
    for t in reversed(range(len(rewards))):
        later = np.where(goes_on[t], later, after[t])
        G[t] = rewards[t] + gamma * ((1 - lam) * after[t] + lam * later)
        later = G[t]
    return np.asarray(G)


def gae(rewards: Any, values: Any, next_values: Any, terminated: Any, truncated: Any, gamma: Any, lam: Any) -> Array:
    """Return generalised advantage estimates, A_t = sum over l of (gamma lambda)^l delta_{t+l}, up to the end of the episode.

    Args:
        rewards, values, next_values, terminated, truncated: (T,) or (T, N), by the convention of this module.
        gamma: the discount.
        lam: lambda, from 0 (TD errors) to 1 (returns minus values).

    Returns:
        (T,) or (T, N), in the unit of the reward. The targets of a critic are these plus `values`.

    Source: J. Schulman, P. Moritz, S. Levine, M. Jordan and P. Abbeel, High-dimensional continuous control using generalized
    advantage estimation (2016), equation (16).
    """
    delta, gamma, lam = numbers(td_errors(rewards, values, next_values, terminated, gamma), gamma, lam)
    terminated, truncated = flags(terminated, truncated)
    check_shapes(rewards=delta, truncated=truncated)
    goes_on = _goes_on(terminated, truncated)
    A = np.zeros_like(delta)
    for t in range(len(delta)):
        weight = np.ones_like(delta[t])
        for k in range(t, len(delta)):
            A[t] = A[t] + weight * delta[k]
            weight = np.where(goes_on[k], gamma * lam * weight, 0)
    return np.asarray(A)


def vtrace(
    rewards: Any, values: Any, next_values: Any, terminated: Any, truncated: Any, ratios: Any, gamma: Any, *,
    rho_bar: Any = 1, c_bar: Any = 1, lam: Any = 1,
) -> tuple[Array, Array]:  # fmt: skip
    """Return V-trace targets and advantages.

        v_s = V(x_s) + sum over t >= s of gamma^(t - s) c_s ... c_{t-1} rho_t (r_t + gamma V(x_{t+1}) - V(x_t)),
        A_s = rho_s (r_s + gamma v_{s+1} - V(x_s)),    rho_t = min(rho_bar, ratio_t),    c_t = lambda min(c_bar, ratio_t),

    up to the end of the episode. After a step that does not go on, v_{s+1} is V(x_{s+1}).

    Args:
        rewards, values, next_values, terminated, truncated: (T,) or (T, N), by the convention of this module.
        ratios: (T,) or (T, N), pi(a | x) / mu(a | x) of the learner's policy to the one that acted: exp of the difference of
            their log-probabilities.
        gamma: the discount.
        rho_bar, c_bar: the largest weights.
        lam: lambda.

    Returns:
        Targets v and advantages A, (T,) or (T, N), in the unit of the reward.

    Source: L. Espeholt et al., IMPALA (2018), equation (1), remark 2 and section 4.2.
    """
    given = numbers(td_errors(rewards, values, next_values, terminated, gamma), rewards, values, next_values, ratios)
    delta, rewards, values, next_values, ratios, gamma, rho_bar, c_bar, lam = numbers(
        *given, gamma, rho_bar, c_bar, lam
    )
    terminated, truncated = flags(terminated, truncated)
    check_shapes(rewards=rewards, truncated=truncated, ratios=ratios)
    goes_on = _goes_on(terminated, truncated)
    rho = np.minimum(rho_bar, ratios)
    c = lam * np.minimum(c_bar, ratios)
    v = values.copy()
    for s in range(len(v)):
        weight = np.ones_like(v[s])
        for t in range(s, len(v)):
            v[s] = v[s] + weight * rho[t] * delta[t]
            weight = np.where(goes_on[t], gamma * c[t] * weight, 0)
    following = np.concatenate([v[1:], next_values[-1:]])
    after = _followed(terminated, np.where(goes_on, following, next_values))
    return v, rho * (rewards + gamma * after - values)


GRID = 8
"""Numbers of batches are multiples of 1/8, which floats hold exactly."""
LEAST_STEPS = 8
"""Steps of a batch that have room for all ends."""


@dataclass(frozen=True, eq=False)
class RolloutBatch:
    """T steps of N = 4 environments side by side, by the convention of `taskspec.tools.oracle.estimators`.

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
    if steps < LEAST_STEPS:
        misused(f"a batch has at least {LEAST_STEPS} steps, not {steps}")
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
