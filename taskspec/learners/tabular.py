"""Maximum-entropy inverse reinforcement learning on the exact model: causal (MCE, Ziebart 2010) and not (MaxEnt, 2008)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.abstraction.abstraction import abstraction
from taskspec.base.arrays import Array
from taskspec.base.progress import tell
from taskspec.data import Demonstrations, Tabular
from taskspec.data.tabular import LookAlike, tabular
from taskspec.learners.case import LearnerCase, cannot_learn
from taskspec.learners.settings import Matching
from taskspec.model.model import NoModel
from taskspec.solve.backward import backward, first_values
from taskspec.task.task import Task

TOLD = 5000
"""Iterations between two that are told."""


@dataclass(frozen=True, eq=False)
class StateReward:
    """A reward of where a step leads: `worth`, float64 (O,), of observations that are numbers from `first`."""

    worth: Array
    first: int

    def __call__(self, observations: Any, actions: Any, next_observations: Any) -> Array:
        """Float64 (N,), of observations (N,), actions, and what followed (N,)."""
        found: Array = self.worth[np.asarray(next_observations) - self.first]
        return found


@dataclass(frozen=True, eq=False)
class Timed:
    """A policy that knows the time, as a table of probabilities (T, O, A) of actions over observations, which are one number.

    Attributes:
        table: float64.
        reward: what was learned of it.
        gap: how far the visits of the learner were from those of the expert in the end, at most in a state.
        iterations: that it took.
    """

    table: Array
    reward: StateReward
    gap: float
    iterations: int

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return self.table.astype(dtype or np.float64)


def matched(config: Matching, case: LearnerCase) -> list[Timed]:
    """A policy for each seed, of rewards that begin at random.

    Raises:
        CannotLearn: tasks without an exact model of what is observed, without a horizon, or with states that look alike.
    """
    try:
        return _matched(config, case)
    except (NoModel, LookAlike) as error:
        cannot_learn(error.diagnostics[0].message, "take another learner")


def _matched(config: Matching, case: LearnerCase) -> list[Timed]:
    found = tabular(case.task)
    if found.horizon is None:
        cannot_learn(f"episodes of {case.task.id} have no horizon", "give the task one")
    if abstraction(case.task) is not None:
        cannot_learn(f"the exact model of {case.task.id} is that of its abstraction", "take another learner")
    wanted = visits(found, case.demonstrations, config.absorb)
    seen, states = _shown(found, case.task), np.flatnonzero(~found.absorbed)
    start = np.stack([np.random.default_rng(seed).standard_normal(found.n_states) for seed in case.seeds])
    reward, gaps, taken = fit(config, found, wanted, start)
    tables = soft_policy(found, reward, config)
    tables = np.moveaxis(tables[..., states], -1, -2)
    layout = case.task.observation_layout
    learned, count, first = [], layout.counts[0], layout.starts[0]
    for i in range(len(reward)):
        table = np.full((len(tables), count, found.n_actions), 1 / found.n_actions)
        worth = np.zeros(count)
        table[:, seen[states]] = tables[:, i]
        for some in (np.flatnonzero(found.absorbed), states):  # where both look alike, episodes go on
            worth[seen[some]] = reward[i, some]
        learned.append(Timed(table, StateReward(worth, first), float(gaps[i]), int(taken[i])))
    return learned


def _shown(found: Tabular, task: Task) -> Array:
    """What is seen in each state, as a number from 0 (S,)."""
    layout = task.observation_layout
    if layout.form != "discrete":
        cannot_learn(f"observations of {task.id} are not one number", "take another learner")
    return np.asarray(found.observations).astype(np.int64) - layout.starts[0]


def visits(found: Tabular, shown: Demonstrations, absorb: bool) -> Array:
    """How often an episode is in each state (S,), the last one included; where it ended early, for ever after if `absorb`."""
    last = shown.starts + shown.lengths - 1
    before = found.index(shown.obs)
    over = np.asarray(shown.terminated)[last] & (shown.lengths < found.horizon)
    after = np.where(over, -1, 0)
    ends = np.asarray(shown.next_obs)[last]
    if (~over).any():
        after[~over] = found.index(ends[~over])
    if over.any():
        after[over] = _absorbed(found, ends[over])
    total = np.bincount(before, minlength=found.n_states).astype(np.float64)
    times = np.where(over & absorb, found.horizon - shown.lengths + 1, 1)
    total += np.bincount(after, weights=times, minlength=found.n_states)
    return total / len(last)


def _absorbed(found: Tabular, ends: Array) -> Array:
    """The states that stand for the ends of episodes that look like this."""
    seen, places = np.asarray(found.observations), np.flatnonzero(found.absorbed)
    same = (ends.reshape(len(ends), 1, -1) == seen[places].reshape(1, len(places), -1)).all(axis=2)
    if not (same.sum(axis=1) == 1).all():
        cannot_learn(f"the endings of {found.task.id} do not distinguish its states")
    found_at: Array = places[same.argmax(axis=1)]
    return found_at


def fit(config: Matching, found: Tabular, wanted: Array, start: Array) -> tuple[Array, Array, Array]:
    """Rewards (K, S) under which the soft policy visits states as often as wanted; the gaps, and the iterations (K,)."""
    reward, m, v = start.copy(), np.zeros_like(start), np.zeros_like(start)
    gaps, taken = np.full(len(start), np.inf), np.full(len(start), config.iterations)
    running = np.arange(len(start))
    for i in range(config.iterations):
        if i % TOLD == 0:
            tell(f"{found.task.name}: iteration {i:,}, {len(running)} seeds")
        slope = wanted - expected(found, soft_policy(found, reward[running], config))
        gaps[running] = np.abs(slope).max(axis=1)
        close = (gaps[running] < config.tolerance) | (np.linalg.norm(slope, axis=1) < config.tolerance)
        taken[running[close]] = i
        running, slope = running[~close], slope[~close]
        if not len(running):
            break
        b1, b2 = config.betas
        m[running] = b1 * m[running] + (1 - b1) * slope
        v[running] = b2 * v[running] + (1 - b2) * slope**2
        c1, c2 = (1 - b1 ** (i + 1), 1 - b2 ** (i + 1)) if config.bias else (1.0, 1.0)
        reward[running] += config.learning_rate * (m[running] / c1) / (np.sqrt(v[running] / c2) + 1e-7)
    return reward, gaps, taken


def soft_policy(found: Tabular, reward: Array, config: Matching) -> Array:
    """Return pi (T, K, A, S) of soft backward induction from rewards of states (K, S)."""
    later = _expectation(found) if config.causal else _log_mean_exp(found, config.floor)
    pi = []

    def choose(t: int, q: Array) -> Array:
        """Return V (K, S), with the reward of being in the state, from Q (K, A, S)."""
        most = q.max(axis=1, keepdims=True)
        powers = np.exp(q - most)
        total = powers.sum(axis=1, keepdims=True)
        pi.append(powers / total)
        return np.asarray(reward + (most + np.log(total))[:, 0])

    first_values(backward(lambda t, value: later(value), choose, reward, found.horizon or 0))
    return np.stack(pi[::-1])


def expected(found: Tabular, tables: Array) -> Array:
    """How often states are visited (K, S), the last ones included."""
    now = np.broadcast_to(found.p0, (tables.shape[1], found.n_states))
    total, going = now.copy(), found.P.transpose(1, 0, 2).reshape(-1, found.n_states)
    for table in tables:
        now = (table * now[:, None]).reshape(len(now), -1) @ going
        total += now
    return total


def _expectation(found: Tabular) -> Any:
    """Values (K, S) of what follows to those of actions (K, A, S)."""
    going = found.P.transpose(1, 0, 2).reshape(-1, found.n_states).T
    return lambda value: (value @ going).reshape(len(value), found.n_actions, found.n_states)


def _log_mean_exp(found: Tabular, floor: float) -> Any:
    """The same, as if one could choose how chance falls; of those next states alone that there are, but for a floor."""
    chances = found.P.transpose(1, 0, 2).reshape(-1, found.n_states)
    many = int((chances > 0).sum(axis=1).max())
    places = np.argsort(-chances, axis=1, kind="stable")[:, :many]
    with np.errstate(divide="ignore"):
        logs = np.log(np.take_along_axis(chances, places, axis=1))

    def backed(value: Array) -> Array:
        worth: Array = np.logaddexp.reduce(value[:, places] + logs, axis=2)
        if floor:
            least = np.log(floor) + np.logaddexp.reduce(value, axis=1, keepdims=True)
            worth = np.logaddexp(worth, least)
        return worth.reshape(len(value), found.n_actions, found.n_states)

    return backed
