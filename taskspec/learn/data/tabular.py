"""The exact model of a task as the arrays that tabular learners take."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from taskspec.base.arrays import Array, parts_of
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.extras import need
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.model.extract import extract, lasting
from taskspec.exact.model.model import Model, Sparse, Step, misused, refuse
from taskspec.exact.policies.policy import named
from taskspec.exact.policies.state_observations import StateObservations
from taskspec.language.expressions.types import Role
from taskspec.language.modifiers import modify
from taskspec.language.registry import load
from taskspec.language.task.questions import components_read, is_random
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.data.episodes import EXTRA, Seen

LARGEST = 2**27  # numbers that a dense array of transitions may have: a gigabyte


class LookAlike(SpecError):
    """Two states have the same observation (E713)."""


@dataclass(frozen=True, eq=False)
class Tabular:
    """A finite task as arrays, over S states and A actions.

    Attributes:
        task: the task, or its abstraction, with ends that absorb.
        model: its exact model, which states and actions are numbered as in: `model.state(i)`, `model.state_name(i)`.
        p0: float64 (S,), the probabilities of the states at the beginning.
        R: float64 (S, A), the expected reward of an action in a state.
        going: sparse (A * S, S): row a * S + s has the probabilities of the next states, where action a is taken in state s.
        absorbed: bool (S,), the states in which an episode has ended: they lead to themselves.
        horizon: the steps of an episode, or None; where a terminal state is one that is late enough, so many.
        discount: of rewards, for each step.
    """

    task: Task
    model: Model
    p0: Array
    R: Array
    going: Sparse
    absorbed: Array
    horizon: int | None
    discount: float

    @property
    def n_states(self) -> int:
        return len(self.p0)

    @property
    def n_actions(self) -> int:
        return int(self.R.shape[1])

    @cached_property
    def legal(self) -> Array:
        """bool (S, A): whether an action may be taken in a state; what illegal ones do, the equations say."""
        if self.model.legal is None:
            return np.ones(self.R.shape, np.bool_)
        return np.ascontiguousarray(self.model.legal.T)

    @cached_property
    def sparse(self) -> tuple[Sparse, ...]:
        """For each action the probabilities of the next states, A sparse matrices (S, S) (`scipy.sparse.csr_array`)."""
        parts = (self.going[a * self.n_states : (a + 1) * self.n_states] for a in range(self.n_actions))
        matrices = tuple(sparse.csr_array(part) for part in parts)
        for part in matrices:
            part.sum_duplicates()
        return matrices

    @cached_property
    def P(self) -> Array:  # the letter that everyone uses
        """float64 (S, A, S): the probability of the third, where the action is taken in the first.

        Raises:
            SpecError: E712, where it would not fit in memory; `sparse` does.
        """
        if self.n_states**2 * self.n_actions > LARGEST:
            refuse(f"dense transitions of {self.n_states:,} states would take gigabytes", "`tabular().sparse`")
        return np.stack([part.toarray() for part in self.sparse], axis=1)

    @cached_property
    def observations(self) -> Seen:
        """The observation of each state, (S, *shape), as the environment gives it.

        Raises:
            SpecError: E712, where what is seen is drawn at every step, or depends on the time.
        """
        seen = StateObservations(self.model)
        if seen.is_timed or not seen.is_known:
            refuse(f"the observation in {self.task.id} is not a function of the state", "take the states instead")
        return seen.at(0)

    @cached_property
    def features(self) -> Array:
        """float32 (S, D): the observations as flat vectors, discrete ones one-hot.

        Raises:
            SpecError: as for `observations`.
        """
        layout = self.task.observation_layout
        seen = self.observations
        parts = [part.reshape(self.n_states, -1) for part in parts_of(seen)]
        if layout.form in ("discrete", "multi_discrete"):
            lows = (
                layout.starts if layout.form == "discrete" else [0] * len(layout.counts)
            )  # as the environment shows them
            each = zip(parts[0].T, layout.counts, lows, strict=True)
            parts = [np.eye(count)[column - low] for column, count, low in each]
        return np.hstack(parts).astype(np.float32)

    def index(self, observations: Any) -> Array:
        """Look up states by observations of an episode that goes on.

        Args:
            observations: (N, *shape), as the environment gives them.

        Returns:
            indices of states, int64 (N,).

        Raises:
            SpecError: E713, where two states look alike (`LookAlike`), or an observation is none of the task's.
        """
        known: dict[bytes, int] = {}
        for i, row in enumerate(_rows(self.observations)):
            if not self.absorbed[i] and known.setdefault(row, i) != i:
                twin = self.model.state_name(known[row])
                name = self.model.state_name(i)
                message = f"{twin} and {name} look alike in {self.task.id}"
                raise LookAlike([Diagnostic("E713", None, message, "give `occupancy()` instead")])
        indices = list(map(known.get, _rows(observations)))
        if None in indices:
            misused(f"observation {indices.index(None)} is not one of {self.task.id}")
        return np.array(indices, np.int64)

    def occupancy(self, policy: str = "expert") -> Array:
        """Count how often a policy is expected to be in each state, the last one of an episode included.

        Discounted as the task says; without a discount it sums to horizon + 1, as imitation's MCE IRL has it.

        Args:
            policy: its name.

        Returns:
            expected visits, float64 (S,).

        Raises:
            SpecError: E712 for tasks without a horizon, E713 for a policy that the task does not have.
        """
        if self.horizon is None:
            refuse(f"episodes of {self.task.id} have no horizon", "give the task one")
        plan = named(self.task, policy).plan(self.model)
        going = self.going
        now = self.p0
        total = self.p0.copy()
        factor = 1.0
        for t in range(self.horizon):
            now = going.T @ (plan(t) * now).reshape(-1)
            factor = factor * self.discount
            total += factor * now
        return total

    def seals(self) -> Any:
        """Convert to seals.

        Returns:
            a `seals.base_envs.TabularModelMDP`, whose observations are the numbers of states.

        Raises:
            SpecError: E705 where seals is not installed.
        """
        base = need("seals.base_envs", "bench", "this")
        return base.TabularModelMDP(
            transition_matrix=self.P, reward_matrix=self.R, horizon=self.horizon, initial_state_dist=self.p0
        )

    def imitation(self) -> Any:
        """Convert to the environment that `imitation.algorithms.mce_irl.MCEIRL` takes.

        Returns:
            a `seals.base_envs.TabularModelPOMDP` that shows `features`.

        Raises:
            SpecError: E705 where seals, which comes with imitation, is not installed.
        """
        base = need("seals.base_envs", EXTRA, "this")
        return base.TabularModelPOMDP(
            transition_matrix=self.P, observation_matrix=self.features, reward_matrix=self.R, horizon=self.horizon,
            initial_state_dist=self.p0,
        )  # fmt: skip


def tabular(task: TaskLike) -> Tabular:
    """Write the exact model of a task as arrays; where episodes may end early, their ends are absorbing states.

    All states that are declared are there, where that is cheap and no end is terminal; else those that episodes enter. An action
    that would leave the state space, where no episode acts, leads nowhere else and pays nothing.

    Where the spec gives an `abstraction`, the model of the abstraction is tabulated.

    Args:
        task: the task, its id or its path.

    Returns:
        arrays of S states and A actions: probabilities and expected rewards, float64.

    Raises:
        SpecError: E712 where there is no exact model, or where what happens depends on the time.
    """
    task = load(task)
    mapped = abstraction(task)
    if mapped is not None:
        task = mapped.stand_in
    terminal = [task.process.terminal]
    ends = is_random(terminal) or bool(components_read(terminal) or components_read(terminal, Role.ACTION))
    if ends:
        task = modify(task, "absorbing")
        model = extract(task, reachable=True)
    else:
        model = lasting(extract(task))
    horizon = model.horizon
    for t, step in enumerate(model.steps, 1):
        if not step.P.sum():  # the time alone ends episodes
            horizon = t
            break
    first, *others = {id(step): step for step in model.steps[:horizon]}.values()
    for step in others:
        if (step.R != first.R).any() or (_whole(step) != _whole(first)).nnz:
            refuse(f"{task.id} depends on the time", "add a state component that counts the steps")
    going, rewards = _inside(model)
    absorbed = np.zeros(model.n_states, np.bool_)
    if ends:
        absorbed = np.broadcast_to(model.reads()[task.state[-1].read], absorbed.shape)
    return Tabular(task, model, model.start, rewards, going, absorbed, horizon, task.discount)


def _whole(step: Step) -> Sparse:
    if step.P_end is None:
        return step.P
    return step.P + step.P_end


def _inside(model: Model) -> tuple[Sparse, Array]:
    step = model.step(0)
    shape = (model.n_actions, model.n_states)
    going = _whole(step)
    rewards = step.R
    if step.escaping is not None and step.escaping.any():
        rows = np.flatnonzero(step.escaping)
        stays = sparse.csr_array((np.ones(len(rows)), (rows, rows % model.n_states)), shape=going.shape)
        going = sparse.csr_array(sparse.diags_array((~step.escaping).astype(np.float64)) @ going + stays)
        rewards = np.where(step.escaping, 0.0, rewards)
    return going, np.ascontiguousarray(rewards.reshape(shape).T)


def _rows(observations: Any) -> list[bytes]:
    held = [np.asarray(part, np.float64) for part in parts_of(observations)]
    keys = []
    for row in zip(*held, strict=True):
        keys.append(b"".join(number.tobytes() for number in row))
    return keys
