"""The exact model of a finite task: sparse transition matrices, rewards, start; or why there is none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.extras import need
from taskspec.lang.ir import Role
from taskspec.model.space import Space, shown
from taskspec.task.task import Task

# Why a task has no exact model, and the optional package that exact models need.


class NoModel(SpecError):
    """A task has no exact model, or none that answers what is asked (E712)."""


def refuse(message: str, hint: str | None = None) -> NoReturn:
    """Raise `NoModel`."""
    raise NoModel([Diagnostic("E712", None, message, hint)])


def misused(message: str, hint: str | None = None) -> NoReturn:
    """Raise: a function was not called as it can be (E713)."""
    raise SpecError([Diagnostic("E713", None, message, hint)])


def scipy_sparse() -> Any:
    """`scipy.sparse`, imported on first use.

    Raises:
        SpecError: (E705) with the command that installs it.
    """
    return need("scipy.sparse", "exact", "an exact model")


def scipy_module(name: str) -> Any:
    """Return a part of `scipy.sparse`, imported on first use."""
    return need(f"scipy.sparse.{name}", "exact", "an exact model")


# The exact model of a finite task: sparse transition matrices, expected rewards, the start.
#
# Shapes: S states, A actions, T steps. Rows of matrices are action-major: row a*S + s is action a in
# state s, so that a maximum over actions runs over the contiguous leading axis of an (A, S) array.

Sparse = Any  # scipy.sparse.csr_array


@dataclass(frozen=True)
class RoundingTerms:
    """What bounds of rounding errors need to know of a step.

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
    """What a step does at some time.

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
        return [self.P] if self.P_end is None else [self.P, self.P_end]

    def same(self, other: Step) -> bool:
        """Return whether two times are alike, so that one can stand for both."""
        if (self.P_end is None) != (other.P_end is None) or not np.array_equal(self.R, other.R):
            return False
        pairs = [(self.P, other.P)] + ([] if self.P_end is None else [(self.P_end, other.P_end)])
        return all(_equal(a, b) for a, b in pairs)


def _equal(a: Any, b: Any) -> bool:
    return all(np.array_equal(getattr(a, f), getattr(b, f)) for f in ("indptr", "indices", "data"))


@dataclass(frozen=True, eq=False)
class Model:
    """A finite task as arrays.

    `codes` (S,) are the states' codes in `states`, sorted; `start` (S,) their probabilities at the
    beginning. `steps` has one entry if the time does not matter, else one for each time.
    """

    task: Task
    states: Space
    actions: Space
    codes: Array
    start: Array
    steps: tuple[Step, ...]

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
        """Whether dynamics or rewards depend on the time."""
        return len(self.steps) > 1

    def step(self, t: int) -> Step:
        return self.steps[t if self.is_timed else 0]

    @property
    def entries(self) -> int:
        """Non-zeros of all matrices."""
        distinct = {id(step): step for step in self.steps}.values()
        return sum(s.P.nnz + (0 if s.P_end is None else s.P_end.nnz) for s in distinct)

    def with_reward(self, R: Array, lowest: float, highest: float) -> Model:
        """Return a model whose time does not matter with another expected reward (A*S,), and bounds of that of all outcomes."""
        step = self.step(0)
        rounding = RoundingTerms(step.rounding.terms, lowest, highest)
        return replace(self, steps=(replace(step, R=R, rounding=rounding),))

    # -- names both ways --------------------------------------------------------------------------

    def state(self, index: int) -> dict[str, Any]:
        """Return the state with an index, by component."""
        return self.states.values_of(int(self.codes[index]))

    def action(self, index: int) -> dict[str, Any]:
        return self.actions.values_of(index)

    def state_name(self, index: int) -> str:
        return self.states.describe(int(self.codes[index]))

    def action_name(self, index: int) -> str:
        return self.actions.describe(index)

    def state_index(self, values: Mapping[str, Any]) -> int:
        """Return the index of a state given by component (labels for choices). KeyError if it is not in the model."""
        code = code_of(self.states, values)
        index = int(np.searchsorted(self.codes, code))
        if index == len(self.codes) or self.codes[index] != code:
            raise KeyError(f"the model has no state {dict(values)}")
        return index

    def state_indices(self, values: Mapping[str, Array], lanes: int) -> Array:
        """Return the indices (N,) of states by component, (*shape, N); labels as their numbers.

        Raises:
            SpecError: E712 for a state that is not in the model, as no episode comes to it.
        """
        codes, outside = self.states.encode([values[c.name] for c in self.states.components], lanes)
        found = np.minimum(np.searchsorted(self.codes, codes), self.n_states - 1)
        missing = self.codes[found] != codes
        if outside is not None:
            missing |= outside
        if missing.any():
            at = int(np.flatnonzero(missing)[0])
            state = {c.name: values[c.name][..., min(at, values[c.name].shape[-1] - 1)] for c in self.states.components}
            told = ", ".join(f"{c.name} = {shown(c, state[c.name])}" for c in self.states.components)
            refuse(f"nothing is planned for {told}: no episode of {self.task.name} comes there")
        return np.asarray(found)

    def action_index(self, values: Mapping[str, Any]) -> int:
        return code_of(self.actions, values)

    # -- where episodes go ------------------------------------------------------------------------

    def levels(self) -> Iterator[tuple[int, Array]]:
        """For each time at which an action may be taken, which states (S,) it may be taken in."""
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
        """Return the states (S,) that some action leads to from the given ones."""
        if 8 * np.count_nonzero(states) > len(states):
            rows = np.tile(states, self.n_actions).astype(np.float64)
            return np.asarray(matrix.T @ rows) > 0
        some = (np.flatnonzero(states) + self.n_states * np.arange(self.n_actions)[:, None]).reshape(-1)
        first = matrix.indptr[some]
        counts = matrix.indptr[some + 1] - matrix.indptr[some]
        entries = np.arange(counts.sum()) + np.repeat(first - np.cumsum(counts) + counts, counts)
        found = np.zeros(self.n_states, np.bool_)
        found[matrix.indices[entries[matrix.data[entries] > 0]]] = True
        return found

    @cached_property
    def acting(self) -> Array:
        """States (S,) in which some episode acts."""
        found = np.zeros(self.n_states, np.bool_)
        for _, level in self._growth(self.horizon):
            found |= level
        return found

    @cached_property
    def entered(self) -> Array:
        """States (S,) that some episode is ever in."""
        return self._entered(self.horizon)

    @cached_property
    def connected(self) -> Array:
        """States (S,) that some episode would be in if there were no horizon (where the time does not matter)."""
        return self._entered(self.horizon if self.is_timed else None)

    def _entered(self, horizon: int | None) -> Array:
        found = self.start > 0
        for t, level in self._growth(horizon):
            step = self.step(t)
            found = found | self.successors(step.P, level)
            if step.P_end is not None:
                found |= self.successors(step.P_end, level)
        return found

    def _growth(self, horizon: int | None) -> Iterator[tuple[int, Array]]:
        """As `levels`, but where the time does not matter only with the states that are new."""
        if self.is_timed:
            yield from self.levels()
            return
        level = self.start > 0
        seen = np.zeros(self.n_states, np.bool_)
        t = 0
        while level.any() and (horizon is None or t < horizon):
            yield t, level
            seen |= level
            level = self.successors(self.step(0).P, level) & ~seen
            t += 1

    # -- reads ------------------------------------------------------------------------------------

    def reads(self, t: int = 0, some: slice = slice(None)) -> dict[tuple[Role, str], Array]:
        """Return what expressions read in every state (S,), or some of them, at a time."""
        return dict(self.states.decode(self.codes[some])) | {(Role.TIME, "t"): np.array([t], dtype=np.int64)}


def code_of(space: Space, values: Mapping[str, Any]) -> int:
    """Return the code of a combination given by component."""
    arrays = []
    for c in space.components:
        value = values[c.name]
        if c.domain is not None:
            value = _indices(value, c.domain.labels)
        arrays.append(np.asarray(value)[..., None])
    code, outside = space.encode(arrays, 1)
    if outside is not None and outside.any():
        raise KeyError(f"{dict(values)} is outside the declared domains")
    return int(code[0])


def _indices(value: Any, labels: Sequence[str]) -> Any:
    if isinstance(value, list | tuple):
        return [_indices(v, labels) for v in value]
    return labels.index(str(value))
