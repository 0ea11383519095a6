"""Fingerprints: which Bellman operator a learner really applies, read from the values that it learned.

A learner that bootstraps comes to the fixed point of the operator that its code applies. On a finite task the fixed points of the
right operator and of wrong ones are computed exactly; the nearest one names the mistake, without a right version to compare with.

Symbols: P[a, s, s'] is the probability that the episode goes on in s', P_end[a, s, s'] that it ends there, R[a, s] the expected
reward, V(s) = max over a of Q(s, a) unless an operator says otherwise; for the critic of an actor, V(s) is the mean of Q(s, a)
under its policy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Node
from taskspec.lang.types import REAL
from taskspec.model.extract import extract
from taskspec.model.model import Model, misused, refuse
from taskspec.modifiers.core import paying
from taskspec.policies.adapters import ProbabilisticPolicy
from taskspec.policies.policy import greedy, states_of
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike

RIGHT = 0.15
"""Values this near to the right ones, as a share of their spread, are right."""
NEAR = 0.25
CLEARER = 0.5
MUCH_CLEARER = 0.2
"""A wrong operator is named if the values are within `NEAR` of its fixed point, and their distance is at most `CLEARER` of that
to the right values; or if it is at most `MUCH_CLEARER` of that."""
SAME = 0.03
"""Operators whose distances differ by less than this cannot be told apart."""
SWEEPS = 5000
"""Applications of an operator, at most."""
SLOWEST = 500
"""Applications in which the change of the values has to be halved."""
PRECISION = 1e-6
"""Change of the values, as a share of the largest reward, at which they are taken for the fixed point."""
EXPLORATION = 0.1
"""The share of random actions that is assumed where an operator depends on how the learner behaves."""
EXPLORATIONS = (0.05, 0.1, 0.2, 0.3)
"""The shares that are tried for learners that value their own behaviour."""
DENSE = 200_000
"""Entries of a matrix that is not sparse, at most."""
LARGEST = 20_000
"""State-action pairs of a task, at most."""

Reduce = Callable[[Array], Array]
"""From Q, (A, S), to V, (S,)."""


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Dynamics of a finite task that does not depend on the time, with the learner's discount.

    Attributes:
        model: the exact model.
        gamma: the learner's discount.
        P, P_end: (A * S, S), dense where that is small, else sparse.
        R, clipped, signs: float64 (A, S), expected rewards; after each was clipped to [-1, 1], or replaced by its sign.
        shares: what `last_share` has found.
    """

    model: Model
    gamma: float
    P: Any
    P_end: Any
    R: Array
    clipped: Array
    signs: Array
    shares: dict[bytes, Array] = field(default_factory=dict)

    def following(self, V: Array) -> Array:
        """Return the expected value (A, S) of the next state, 0 where the episode ends."""
        expected: Array = (self.P @ V).reshape(self.R.shape)
        return expected

    def ending(self, V: Array) -> Array:
        """Return the same of the states in which the episode ends, 0 where it goes on."""
        if self.P_end is None:
            return np.zeros_like(self.R)
        expected: Array = (self.P_end @ V).reshape(self.R.shape)
        return expected

    def visits(self, policy: Array) -> Array:
        """Return float64 (H, S): how often a policy (A, S) acts in each state at each time; without a horizon, one row."""
        rows = []
        now = self.model.start.copy()
        steps = SWEEPS if self.model.horizon is None else self.model.horizon
        for _ in range(steps):
            rows.append(now)
            now = self.P.T @ (policy * now).reshape(-1)
            if now.sum() < 1e-9:
                break
        counts = np.array(rows)
        return counts.sum(axis=0, keepdims=True) if self.model.horizon is None else counts

    def last_share(self, policy: Array) -> Array:
        """Return float64 (S,): of the visits to a state, the share in the last step before the limit."""
        key = policy.tobytes()
        if key not in self.shares:
            self.shares[key] = self._last_share(policy)
        return self.shares[key]

    def _last_share(self, policy: Array) -> Array:
        horizon = self.model.horizon
        counts = self.visits(policy)
        if horizon is None or len(counts) < horizon:
            return np.zeros(self.model.n_states)
        total = counts.sum(axis=0)
        share: Array = np.divide(counts[-1], total, out=np.zeros_like(total), where=total > 0)
        return share


