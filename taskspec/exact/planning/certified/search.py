"""Policy iteration for the best way to act without a horizon: candidates only, which `endless` verifies.

States in which an episode may rest at no cost (`idle_components`) are one place together, with a row of its own for
resting there for ever. Shapes: P places, R rows (an action in a state, or a rest), sorted by the place they belong to.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.exact.model.failure import refuse, scipy_sparse
from taskspec.exact.model.model import Model
from taskspec.exact.planning.certified.chains import DIRECT, SWEEP, WORK, Chain

Array = np.ndarray[Any, Any]
ROUNDS = 500
REST = -1


@dataclass(frozen=True)
class Search:
    """The rows of all places: `row` is a*S + s of each (`REST`: none), `owner` its place, `matrix` (R, P) with discount."""

    place: Array  # of each state (S,); -1 where no episode acts
    row: Array
    owner: Array
    matrix: Any
    gain: Array
    ends: Array  # which rows (R,) may end the episode, a rest among them
    is_discounted: bool

    @classmethod
    def of(cls, model: Model, reward: Array, ending: Array, component: Array, idle: Array) -> Search:
        """Over all actions where episodes act.

        Args:
            reward, ending: what each row (A*S,) pays, and its chance of ending.
            component, idle: the resting place of each state (S,), and the rows (A*S,) that stay in one.
        """
        going, acting, states = model.step(0).going, model.acting, model.n_states
        place = _places(acting, component)
        rows = np.flatnonzero(np.tile(acting, model.n_actions) & ~idle)
        rests = np.unique(place[(component >= 0) & acting])
        row = np.concatenate([rows, np.full(len(rests), REST)])
        owner = np.concatenate([place[rows % states], rests])
        order = np.argsort(owner, kind="stable")
        row, owner = row[order], owner[order]
        some = row != REST
        matrix = _picked(going, row, some, place) * model.discount
        gain = np.where(some, reward[row], 0.0)
        return cls(place, row, owner, matrix, gain, ~some | (ending[row] > 0), model.discount < 1)

    @property
    def size(self) -> int:
        return int(self.matrix.shape[1])

    def spread(self, value: Array) -> Array:
        """Values of places (P,) as those of states (S,)."""
        return np.where(self.place >= 0, np.append(value, 0.0)[self.place], 0.0)

    # -- choices ------------------------------------------------------------------------------------------------------

    def chain(self, choice: Array) -> Chain:
        return Chain(self.matrix[choice], lambda x: x, np.ones(self.size, np.bool_))

    def best(self, q: Array, choice: Array | None = None) -> Array:
        """The best row (P,) of each place; the present one where no other is clearly better."""
        top = np.maximum.reduceat(q, np.searchsorted(self.owner, np.arange(self.size)))
        candidates = np.flatnonzero(q == top[self.owner])
        found = candidates[np.unique(self.owner[candidates], return_index=True)[1]]
        if choice is None:
            return found
        return np.where(top > q[choice] + 1e-13 * (np.abs(top) + np.abs(q[choice])), found, choice)

    def proper(self) -> Array:
        """Rows (P,) by which every episode ends, or rests.

        Raises:
            SpecError: (E712) when there are none.
        """
        if self.is_discounted:
            return self.best(self.gain)
        done, choice = np.zeros(self.size, np.bool_), np.zeros(self.size, np.int64)
        hit = self.ends
        while True:
            rows = np.flatnonzero(hit & ~done[self.owner])
            if not len(rows):
                break
            places, index = np.unique(self.owner[rows], return_index=True)
            choice[places], done[places] = rows[index], True
            hit = (self.matrix @ done.astype(np.float64)) > 0
        if not done.all():
            refuse("the task has no horizon and its values do not settle", "give it a discount below 1, or a horizon")
        return choice

    def found(self, bonus: float = 0.0) -> tuple[Array, Array]:
        """Rows (P,) that nothing improves on, as far as was looked, and values (P,); `bonus` is paid for each step."""
        gain = np.where(self.row == REST, 0.0, self.gain + bonus)
        if self.size > DIRECT:
            return self._swept(gain, bonus)
        choice = self.proper()
        value = np.zeros(self.size)
        for _ in range(ROUNDS):
            value = self.chain(choice).solved(gain[choice])
            better = self.best(gain + self.matrix @ value, choice)
            if (better == choice).all() or not np.isfinite(value).all():
                break
            choice = better
        return choice, value

    def _swept(self, gain: Array, bonus: float) -> tuple[Array, Array]:
        """By sweeps, as far as `WORK` goes."""
        self.proper()
        first = np.searchsorted(self.owner, np.arange(self.size))
        value = np.zeros(self.size)
        for _ in range(WORK // (SWEEP + self.matrix.nnz + len(gain)) + 1):
            better = np.maximum.reduceat(gain + self.matrix @ value, first)
            gap = float(np.max(np.abs(better - value)))
            value = better
            if gap <= 1e-15 * float(np.max(np.abs(value))) + bonus / 4 or not np.isfinite(gap):
                break
        return self.best(gain + self.matrix @ value), value


def _places(acting: Array, component: Array) -> Array:
    """A number for each state (S,): the same within a component, -1 where no episode acts."""
    key = np.where(component >= 0, component, len(acting) + np.arange(len(acting)))
    place = np.full(len(acting), -1)
    place[acting] = np.unique(key[acting], return_inverse=True)[1].reshape(-1)
    return place


def _picked(going: Any, row: Array, some: Array, place: Array) -> Any:
    """The chosen rows (R, P), with columns by place; empty rows where there is none to choose."""
    sparse, inside = scipy_sparse(), np.flatnonzero(place >= 0)
    shape = (len(place), int(place.max(initial=-1)) + 1)
    merge = sparse.csr_array((np.ones(len(inside)), (inside, place[inside])), shape=shape)
    entries = (np.ones(int(some.sum())), (np.flatnonzero(some), row[some]))
    return (sparse.csr_array(entries, shape=(len(row), going.shape[0])) @ going @ merge).tocsr()
