"""What a learner may hand back as a policy, and how it is asked: for its best actions, and for those that it draws."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.data.actors import one_of
from taskspec.model.model import Model, misused
from taskspec.policies.adapters import Asked, distribution
from taskspec.policies.values import policy_value, states_of, transposed
from taskspec.rollout.rollout import Rollout
from taskspec.scores.returns import Results, Return
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task

TIE = 1e-9
"""Values of actions that are this close, as a share of the largest, are tied."""


@dataclass(frozen=True, eq=False)
class Learned:
    """A policy, and the reward that it was learned from.

    Args:
        reward: float64 (S, A, S) over the states and actions of `taskspec.data.tabular(task)`, or a function of
            (obs, action, next_obs), all (N, ...); `reward_distance` says how far it is from the true one.
    """

    policy: Any
    reward: Any = None


@dataclass(frozen=True, slots=True)
class PolicyValues:
    """The expected returns of a policy: with its best actions, and with those that it draws."""

    deterministic: Return
    stochastic: Return


def values(policy: Any, results: Results, seed: int) -> PolicyValues:
    """What a policy earns: exactly where the task has a model and the policy can be tabulated on it, else in episodes.

    Args:
        policy: an object with `predict` (and maybe `probabilities`), a function of the observation, a table (see `_of_table`), or
            any of these as `Learned`.
        seed: of what it draws.

    Raises:
        SpecError: E706 for actions that are none, E713 for what is no policy.
    """
    policy = policy.policy if isinstance(policy, Learned) else policy
    if isinstance(policy, list | tuple) or hasattr(policy, "__array__"):
        return _of_table(np.asarray(policy), results, seed)
    chances = _chances(policy, results.task) if results.task.action_layout.form != "box" else None
    if chances is not None:
        return _of_chances(chances, policy, results, seed)
    if hasattr(policy, "predict"):
        best = _value(results, policy, True)
        is_one = "deterministic" not in inspect.signature(policy.predict).parameters
        return PolicyValues(best, best if is_one else _value(results, policy, False))
    if not callable(policy):
        misused(
            f"{type(policy).__name__} is not a policy",
            "a table, a function of the observation, an object with `predict`",
        )
    value = _value(results, _Each(policy, seed), None)
    return PolicyValues(value, value)


def _value(results: Results, policy: Any, deterministic: bool | None) -> Return:
    return policy_value(results, policy, deterministic).value


Chances = Callable[[Any], Array]
"""From observations (N, *shape) to the probabilities of actions (N, A)."""


def _chances(policy: Any, task: Task) -> Chances | None:
    """The probabilities that a policy tells of its actions, as those of Stable-Baselines3 do; None where it tells none."""
    for name in ("probabilities", "action_probabilities"):
        if hasattr(policy, name):
            told = getattr(policy, name)
            return lambda seen: np.asarray(told(seen), np.float64)
    if not hasattr(policy, "predict") or Asked(task, policy).probabilities(Rollout(task, 1).start(), 0) is None:
        return None

    def of_model(seen: Any) -> Array:
        found = distribution(policy, seen)
        assert found is not None
        return np.asarray(found.T)

    return of_model


def _of_chances(chances: Chances, policy: Any, results: Results, seed: int) -> PolicyValues:
    drawn, best = (_Telling(how, policy, results.task, seed) for how in (chances, lambda seen: greedy(chances(seen))))
    return PolicyValues(_value(results, best, None), _value(results, drawn, None))


def greedy(preferred: Array) -> Array:
    """Values of actions (..., A) as probabilities: the best one, or one of those that are tied for it, each as often."""
    high = preferred.max(axis=-1, keepdims=True)
    best = preferred >= high - TIE * np.maximum(np.abs(high), 1)
    found: Array = best / best.sum(axis=-1, keepdims=True)
    return found


# -- tables -------------------------------------------------------------------------------------------------------


def _of_table(table: Array, results: Results, seed: int) -> PolicyValues:
    """A table over observations that are one number: actions (O,) or (T, O), probabilities or values (O, A) or (T, O, A).

    Rows that are no probabilities are values of actions, of which the best are taken, and none are drawn.
    """
    seen, done = results.task.observation_layout, results.task.action_layout
    if seen.form != "discrete" or done.form not in ("discrete", "multi_discrete"):
        misused(f"a table is a policy where observations are one number and actions finite, not on {results.task.id}")
    count, actions = seen.counts[0], int(np.prod(done.counts))
    if table.dtype.kind in "iu" and table.shape[-1:] == (count,) and table.shape[-2:] != (count, actions):
        index = table - done.starts[0] if done.form == "discrete" else table
        if not ((index >= 0) & (index < actions)).all():
            misused(f"an action of the table is not in {results.task.action_space}")
        table = np.eye(actions)[index]
    if table.ndim not in (2, 3) or table.shape[-2:] != (count, actions):
        misused(
            f"a table has shape ({count},) for actions, ({count}, {actions}) for their probabilities or values; maybe with "
            f"the time in front; not {table.shape}",
            transposed(table, count, actions),
        )
    if not np.isfinite(table).all():
        what = "NaN" if np.isnan(table).any() else "an infinite number"
        misused(f"the table of probabilities or values of actions has {what} in it", "every entry is a finite number")
    drawn = table if _sums_to_one(table) else greedy(table)
    if table.ndim == 3:
        return PolicyValues(_timed(greedy(table), results), _timed(drawn, results))
    chances: list[Chances] = [_looked_up(each, seen) for each in (greedy(table), drawn)]
    best, stochastic = (_value(results, _Telling(how, None, results.task, seed), None) for how in chances)
    return PolicyValues(best, stochastic)


def _sums_to_one(table: Array) -> bool:
    return bool((table >= 0).all() and np.allclose(table.sum(axis=-1), 1))


def _looked_up(table: Array, seen: SpaceLayout) -> Chances:
    def rows(observations: Any) -> Array:
        found: Array = table[np.asarray(observations) - seen.starts[0]]
        return found

    return rows


def _timed(table: Array, results: Results) -> Return:
    """A table (T, O, A) needs an exact model, which has a state for each observation."""
    model: Model | None = results.model
    asked = Asked(results.task, _Telling(lambda seen: seen, None, results.task, 0))
    if model is None or model.task is not results.task or not asked.sees_state_alone:
        misused(f"a table over the time is a policy where observations show the state, not on {results.task.id}")
    seen = asked.observations(states_of(model), 0, np.random.default_rng(0)) - asked.seen.starts[0]
    return policy_value(results, table[:, seen].astype(np.float64), None).value


# -- as objects with `predict` ------------------------------------------------------------------------------------


class _Telling:
    """A policy that tells probabilities of its actions, and draws by them where episodes are needed."""

    def __init__(self, chances: Chances, policy: Any, task: Task, seed: int) -> None:
        self.action_probabilities, self.layout, self.rng = chances, task.action_layout, np.random.default_rng(seed)
        if hasattr(policy, "get_vec_normalize_env"):
            self.get_vec_normalize_env = policy.get_vec_normalize_env

    def predict(self, observations: Any) -> Array:
        rising = np.cumsum(self.action_probabilities(observations), axis=1)
        drawn = self.rng.random(len(rising))[:, None] * rising[:, -1:]
        index: Array = np.minimum((rising <= drawn).sum(axis=1), rising.shape[1] - 1)
        if self.layout.form == "discrete":
            return np.asarray(index + self.layout.starts[0])
        return np.stack(np.unravel_index(index, self.layout.counts), axis=1)


class _Each:
    """A function of one observation, which may take a generator as `rng`."""

    def __init__(self, function: Callable[..., Any], seed: int) -> None:
        self.function, options = function, {}
        try:
            if "rng" in inspect.signature(function).parameters:
                options = {"rng": np.random.default_rng(seed)}
        except ValueError:  # of a function that is not written in Python
            pass
        self.options: dict[str, Any] = options

    def predict(self, observations: Any) -> Array:
        lanes = len(next(iter(observations.values())) if isinstance(observations, dict) else observations)
        return np.array([self.function(one_of(observations, i), **self.options) for i in range(lanes)])
