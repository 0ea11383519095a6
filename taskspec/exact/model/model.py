"""The exact model of a finite task: sparse transition matrices, rewards, start; or why there is none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from scipy import sparse

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact.model.space import Space, distinct, entries_of, shown, union
from taskspec.language.expressions.types import TIME, Role
from taskspec.language.task.legal import choices
from taskspec.language.task.task import Task


class NoModel(SpecError):
    """A task has no exact model, or none that answers what is asked (E712)."""


def refuse(message: str, hint: str | None = None) -> NoReturn:
    """Raise `NoModel`."""
    raise NoModel([Diagnostic("E712", None, message, hint)])


class TooLarge(NoModel):
    """A limit forbids the exact model that a finite task has (E712)."""


def too_large(message: str, hint: str | None = None) -> NoReturn:
    """Raise `TooLarge`."""
    raise TooLarge([Diagnostic("E712", None, message, hint)])


def misused(message: str, hint: str | None = None) -> NoReturn:
    """Raise: a function was not called as it can be (E713)."""
    raise SpecError([Diagnostic("E713", None, message, hint)])


# Shapes: S states, A actions, T steps. Rows of matrices are action-major: row a*S + s is action a in
# state s, so that a maximum over actions runs over the contiguous leading axis of an (A, S) array.

Sparse = Any  # scipy.sparse.csr_array
NEVER = 2**62
"""A time that no episode comes to."""


@dataclass(frozen=True)
class RoundingTerms:
    """The quantities of a step on which bounds of rounding errors depend.

    `terms` is the largest number of outcomes of a row; the rewards of all outcomes are from `lowest` to `highest`.
    """

    terms: int = 1
    lowest: float = 0.0
    highest: float = 0.0

    @property
    def size(self) -> float:
        """The largest size of a reward."""
        return max(self.highest, -self.lowest)


@dataclass(frozen=True)
class Step:
    """The transitions and rewards of a step at some time.

    `P` (A*S, S) is the probability that the episode goes on in s', `P_end` (A*S, S) that it terminates there (None: no
    step terminates); rows of both together sum to 1. `R` (A*S,) is the expected reward. Entries of a row may repeat a column.
    `escaping` (A*S,) marks rows that leave the state space, which only states that no episode acts in may have.
    """

    P: Sparse
    P_end: Sparse | None
    R: Array
    rounding: RoundingTerms = RoundingTerms()
    escaping: Array | None = None

    @property
    def matrices(self) -> list[Sparse]:
        """`P`, and `P_end` where there is one."""
        if self.P_end is None:
            return [self.P]
        return [self.P, self.P_end]

    def with_reward(self, R: Array, lowest: float, highest: float) -> Step:
        """Return the step with another expected reward (A*S,), and bounds of that of all outcomes."""
        return replace(self, R=R, rounding=RoundingTerms(self.rounding.terms, lowest, highest))

    def same(self, other: Step) -> bool:
        """Return whether two times have equal steps, so that one can be used for both."""
        if len(self.matrices) != len(other.matrices) or not np.array_equal(self.R, other.R):
            return False
        for a, b in zip(self.matrices, other.matrices, strict=True):
            if not all(np.array_equal(getattr(a, part), getattr(b, part)) for part in ("indptr", "indices", "data")):
                return False
        return True


@dataclass(frozen=True, eq=False)
class Model:
    """A finite task as arrays.

    `codes` (S,) are the states' codes in `states`, sorted; `start` (S,) their probabilities at the
    beginning. `steps` has one entry if the time does not matter, else one for each time. `given_legal` (A, S) are the legal
    actions of a model without a spec.
    """

    task: Task
    states: Space
    actions: Space
    codes: Array
    start: Array
    steps: tuple[Step, ...]
    given_legal: Array | None = None

    @property
    def n_states(self) -> int:
        return len(self.codes)

    @property
    def n_actions(self) -> int:
        return self.actions.size

    @property
    def horizon(self) -> int | None:
        return self.task.horizon

    @property
    def discount(self) -> float:
        return self.task.discount

    @property
    def is_timed(self) -> bool:
        """True where dynamics or rewards depend on the time."""
        return len(self.steps) > 1

    def step(self, t: int) -> Step:
        """Look up the transitions at a time.

        Args:
            t: the time; of no matter where `is_timed` is False.

        Returns:
            P and P_end, sparse (A * S, S), and the expected reward R, float64 (A * S,).
        """
        return self.steps[t if self.is_timed else 0]

    @property
    def entries(self) -> int:
        """Non-zeros of all matrices."""
        distinct = {id(step): step for step in self.steps}.values()
        return sum(matrix.nnz for step in distinct for matrix in step.matrices)

    def with_reward(self, R: Array, lowest: float, highest: float) -> Model:
        """Replace the reward of a model whose time does not matter.

        Args:
            R: expected rewards, float64 (A * S,).
            lowest, highest: bounds of the rewards of all outcomes.

        Returns:
            the model with that reward.
        """
        return replace(self, steps=(self.step(0).with_reward(R, lowest, highest),))

    @cached_property
    def legal(self) -> Array | None:
        """The actions (A, S) that policies choose from in each state; None where these are all."""
        if not self.task.mask:
            return self.given_legal
        return choices(self.task, {name: value for (_, name), value in self.states.decode(self.codes).items()})

    def among_legal(self, values: Array, other: Any) -> Array:
        """Replace the numbers of illegal actions.

        Args:
            values: a number for each action and state, (A, S, ...).
            other: the number of illegal ones.

        Returns:
            numbers of the same shape.
        """
        if self.legal is None:
            return values
        legal = self.legal.reshape(*self.legal.shape, *(1,) * (values.ndim - 2))
        return np.where(legal, values, other)

    @cached_property
    def uniform(self) -> Array:
        """The probability of each action (A, S) if all that are legal are as probable."""
        shape = (self.n_actions, self.n_states)
        if self.legal is None:
            return np.broadcast_to(1 / self.n_actions, shape)
        return np.asarray(self.legal / self.legal.sum(axis=0))

    def state(self, index: int) -> dict[str, Any]:
        """Look up a state.

        Args:
            index: from 0 to S - 1.

        Returns:
            values by component, labels for choices.
        """
        return self.states.values_of(int(self.codes[index]))

    def action(self, index: int) -> dict[str, Any]:
        """Look up an action.

        Args:
            index: from 0 to A - 1.

        Returns:
            values by component, labels for choices.
        """
        return self.actions.values_of(index)

    def state_name(self, index: int) -> str:
        """Describe a state.

        Args:
            index: from 0 to S - 1.

        Returns:
            text such as `s = 2`.
        """
        return self.states.describe(int(self.codes[index]))

    def action_name(self, index: int) -> str:
        """Describe an action.

        Args:
            index: from 0 to A - 1.

        Returns:
            text such as `a = left`.
        """
        return self.actions.describe(index)

    def state_index(self, values: Mapping[str, Any]) -> int:
        """Look up the index of a state.

        Args:
            values: a value for each component, labels for choices.

        Returns:
            the index, from 0 to S - 1.

        Raises:
            KeyError: the state is not in the model.
        """
        arrays = []
        for c in self.states.components:
            value = np.asarray(values[c.name])
            if c.domain is not None:
                labels = c.domain.labels
                value = np.reshape([labels.index(str(label)) for label in value.flat], value.shape)
            arrays.append(value[..., None])
        (code,), outside = self.states.encode(arrays, 1)
        index = int(np.searchsorted(self.codes, code))
        if outside is not None or index == len(self.codes) or self.codes[index] != code:
            raise KeyError(f"the model has no state {dict(values)}")
        return index

    def state_indices(self, values: Mapping[str, Array], lanes: int) -> Array:
        """Look up the indices of states.

        Args:
            values: an array for each component, (*shape, N), with numbers for labels.
            lanes: N.

        Returns:
            the indices, int64 (N,).

        Raises:
            SpecError: E712 for a state that is not in the model, as no episode comes to it.
        """
        codes, outside = self.states.encode([values[c.name] for c in self.states.components], lanes)
        indices = np.minimum(np.searchsorted(self.codes, codes), self.n_states - 1)
        missing = self.codes[indices] != codes
        if outside is not None:
            missing |= outside
        if missing.any():
            at = int(np.flatnonzero(missing)[0])
            state = {c.name: values[c.name][..., min(at, values[c.name].shape[-1] - 1)] for c in self.states.components}
            words = ", ".join(f"{c.name} = {shown(c, state[c.name])}" for c in self.states.components)
            refuse(f"nothing is planned for {words}: no episode of {self.task.name} comes there")
        return np.asarray(indices)

    def levels(self) -> Iterator[tuple[int, Array]]:
        """Follow the states in which some episode acts, step by step.

        Yields:
            each time at which an action may be taken, with the states, bool (S,); without a horizon, until no state is new.
        """
        level = self.start > 0
        seen = np.zeros(self.n_states, np.bool_)
        t = 0
        while level.any() and (self.horizon is None or t < self.horizon):
            yield t, level
            if self.horizon is None and not (level & ~seen).any():
                return
            seen |= level
            level = self.successors(self.step(t).P, level)
            t += 1

    def successors(self, matrix: Sparse, states: Array) -> Array:
        """Mark the states that some action leads to.

        Args:
            matrix: probabilities, sparse (A * S, S).
            states: where actions are taken, bool (S,).

        Returns:
            bool (S,).
        """
        if 8 * np.count_nonzero(states) > len(states):
            rows = np.tile(states, self.n_actions).astype(np.float64)
            return np.asarray(matrix.T @ rows) > 0
        some = (np.flatnonzero(states) + self.n_states * np.arange(self.n_actions)[:, None]).reshape(-1)
        reached = np.zeros(self.n_states, np.bool_)
        reached[_columns(matrix, some)] = True
        return reached

    @cached_property
    def first_times(self) -> Array:
        """The first time (S,) at which some episode acts in each state, int64; `NEVER` where none does."""
        return self._first_times(self.horizon)

    @cached_property
    def acting(self) -> Array:
        """States (S,) in which some episode acts."""
        return self.first_times < NEVER

    @cached_property
    def entered(self) -> Array:
        """States (S,) that some episode is ever in."""
        reached = self.start > 0
        if not self.is_timed:
            return self._entered(reached, self.acting, 0)
        for t, level in self.levels():
            reached = self._entered(reached, level, t)
        return reached

    @cached_property
    def connected(self) -> Array:
        """States (S,) that some episode would be in if there were no horizon (where the time does not matter)."""
        if self.is_timed:
            return self.entered
        return self._entered(self.start > 0, self._first_times(None) < NEVER, 0)

    @cached_property
    def is_closed(self) -> bool:
        """True where episodes that begin in any state with actions, at any time, stay within the states of the model."""
        if self.n_states == self.states.size:
            return True
        if self.is_timed:
            return False
        return not (self.successors(self.step(0).P, self.acting) & ~self.acting).any()

    def _entered(self, reached: Array, acting: Array, t: int) -> Array:
        for matrix in self.step(t).matrices:
            reached = reached | self.successors(matrix, acting)
        return reached

    def _first_times(self, horizon: int | None) -> Array:
        times = np.full(self.n_states, NEVER)
        if self.is_timed:
            for t, level in self.levels():
                times[level & (times == NEVER)] = t
            return times
        P = self.step(0).P
        level = np.flatnonzero(self.start)
        t = 0
        while len(level) and (horizon is None or t < horizon):
            times[level] = t
            if 8 * len(level) > self.n_states:
                new = self.successors(P, times == t) & (times == NEVER)
                level = np.flatnonzero(new)
            else:
                ahead = []
                for a in range(self.n_actions):
                    columns = _columns(P, level + a * self.n_states)
                    ahead.append(distinct(columns[times[columns] == NEVER]))
                level = union(ahead)
            t += 1
        return times

    def reads(self, t: int = 0, some: slice = slice(None)) -> dict[tuple[Role, str], Array]:
        """List what expressions read in states.

        Args:
            t: the time, in steps.
            some: the states; all by default.

        Returns:
            values (S,) of each component of the state, by role and name, and the time, int64 (1,).
        """
        return dict(self.states.decode(self.codes[some])) | {TIME: np.array([t], dtype=np.int64)}


def _columns(matrix: Sparse, rows: Array) -> Array:
    first = matrix.indptr[rows]
    entries = entries_of(first, matrix.indptr[rows + 1] - first)
    return np.asarray(matrix.indices[entries[matrix.data[entries] > 0]])


# -- whether a component of the action makes any difference -----------------------------------------------------------

CLEAR = 1e-12
"""A difference that no rounding makes."""


def groups(model: Model, name: str) -> Array:
    """Return actions that differ in one component alone, side by side: codes (groups, values of the component)."""
    space = model.actions
    position = next(i for i, c in enumerate(space.components) if c.name == name)
    values = space.decode(np.arange(space.size))[Role.ACTION, name].reshape(-1, space.size)
    own = np.zeros(space.size, np.int64)
    component = space.components[position]
    for row, low, stride in zip(values, component.low, space.strides[position], strict=True):
        own += (row - int(low)) * stride
    order = np.lexsort((own, np.arange(space.size) - own))
    return np.arange(space.size)[order].reshape(-1, int(np.prod(component.counts)))


def differs(model: Model, action: str, state: str | None = None) -> tuple[bool | None, str]:  # noqa: C901
    """Return whether the action component changes the distribution of the next value of a state component.

    Without `state`: of the whole next state, of the reward, or of the end, in a state where episodes act. None where
    probabilities differ by so little that it may be rounding; an outcome that is possible with one action and never with
    another tells them apart.
    """
    n = model.n_states
    table = groups(model, action)
    acting = np.flatnonzero(model.acting)
    keys = np.arange(n)
    if state is not None:
        value = model.states.decode(model.codes)[Role.STATE, state].reshape(-1, n)
        keys = np.asarray(np.unique(value, axis=1, return_inverse=True)[1]).reshape(-1)
    shape = (n, int(keys.max()) + 1)
    collapse = sparse.csr_array((np.ones(n), (np.arange(n), keys)), shape=shape)
    unsure: str | None = None
    for step in {id(x): x for x in model.steps}.values():
        parts = [matrix @ collapse for matrix in step.matrices]
        if state is not None:
            parts = [sum(parts[1:], parts[0])]
        rows = (table[:, :1] * n + acting).reshape(-1)
        for column in range(1, table.shape[1]):
            others = (table[:, column : column + 1] * n + acting).reshape(-1)
            gap = np.zeros(len(rows))
            if state is None:
                size = np.maximum(np.abs(step.R[rows]), np.abs(step.R[others]))
                gap += np.divide(np.abs(step.R[rows] - step.R[others]), size, out=np.zeros_like(size), where=size > 0)
            for part in parts:
                for matrix in (part, part.sign()):
                    gap += np.asarray(abs(matrix[rows] - matrix[others]).sum(axis=1)).reshape(-1)
            if (gap > CLEAR).any():
                return True, f"it does in {model.state_name(int(rows[np.flatnonzero(gap > CLEAR)[0]] % n))}"
            if unsure is None and (gap > (step.rounding.terms + 4) * 2.0**-50).any():
                unsure = model.state_name(int(rows[gap.argmax()] % n))
    if unsure is not None:
        return None, f"in {unsure} probabilities differ by no more than 1e-12"
    return False, "it does in no state"
