"""Learned values, read at the states of a task, and their errors.

The symbols of this file are in `taskspec.learn.exam.dynamics`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.policies.networks import outputs_of
from taskspec.exact.policies.state_observations import StateObservations
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.exam.dynamics import EXPLORATIONS, Behaviour, Dynamics, EpsilonGreedy, dynamics_of
from taskspec.learn.exam.results import finite
from taskspec.learn.exam.ways import greedy_ways, right_values

CERTAIN = 1e-9
MOVED = 0.25
"""The size of values that have moved, as a share of the spread of right ones."""
SMALL = 0.1
"""Errors of learned values that are too small for any diagnosis."""
OFTEN = 100
"""Steps after which the value of an action should have been learned."""


@dataclass(frozen=True)
class StepErrors:
    """Errors of learned values, as shares of the spread of all right values.

    Attributes:
        at_ends: root mean square of steps that end the episode for certain: what was learned from the rewards.
        before_ends: the same of steps that go on for certain: from rewards and what was learned of what follows.
        worst: the step with the largest error, in words: one that ends the episode, unless those are right.
    """

    at_ends: float | None = None
    before_ends: float | None = None
    worst: str | None = None


class LearnedValues:
    """Learned values of a finite task that does not depend on the time, and whose observations tell its states apart.

    Args:
        q, values, policy, discount: as `taskspec.learn.exam.fingerprints.fingerprint` takes them.

    Attributes:
        kind: whether these are Q-values, or the values of a critic.
        learned: float64 (A, S) or (S,).
        pi: the policy (A, S) that a critic values; uniform for Q-values.

    Raises:
        SpecError: E712 where the task has no such values, E713 where they have the wrong shape.
    """

    def __init__(
        self, task: TaskLike, q: Any = None, values: Any = None, policy: Any = None, discount: float | None = None
    ) -> None:
        if (q is None) == (values is None):
            misused("give either `q` or `values`")
        if values is not None and policy is None:
            misused("values are those of a policy", "give its probabilities of actions as `policy`")
        self.task = load(task)
        dynamics = dynamics_of(self.task, self.task.discount if discount is None else float(discount))
        self._observed = _Observed(self.task, dynamics.model)
        actions = dynamics.model.n_actions
        self.kind: Literal["q", "values"] = "q"
        if values is None:
            self.learned = self._observed.read(q, actions).T
            self.pi = np.full_like(dynamics.R, 1 / actions)
            self.dynamics = replace(dynamics, initial=_initial(self.learned, dynamics))
        else:
            self.kind = "values"
            self.learned = self._observed.read(values, None)
            self.pi = self._observed.read(policy, actions).T
            self.dynamics = dynamics

    @cached_property
    def behaviour(self) -> Behaviour:
        return Behaviour(self.dynamics, self.pi)

    @property
    def weights(self) -> Array:
        """The share (S,) of visits to each state."""
        return self.behaviour.total / self.behaviour.total.sum()

    @property
    def of_first_states(self) -> float | None:
        """The value of the first states, in the mean over starts; None where it is not a finite number."""
        V = self.learned
        if self.kind == "q":
            V = self.learned.max(axis=0)
        start = self.dynamics.model.start
        value = float(start[start > 0] @ V[start > 0])
        if np.isfinite(value):
            return value
        return None

    @property
    def explained(self) -> float | None:
        """The share that a critic explains of the values of its policy: 1 less the size of its errors, as a share of the values.

        1 for right values, 0 or less for those that say nothing; None without a critic, or where all values are 0.
        """
        if self.kind == "q":
            return None
        right = right_values(self.dynamics, self.pi)
        size = float(self.weights @ right**2)
        error = float(self.weights @ (self.learned - right) ** 2)
        if size == 0 or not np.isfinite(error):
            return None
        return 1 - float(np.sqrt(error / size))

    def moved(self, counts: Array) -> float | None:
        """Return how far values have moved from their first ones: root mean square, as a share of the spread of right values.

        None where no step was taken often.

        Args:
            counts: float64 (O, A), how often each action was taken.
        """
        change = (self.learned - self.dynamics.initial) / self.spread
        return finite(_size(change, self._taken_often(counts)))

    def step_errors(self, counts: Array) -> StepErrors:
        """Return how far values are from their targets, of steps that were taken often.

        Args:
            counts: as of `moved`.

        Returns:
            All None where no such step was taken often, or values have hardly moved.
        """
        s = self.dynamics
        going_on = s.going_on
        paid = s.R
        if self.kind == "values":
            going_on = self.behaviour.expected(going_on)
            paid = self.behaviour.expected(paid)
        is_known = self._taken_often(counts)
        if not np.isfinite(self.learned).all() or (self.moved(counts) or 0.0) < MOVED:
            return StepErrors()
        errors = [self.learned - paid - s.gamma * following for following in self._following()]
        error = min(errors, key=lambda each: _size(each, is_known))
        is_end = is_known & (going_on < CERTAIN)
        goes_on = is_known & (going_on > 1 - CERTAIN)
        at_ends = finite(_size(error, is_end) / self.spread)
        before_ends = finite(_size(error, goes_on) / self.spread)
        origin = "the reward alone, since the episode ends"
        where = is_end
        if (at_ends or 0.0) < SMALL:
            origin = "the reward, and the learned value of what follows"
            where = goes_on
        if not where.any():
            return StepErrors(at_ends, before_ends)
        step = np.unravel_index(np.argmax(np.abs(error) * where), error.shape)
        learned = float(self.learned[step])
        return StepErrors(
            at_ends,
            before_ends,
            f"{self._step_name(step)} is {learned:.2f}, its target {learned - error[step]:.2f}: {origin}",
        )

    def _step_name(self, step: Sequence[Any]) -> str:
        """Return what has a value: a state of a critic, or an action in a state."""
        *actions, state = map(int, step)
        name = self.dynamics.model.state_name(state)
        for action in actions:
            name = f"{self.dynamics.model.action_name(action)} in {name}"
        return f"the value of {name}"

    @property
    def spread(self) -> float:
        """The range of the right values of best actions."""
        right = greedy_ways(self.task, self.dynamics.gamma, self.dynamics.initial)["right"][0].fixed_point
        known = right[:, self.dynamics.acted]
        return float(np.ptp(known)) or float(np.abs(known).max()) or 1.0

    def _taken_often(self, counts: Array) -> Array:
        taken = self._observed.read(counts, self.dynamics.model.n_actions).T
        if self.kind == "values":
            taken = taken.sum(axis=0)
        return self.dynamics.acted & (taken >= OFTEN)

    def _following(self) -> list[Array]:
        """Return the value of what follows, (S,) for a critic, or (A, S) for several shares of random actions."""
        s = self.dynamics
        if self.kind == "values":
            return [self.behaviour.expected(s.following(self.learned))]
        policies = [EpsilonGreedy(share)(self.learned) for share in (0.0, *EXPLORATIONS)]
        return [s.following((pi * self.learned).sum(axis=0)) for pi in policies]


def _size(errors: Array, where: Array) -> float:
    if not where.any():
        return np.nan
    with np.errstate(over="ignore"):
        return float(np.sqrt((errors[where] ** 2).mean()))


def is_read(task: Task) -> bool:
    """Return whether learned values of a task can be compared: it is finite, shows its state, and does not depend on the time."""
    try:
        _Observed(task, dynamics_of(task, task.discount).model)
    except SpecError:
        return False
    return True


def _initial(learned: Array, dynamics: Dynamics) -> float:
    """Return the value before anything was learned: that of states in which no episode acts, if it is one and the same."""
    kept = learned[:, ~dynamics.acted]
    if kept.size and np.isfinite(kept).all() and np.ptp(kept) == 0:
        return float(kept.flat[0])
    return 0.0


class _Observed:
    """Observations of the states of a model."""

    def __init__(self, task: Task, model: Model) -> None:
        shown = StateObservations(model)
        if not shown.is_known or shown.is_timed:
            refuse(f"observations of {task.id} are not functions of the state")
        self.layout = task.observation_layout
        self.rows = shown.at(0)
        flat = shown.matrix(0)
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
            found = np.asarray(outputs_of(learned)(self.rows), np.float64)
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