# -- operators --------------------------------------------------------------------------------------------------------

Backup = Callable[[Dynamics, Array, Array], Array]
"""From dynamics, Q (A, S) and V (S,) to the next Q (A, S)."""


@dataclass(frozen=True)
class BellmanOperator:
    """A Bellman operator, and the mistake that makes a learner apply it.

    Attributes:
        backup: from Q and V to the next Q.
        mistake: a sentence that follows "your values are those of a learner".
        code: what such code usually looks like.
        fix: what to do.
        reduce: the reduction of Q to V, where it is part of the mistake.
        on_policy: whether V is the expectation of Q under what the learner does.
    """

    name: str
    backup: Backup
    mistake: str
    code: str
    fix: str
    reduce: Callable[[Dynamics, Array], Array] | None = None
    on_policy: bool = False


def _right(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.gamma * s.following(V)


def _ends_ignored(s: Dynamics, Q: Array, V: Array) -> Array:
    known = np.where(
        s.model.acting, V, 0.0
    )  # a state in which no episode acts keeps the value that it was created with
    return s.R + s.gamma * (s.following(V) + s.ending(known))


def _next_episode(s: Dynamics, Q: Array, V: Array) -> Array:
    first = float(s.model.start @ V)
    last = s.last_share(_behaviour(Q))
    ones = np.ones_like(V)
    goes_on = (1 - last) * s.following(V)
    starts_again = s.ending(ones) + last * s.following(ones)
    found: Array = s.R + s.gamma * (goes_on + first * starts_again)
    return found


def _limit_is_end(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.gamma * (1 - s.last_share(_behaviour(Q))) * s.following(V)


def _same_state(s: Dynamics, Q: Array, V: Array) -> Array:
    goes_on = s.following(np.ones_like(V))
    found: Array = s.R + s.gamma * goes_on * V
    return found


def _reward_discounted(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.gamma * (s.R + s.following(V))


def _discounted_twice(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.gamma**2 * s.following(V)


def _undiscounted(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.following(V)


def _immediate(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R


def _clipped(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.clipped + s.gamma * s.following(V)


def _signs(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.signs + s.gamma * s.following(V)


def _negated(s: Dynamics, Q: Array, V: Array) -> Array:
    return -s.R + s.gamma * s.following(V)


def _action_before(s: Dynamics, Q: Array, V: Array) -> Array:
    n = s.model.n_states
    following = np.stack([s.P[a * n : (a + 1) * n] @ Q[a] for a in range(s.model.n_actions)])
    return s.R + s.gamma * following


def _behaviour(Q: Array, exploration: float = EXPLORATION) -> Array:
    """Return probabilities (A, S): greedy for Q, with a share of random actions."""
    return (1 - exploration) * greedy(Q.T).T + exploration / len(Q)


def _mean(s: Dynamics, Q: Array) -> Array:
    found: Array = Q.mean(axis=0)
    return found


def _least(s: Dynamics, Q: Array) -> Array:
    found: Array = Q.min(axis=0)
    return found


def _all_states(s: Dynamics, Q: Array) -> Array:
    return np.full(Q.shape[1], Q[:, s.model.acting].max())


OPERATORS = {
    operator.name: operator
    for operator in (
        BellmanOperator("right", _right, "without a mistake in its targets", "r + gamma * (1 - terminated) * V(s')", ""),
        BellmanOperator(
            "on policy", _right, "that learns the values of what it does, exploration included (SARSA)",
            "target = r + gamma * Q(s', a')", "Nothing, if that is meant; else take the maximum over actions.",
            on_policy=True,
        ),
        BellmanOperator(
            "ends ignored", _ends_ignored, "that bootstraps past the end of an episode",
            "target = r + gamma * V(s')", "Multiply V(s') by (1 - terminated).",
        ),
        BellmanOperator(
            "next episode", _next_episode, "for which an episode continues with the first state of the next one",
            "next_obs taken after the environment was reset",
            "Take the last observation of the episode (final_obs), and mask its value where it is terminal.",
        ),
        BellmanOperator(
            "limit is an end", _limit_is_end, "for which the time limit ends the world",
            "done = terminated or truncated", "Mask V(s') by terminated alone; truncated episodes keep their value.",
        ),
        BellmanOperator(
            "same state", _same_state, "that takes the state it left for the one it reached",
            "next_obs = obs, or a buffer that shares memory", "Store the observation that step() returned, as a copy.",
        ),
        BellmanOperator(
            "mean of actions", _right, "that averages over the next actions instead of choosing the best",
            "q(s').mean(axis=-1)", "Take the maximum over actions.", _mean,
        ),
        BellmanOperator(
            "least action", _right, "that expects the worst of the next actions",
            "q(s').min(axis=-1), or a minimum over the wrong axis", "Take the maximum over actions.", _least,
        ),
        BellmanOperator(
            "all states", _right, "that takes the best value of any state for the next one",
            "q.max() without an axis", "Take the maximum over the axis of actions.", _all_states,
        ),
        BellmanOperator(
            "action before", _action_before, "that looks up the next state with the action that was just taken",
            "q[s', a]", "Update the action before the look-up, or take the maximum.",
        ),
        BellmanOperator(
            "reward discounted", _reward_discounted, "that discounts the reward, too",
            "gamma * (r + V(s'))", "Move the parenthesis: r + gamma * V(s').",
        ),
        BellmanOperator(
            "discounted twice", _discounted_twice, "that discounts twice a step",
            "gamma in the buffer and in the target", "Apply gamma once.",
        ),
        BellmanOperator(
            "undiscounted", _undiscounted, "that does not discount", "target = r + V(s')",
            "Multiply V(s') by gamma.",
        ),
        BellmanOperator(
            "immediate reward", _immediate, "that sees no further than the next reward",
            "target = r, or gamma = 0", "Add gamma * V(s'), and check that its mask is not inverted; or train longer.",
        ),
        BellmanOperator(
            "rewards clipped", _clipped, "whose rewards are clipped to [-1, 1]",
            "a wrapper or option for Atari was left on", "Remove it.",
        ),
        BellmanOperator(
            "signs of rewards", _signs, "that sees the signs of rewards alone",
            "np.sign(r), as wrappers for Atari do", "Remove it.",
        ),
        BellmanOperator(
            "reward negated", _negated, "that takes rewards for costs", "target = -r + ...", "Remove the minus sign.",
        ),
    )
}  # fmt: skip
"""Operators by name: the right one first, then those of mistakes."""
GOOD = ("right", "on policy")
"""Operators that are no mistake."""


# -- fixed points -----------------------------------------------------------------------------------------------------


@lru_cache(maxsize=32)
def _dynamics(task: Task, gamma: float) -> Dynamics:
    model = extract(task)
    if model.is_timed:
        refuse(f"{task.id} depends on the time, which values of states leave out", "add the time to the state")
    if model.n_states * model.n_actions > LARGEST:
        refuse(f"{task.id} has more than {LARGEST:,} pairs of states and actions")
    clipped = extract(_paid(task, lambda b, r: b.apply("min2", b.apply("max2", r, b.scalar(-1)), b.scalar(1))))
    signs = extract(_paid(task, lambda b, r: b.apply("sign", r)))
    shape = (model.n_actions, model.n_states)
    R = model.step(0).R.reshape(shape)
    clipped_rewards = clipped.step(0).R.reshape(shape)
    sign_rewards = signs.step(0).R.reshape(shape)
    P = model.step(0).P
    P_end = model.step(0).P_end
    if P.shape[0] * P.shape[1] <= DENSE:
        P = P.toarray()
        if P_end is not None:
            P_end = P_end.toarray()
    return Dynamics(model, gamma, P, P_end, R, clipped_rewards, sign_rewards)


def _paid(task: Task, change: Callable[[Builder, Node], Node]) -> Task:
    """Return the task with another reward."""
    b = task.new_builder()
    return paying(b, task, b.cast(change(b, task.process.reward), REAL.kind))


def fixed_point(dynamics: Dynamics, operator: BellmanOperator, reduce: Reduce) -> Array | None:
    """Return Q, float64 (A, S), that an operator does not change; None if it grows without a bound, or does not settle.

    Args:
        reduce: Q to V, for operators without a reduction of their own.
    """
    Q = np.zeros_like(dynamics.R)
    size = max(1e-9, float(np.abs(dynamics.R).max()))
    before = np.inf
    for sweep in range(SWEEPS):
        V = reduce(Q) if operator.reduce is None else operator.reduce(dynamics, Q)
        following = operator.backup(dynamics, Q, V)
        change = float(np.abs(following - Q).max())
        Q = following
        if change <= PRECISION * size:
            return Q
        if sweep % SLOWEST == SLOWEST - 1:
            if not change < before / 2:
                return None
            before = change
    return None


def named(distances: Mapping[str, float], good: Sequence[str] = GOOD) -> list[str]:
    """Return the operators that explain distances: those that are no mistake within their tolerance, else the nearest.

    Args:
        distances: by operator, the right one included.
        good: operators that are no mistake, the right one first.
    """
    for name in good:
        if distances.get(name, np.inf) <= RIGHT:
            return [name]
    nearest = min(distances.values())
    right = distances[good[0]]
    if nearest > CLEARER * right or nearest > max(NEAR, MUCH_CLEARER * right):
        return []
    return [name for name, distance in distances.items() if distance <= nearest + SAME]


def pooled(distances: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the mean distance over tasks and seeds of each operator that all of them have."""
    means = {}
    for name in distances[0]:
        found = [each[name] for each in distances if name in each]
        if len(found) == len(distances):
            means[name] = float(np.mean(found))
    return means


def fingerprint(
    task: TaskLike, *, q: Any = None, values: Any = None, policy: Any = None, discount: float | None = None
) -> dict[str, float]:
    """Return the distances of learned values from the fixed points of operators, as shares of the spread of the right values.

    Operators without a fixed point are left out; one whose fixed point is that of the right one on this task has its distance.

    Args:
        task: a finite task that does not depend on the time, and whose observations tell its states apart.
        q: the learned Q-values: a table, float (O, A), of the numbers of discrete observations; or a function from observations
            (N, *shape) to (N, A).
        values: instead, the state values of a critic: a table (O,), or a function from observations to (N,).
        policy: with `values`, the probabilities of actions of the policy that they value, in the same form as `q`.
        discount: the learner's gamma; by default that of the task.

    Raises:
        SpecError: E712 where the task has no such fixed points, E713 where the values have the wrong shape.
    """
    if (q is None) == (values is None):
        misused("give either `q` or `values`")
    if values is not None and policy is None:
        misused("values are those of a policy", "give its probabilities of actions as `policy`")
    task = load(task)
    dynamics = _dynamics(task, task.discount if discount is None else float(discount))
    model = dynamics.model
    rows = _Observed(task, model)
    reduce: Reduce = _best
    pi = np.full((model.n_actions, model.n_states), 1 / model.n_actions)
    if policy is not None:
        pi = rows.read(policy, model.n_actions).T
        reduce = _Expected(pi)
    visits = dynamics.visits(pi).sum(axis=0)
    weights = visits / visits.sum()
    learned = rows.read(q, model.n_actions).T if values is None else rows.read(values, None)
    if not np.isfinite(learned[..., weights > 0]).all():
        misused("the learned values are not finite numbers")
    points = _fixed_points(dynamics, reduce) if policy is not None else _greedy_points(task, dynamics.gamma)
    if not points:
        refuse(f"values of {task.id} have no bound at discount {dynamics.gamma:g}", "give the learner's `discount`")
    (right_q,) = points["right"]
    right = right_q if values is None else reduce(right_q)
    scale = _spread(right_q, weights)
    distances = {}
    for name, found in points.items():
        each = found if values is None else [reduce(Q) for Q in found]
        nearest = min(each, key=lambda point: _distance(learned, point, weights))
        shows_mistake = name == "right" or _distance(nearest, right, weights) / scale >= RIGHT
        distances[name] = _distance(learned, nearest if shows_mistake else right, weights) / scale
    return distances


@lru_cache(maxsize=32)
def _greedy_points(task: Task, gamma: float) -> dict[str, list[Array]]:
    return _fixed_points(_dynamics(task, gamma), _best)


def _fixed_points(dynamics: Dynamics, reduce: Reduce) -> dict[str, list[Array]]:
    """Return the fixed points of each operator that has some: one, or one for each share of random actions.

    Without right values, there are none.
    """
    points = {}
    for name, operator in OPERATORS.items():
        reductions = [reduce]
        if operator.on_policy:
            reductions = [_OfBehaviour(exploration) for exploration in EXPLORATIONS]
        found = [fixed_point(dynamics, operator, each) for each in reductions]
        known = [Q for Q in found if Q is not None]
        if known:
            points[name] = known
        elif name == "right":
            break
    return points


@dataclass(frozen=True, eq=False)
class _OfBehaviour:
    """Q to V under the policy that is greedy for Q, with a share of random actions."""

    exploration: float

    def __call__(self, Q: Array) -> Array:
        expected: Array = (_behaviour(Q, self.exploration) * Q).sum(axis=0)
        return expected


@dataclass(frozen=True, eq=False)
class _Expected:
    """Q to V under a policy (A, S)."""

    pi: Array

    def __call__(self, Q: Array) -> Array:
        expected: Array = (self.pi * Q).sum(axis=0)
        return expected


def _best(Q: Array) -> Array:
    best: Array = Q.max(axis=0)
    return best


class _Observed:
    """Observations of the states of a model."""

    def __init__(self, task: Task, model: Model) -> None:
        reader = ProbabilisticPolicy(task, np.asarray, 0)
        if reader.is_noisy or reader.sees_time:
            refuse(f"observations of {task.id} are not functions of the state")
        self.layout = task.observation_layout
        self.rows = reader.observe(states_of(model), 0, np.random.default_rng(0))
        parts = self.rows.values() if isinstance(self.rows, dict) else [self.rows]
        flat = np.hstack([np.asarray(part, np.float64).reshape(model.n_states, -1) for part in parts])
        acted = flat[model.acting]
        if len(np.unique(acted, axis=0)) < len(acted):
            refuse(f"two states of {task.id} look alike, so that they share their learned values")
        self.acting = model.acting

    def read(self, learned: Any, columns: int | None) -> Array:
        """Return learned numbers of every state, float64 (S, columns) or (S,).

        Raises:
            SpecError: E713 for another shape.
        """
        if callable(learned):
            found = np.asarray(learned(self.rows), np.float64)
        else:
            found = self._looked_up(np.asarray(learned, np.float64))
        shape = (len(self.acting),) if columns is None else (len(self.acting), columns)
        if columns is None:
            found = found.reshape(-1)
        if found.shape != shape:
            misused(f"learned values have shape {shape} for {shape[0]} observations here, not {found.shape}")
        return found

    def _looked_up(self, table: Array) -> Array:
        if self.layout.form != "discrete":
            misused("a table needs discrete observations", "give a function of observations")
        numbers = np.asarray(self.rows) - self.layout.starts[0]
        if len(table) != self.layout.counts[0]:
            misused(f"a table has {self.layout.counts[0]} rows here, one for each observation, not {len(table)}")
        looked: Array = table[numbers]
        return looked


def _distance(one: Array, other: Array, weights: Array) -> float:
    """Return the root of the mean squared difference of Q (A, S) or V (S,), states weighted by visits."""
    squared = (one - other) ** 2
    if squared.ndim == 2:
        squared = squared.mean(axis=0)
    known = weights > 0
    return float(np.sqrt(squared[known] @ weights[known]))


def _spread(right: Array, weights: Array) -> float:
    """Return the standard deviation of the right Q (A, S) over visited states and actions; their size if they are all equal."""
    known = weights > 0
    each = right[:, known]
    share = weights[known] / len(each)
    mean = float((each * share).sum())
    deviation = float(np.sqrt((share * (each - mean) ** 2).sum()))
    size = float(np.abs(each).max())
    if deviation > 1e-3 * size:
        return deviation
    return size or 1.0
