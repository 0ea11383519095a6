"""Maximum-entropy inverse reinforcement learning on the exact model.

Sources: Ziebart, Bagnell and Dey (2010) and Ziebart's thesis (2010), chapter 9, for the causal version; Ziebart, Maas, Bagnell
and Dey (2008) for the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import tell
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.model.model import NoModel
from taskspec.exact.solve.backward import backward, first_values
from taskspec.language.task.task import Task
from taskspec.learn.data.episodes import Demonstrations
from taskspec.learn.data.tabular import LookAlike, Tabular, tabular
from taskspec.learn.learners.interface import CannotLearn, LearnerCase
from taskspec.learn.learners.paper_settings import Matching

REPORT_EVERY = 5000
"""Iterations between reports of progress."""


@dataclass(frozen=True, eq=False)
class StateReward:
    """A reward of the next observation: `values`, float64 (O,), of observations that are numbers from `first`."""

    values: Array
    first: int

    def __call__(self, observations: Any, actions: Any, next_observations: Any) -> Array:
        return self.values[np.asarray(next_observations) - self.first]


@dataclass(frozen=True, eq=False)
class TimedPolicy:
    """A policy of time and observation, which is one number: probabilities (T, O, A) of actions.

    Attributes:
        table: float64.
        reward: the learned reward.
        gap: the largest difference, over states, between the visits of the learner and of the demonstrations.
        iterations: until convergence.
    """

    table: Array
    reward: StateReward
    gap: float
    iterations: int

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return self.table.astype(dtype or np.float64)


def train_maxent(config: Matching, case: LearnerCase) -> list[TimedPolicy]:
    """Train a policy for each seed; seeds begin with different random rewards."""
    try:
        return _train(config, case)
    except (NoModel, LookAlike) as error:
        raise CannotLearn(error.diagnostics[0].message, "take another learner") from None


def _train(config: Matching, case: LearnerCase) -> list[TimedPolicy]:
    mdp = tabular(case.task)
    if mdp.horizon is None:
        raise CannotLearn(f"episodes of {case.task.id} have no horizon", "give the task one")
    if abstraction(case.task) is not None:
        raise CannotLearn(f"the exact model of {case.task.id} is that of its abstraction", "take another learner")
    demonstrated = visits(mdp, case.demonstrations, config.absorb)
    observation = _observations(mdp, case.task)
    start = np.stack([np.random.default_rng(seed).standard_normal(mdp.n_states) for seed in case.seeds])
    reward, gaps, iterations = fit(config, mdp, demonstrated, start)
    pi = soft_policy(mdp, reward, config)
    running = np.flatnonzero(~mdp.absorbed)
    layout = case.task.observation_layout
    count = layout.counts[0]
    learned = []
    for i in range(len(reward)):
        table = np.full((len(pi), count, mdp.n_actions), 1 / mdp.n_actions)
        table[:, observation[running]] = np.moveaxis(pi[:, i][..., running], -1, -2)
        values = np.zeros(count)
        for states in (np.flatnonzero(mdp.absorbed), running):  # where both are observed alike, the running ones count
            values[observation[states]] = reward[i, states]
        learned.append(TimedPolicy(table, StateReward(values, layout.starts[0]), float(gaps[i]), int(iterations[i])))
    return learned


def _observations(mdp: Tabular, task: Task) -> Array:
    layout = task.observation_layout
    if layout.form != "discrete":
        raise CannotLearn(f"observations of {task.id} are not one number", "take another learner")
    return np.asarray(mdp.observations).astype(np.int64) - layout.starts[0]


def visits(mdp: Tabular, shown: Demonstrations, absorb: bool) -> Array:
    """Return the mean visits (S,) of demonstrated episodes; those that ended early stay in their last state if `absorb`."""
    last = shown.starts + shown.lengths - 1
    before = mdp.index(shown.obs)
    over = np.asarray(shown.terminated)[last] & (shown.lengths < mdp.horizon)
    after = np.where(over, -1, 0)
    ends = np.asarray(shown.next_obs)[last]
    if (~over).any():
        after[~over] = mdp.index(ends[~over])
    if over.any():
        after[over] = _absorbed(mdp, ends[over])
    total = np.bincount(before, minlength=mdp.n_states).astype(np.float64)
    times = np.where(over & absorb, mdp.horizon - shown.lengths + 1, 1)
    total += np.bincount(after, weights=times, minlength=mdp.n_states)
    return total / len(last)


def _absorbed(mdp: Tabular, ends: Array) -> Array:
    places = np.flatnonzero(mdp.absorbed)
    candidates = np.asarray(mdp.observations)[places]
    same = (ends.reshape(len(ends), 1, -1) == candidates.reshape(1, len(places), -1)).all(axis=2)
    if not (same.sum(axis=1) == 1).all():
        raise CannotLearn(f"the endings of {mdp.task.id} do not distinguish its states")
    return np.asarray(places[same.argmax(axis=1)])


def fit(config: Matching, mdp: Tabular, demonstrated: Array, start: Array) -> tuple[Array, Array, Array]:
    """Return rewards (K, S) whose soft policy has the demonstrated visits (S,), the gaps and the iterations (K,).

    The likelihood's gradient is the difference of visits; it is climbed by Adam.
    """
    reward = start.copy()
    m = np.zeros_like(start)
    v = np.zeros_like(start)
    gaps = np.full(len(start), np.inf)
    taken = np.full(len(start), config.iterations)
    running = np.arange(len(start))
    b1, b2 = config.betas
    for i in range(config.iterations):
        if i % REPORT_EVERY == 0:
            tell(f"{mdp.task.name}: iteration {i:,}, {len(running)} seeds")
        gradient = demonstrated - expected_visits(mdp, soft_policy(mdp, reward[running], config))
        gaps[running] = np.abs(gradient).max(axis=1)
        close = (gaps[running] < config.tolerance) | (np.linalg.norm(gradient, axis=1) < config.tolerance)
        taken[running[close]] = i
        running = running[~close]
        gradient = gradient[~close]
        if not len(running):
            break
        m[running] = b1 * m[running] + (1 - b1) * gradient
        v[running] = b2 * v[running] + (1 - b2) * gradient**2
        c1 = c2 = 1.0
        if config.bias:
            c1 = 1 - b1 ** (i + 1)
            c2 = 1 - b2 ** (i + 1)
        reward[running] += config.learning_rate * (m[running] / c1) / (np.sqrt(v[running] / c2) + 1e-7)
    return reward, gaps, taken


def soft_policy(mdp: Tabular, reward: Array, config: Matching) -> Array:
    """Return pi, float64 (T, K, A, S), by soft backward induction from rewards of states (K, S).

    V[t, s] = r[s] + log sum_a exp Q[t, s, a]  (9.1)
    Q[t, s, a] = E V[t + 1, s']  (9.2)
    pi[t, s, a] = exp(Q[t, s, a] - log sum_b exp Q[t, s, b])  (9.3)

    Source: Ziebart (2010), with the reward in V. The version that is not causal has log E exp V in place of E V.
    """
    if config.causal:
        q_values = _expectation(mdp)
    else:
        q_values = _log_mean_exp(mdp, config.floor)
    pi = []

    def choose(t: int, q: Array) -> Array:
        if mdp.model.legal is not None:
            q = np.where(mdp.model.legal, q, -np.inf)
        largest = q.max(axis=1, keepdims=True)
        exp_q = np.exp(q - largest)
        total = exp_q.sum(axis=1, keepdims=True)
        pi.append(exp_q / total)
        return np.asarray(reward + (largest + np.log(total))[:, 0])

    first_values(backward(lambda t, value: q_values(value), choose, reward, mdp.horizon or 0))
    return np.stack(pi[::-1])


def expected_visits(mdp: Tabular, pi: Array) -> Array:
    """Return the expected visits (K, S) of policies (T, K, A, S) in T steps and the last states.

    Source: Ziebart et al. (2008), algorithm 1, steps 4 to 6.
    """
    d = np.broadcast_to(mdp.p0, (pi.shape[1], mdp.n_states))
    total = d.copy()
    p = _rows(mdp)
    for pi_t in pi:
        d = (pi_t * d[:, None]).reshape(len(d), -1) @ p
        total += d
    return total


def _rows(mdp: Tabular) -> Array:
    return mdp.P.transpose(1, 0, 2).reshape(-1, mdp.n_states)


def _expectation(mdp: Tabular) -> Callable[[Array], Array]:
    """Return the function from V (K, S) to Q (K, A, S), Q = E V."""
    p = _rows(mdp).T
    return lambda value: (value @ p).reshape(len(value), mdp.n_actions, mdp.n_states)


def _log_mean_exp(mdp: Tabular, floor: float) -> Callable[[Array], Array]:
    """Return the function from V (K, S) to Q (K, A, S), Q = log E exp V, with `floor` added to probabilities."""
    p = _rows(mdp)
    successors = int((p > 0).sum(axis=1).max())
    places = np.argsort(-p, axis=1, kind="stable")[:, :successors]
    with np.errstate(divide="ignore"):
        log_p = np.log(np.take_along_axis(p, places, axis=1))

    def q_values(value: Array) -> Array:
        q: Array = np.logaddexp.reduce(value[:, places] + log_p, axis=2)
        if floor:
            least = np.log(floor) + np.logaddexp.reduce(value, axis=1, keepdims=True)
            q = np.logaddexp(q, least)
        return q.reshape(len(value), mdp.n_actions, mdp.n_states)

    return q_values
