"""Models without a horizon: candidates by policy iteration, and bounds of their values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.model.model import Model, refuse, scipy_sparse
from taskspec.solve.bounded import Bounded
from taskspec.solve.chains import DIRECT, SWEEP, WORK, Chain, idle_components, leading_to
from taskspec.solve.enclosure import Enclosure
from taskspec.solve.following import Bound, Policy
from taskspec.solve.policy_rules import Rule
from taskspec.solve.rounding import FLOOR, QUIET, UNIT

# ---------- search
# Policy iteration for the best way to act without a horizon: candidates only, which `endless` verifies.
#
# States in which an episode may rest at no cost (`idle_components`) are one place together, with a row of its own for
# resting there for ever. Shapes: P places, R rows (an action in a state, or a rest), sorted by the place they belong to.

SEARCH_ROUNDS = 500
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
        for _ in range(SEARCH_ROUNDS):
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


# ---------- endless
# Answers for models without a horizon: candidates by policy iteration, and bounds that are verified.
#
# Whatever finds a candidate, what is said rests on checks with outward rounding (as in optimistic value iteration, Hartmanns
# and Kaminski 2020): the value of a policy that is known to end (`chains`) bounds the best return from one side. From the
# other side, with a discount, the residual divided by one minus the discount does; without one, a function u >= T u + c
# with c > 0: whatever is done, the total of rewards plus c times the steps taken is at most u, so that episodes that never
# end are worth minus infinity. Where nothing is paid an episode may rest for ever at no cost; these end components count
# as places where it may stop, and u is constant on each, and not negative.

ROUNDS = 200
ENDLESS = "give the task a horizon, or a discount below 1"


class Endless(Bounded):
    """`Bounded` arithmetic with one time, and the answers for models without a horizon."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.acting, self.is_discounted = model.acting, model.discount < 1

    @cached_property
    def is_whole(self) -> bool:
        return False  # sums have as many terms as it takes

    @property
    def numbers(self) -> Endless:
        return self

    # -- answers ------------------------------------------------------------------------------------------------------

    def best(self) -> Enclosure:
        return self.at_start(self.settled(1))

    def worst(self) -> Enclosure:
        found = self.settled(-1)
        return self.at_start(Bound(-found.value, found.error))

    @QUIET
    def value(self, rule: Rule) -> Enclosure:
        """The expected return of a policy."""
        if rule.is_best:
            return self.best()
        policy, part, gamma = rule.settled(self), self.part(0), self.model.discount
        paid = self._table(part.reward, part.reward_error(slice(None)))
        matrix, gain = self._matrix(policy), self.follow(policy, paid)
        inside = self.acting
        if not self.is_discounted:
            inside = inside & self._may_end(policy)
            worth = (gain.value != 0) | (gain.error != 0)
            if (self.acting & ~inside & worth).any():
                refuse("episodes may go on for ever, and are paid", ENDLESS)
        chain = Chain(matrix * gamma, lambda x: self._image(policy, x, gamma), inside)
        return self.at_start(self._signed(chain.enclosed(gain)))

    @QUIET
    def probability(self, rule: Rule, states: Array) -> Enclosure:
        """How likely an episode is ever in one of the states (S,)."""
        policy = rule.settled(self)
        matrix, gain = (
            self._matrix(policy),
            self.follow(policy, self.reached(0, self.marked(self.zero(), states), states)),
        )
        inside = self._leading_to(policy, states) & ~states & self.acting
        found = Chain(matrix, lambda x: self._image(policy, x, 1.0), inside).enclosed(gain)
        return self.at_start(self.marked(found, states))

    def policies(self, rule: Rule) -> Iterator[tuple[int, Policy]]:
        yield 0, rule.settled(self)

    @QUIET
    def settled_best(self, shift: Fraction = Fraction(0)) -> Bound:
        """Action values (A, S) of the best policy, for the reward plus a constant."""
        return self.backup(0, self.settled(1, float(shift)), shift)

    # -- policies -----------------------------------------------------------------------------------------------------

    def _matrix(self, policy: Policy) -> Any:
        """Probabilities of going on (S, S) under a policy, in floats."""
        n, rows = self.model.n_states, policy.table.size
        owner = np.tile(np.arange(n), self.model.n_actions)
        choice = scipy_sparse().csr_array((policy.table.reshape(-1), (owner, np.arange(rows))), shape=(n, rows))
        return (choice @ self.part(0).step.going).tocsr()

    def _image(self, policy: Policy, x: Bound, gamma: float) -> Bound:
        """What a value (S,) is worth one step before under a policy, rewards aside."""
        found = self.follow(policy, self._expected(x))
        value = gamma * found.value
        return Bound(value, (gamma * found.error + 4 * UNIT * np.abs(value)) * (1 + 16 * UNIT))

    def _expected(self, x: Bound) -> Bound:
        part = self.part(0)
        q, error = self._through(part.step.going, self._later(part, x), slice(0, part.step.going.shape[0]))
        return self._table(q, error * part.inflate)

    def _ending(self) -> Array:
        """The chance that a row (A*S,) ends the episode."""
        ending, rows = self.part(0).step.ending, self.model.n_states * self.model.n_actions
        return np.zeros(rows) if ending is None else np.asarray(ending @ np.ones(self.model.n_states))

    def _may_end(self, policy: Policy) -> Array:
        """States (S,) from which a policy may end the episode."""
        return self._leading_to(policy, np.zeros(self.model.n_states, np.bool_), np.ones(self.model.n_states, np.bool_))

    def _leading_to(self, policy: Policy, states: Array, last: Array | None = None) -> Array:
        """States (S,) from which a policy may come to some, or end in some; also by chances that are too small for a float."""
        step = self.part(0).step
        going = _possible(step.going, policy)
        directly = going @ states.astype(np.float64)
        if step.ending is not None:
            directly += _possible(step.ending, policy) @ (states if last is None else last).astype(np.float64)
        return leading_to(going, np.asarray((directly > 0).reshape(policy.table.shape).any(axis=0)))

    # -- the best policy ----------------------------------------------------------------------------------------------

    @QUIET
    def settled(self, sign: int, shift: float = 0.0) -> Bound:
        """The largest values (S,) of the reward times `sign`, plus a constant.

        Raises:
            SpecError: (E712) where they cannot be enclosed.
        """
        search = self._search(sign * self.part(0).reward + shift, not self.is_discounted and not shift)

        def backup(x: Bound) -> Bound:
            return self._signed_backup(x, sign, shift)

        if self.is_discounted:
            return self._contracted(search.spread(search.found()[1]), lambda x: self.top(backup(x)))
        low, high = self._from_below(search, sign, shift), self._from_above(search, backup)
        middle = (low + high) / 2
        reach = np.maximum(high - middle, middle - low) + 4 * UNIT * (np.abs(low) + np.abs(high))
        found = Bound(middle, np.where(self.acting, np.maximum(reach, 0.0), 0.0))
        return self._signed(found, sign, shift)

    def _signed_backup(self, x: Bound, sign: int, shift: float) -> Bound:
        q = self.backup(0, Bound(sign * x.value, x.error), Fraction(shift))
        return Bound(sign * q.value, q.error)

    def _search(self, reward: Array, with_rests: bool) -> Search:
        model = self.model
        nowhere = np.full(model.n_states, -1), np.zeros(len(reward), np.bool_)
        component, idle = idle_components(model.step(0), self.acting) if with_rests else nowhere
        return Search.of(model, reward, self._ending(), component, idle)

    def _contracted(self, value: Array, image: Callable[[Bound], Bound]) -> Bound:
        """A fixed point of a discounted image, near a candidate (S,)."""
        off = self._residual(value, image)
        c = 1 - self.model.discount * (1 + self.part(0).c + self.slack.relative + 8 * UNIT)
        if not c > 0:
            refuse("the discount is too close to 1", "give the task a horizon")
        return Bound(value, np.where(self.acting, off / c * (1 + 1e-12), 0.0))

    def _residual(self, value: Array, image: Callable[[Bound], Bound]) -> float:
        found = image(Bound(value, np.zeros_like(value)))
        off = np.abs(found.value - value) + found.error + 2 * UNIT * (np.abs(found.value) + np.abs(value))
        return float(np.max(off[self.acting], initial=0.0))

    def _from_below(self, search: Search, sign: int, shift: float) -> Array:
        """What a policy found by policy iteration returns at least, (S,)."""
        choice, _ = search.found()
        row = search.row[choice]
        part, taken = self.part(0), row != REST

        def picked(q: Bound) -> Bound:
            value, error = q.value.reshape(-1)[row], q.error.reshape(-1)[row]
            return Bound(np.where(taken, value, 0.0), np.where(taken, error, 0.0))

        def image(x: Bound) -> Bound:
            return picked(self._expected(Bound(search.spread(x.value), search.spread(x.error))))

        more = 4 * UNIT * (np.abs(part.reward) + abs(shift)) if shift else 0.0
        gain = picked(Bound(sign * part.reward + shift, part.reward_error(slice(None)) + more))
        chain = Chain(search.matrix[choice], image, np.ones(search.size, np.bool_))
        found = chain.enclosed(gain)
        return search.spread(np.nextafter(found.value - found.error, -np.inf))

    def _from_above(self, search: Search, backup: Callable[[Bound], Bound]) -> Array:
        """A function (S,) that no policy exceeds: the values for a reward raised by a little more than rounding can add."""
        value = search.spread(search.found()[1])
        rough = backup(Bound(value, np.zeros_like(value)))
        least = float(np.max(np.where(self.acting, rough.error, 0.0))) + 4 * UNIT * float(np.max(np.abs(value)))
        for factor in (4, 64, 4096):
            u = search.spread(search.found(max(factor * least, FLOOR))[1])
            if self._is_above(u, backup(Bound(u, np.zeros_like(u))), search):
                return u
        refuse("it cannot be shown that values settle", ENDLESS)

    def _is_above(self, u: Array, q: Bound, search: Search) -> bool:
        """Whether every action is worth less than u, which is not negative where an episode may rest."""
        most = (q.value + q.error + 4 * UNIT * (np.abs(q.value) + np.abs(u))).reshape(-1)
        margin = (np.tile(u, self.model.n_actions) - most)[search.row[search.row != REST]]
        resting = np.isin(search.place, search.owner[search.row == REST])
        return bool((margin > 0).all() and (u[resting] >= 0).all())

    def _signed(self, value: Bound, sign: int = 1, shift: float = 0.0) -> Bound:
        """Values with the bounds that the signs of the rewards give: what never pays is worth 0 at most."""
        part, here = self.part(0), np.tile(self.acting, self.model.n_actions)
        paid, spread = (sign * part.reward + shift)[here], part.step.spread
        # where outcomes of both signs cancel, rounding may hide which of them prevails
        off = (
            0.0 if spread is None else np.where(spread > np.abs(part.reward), part.reward_error(slice(None)), 0.0)[here]
        )
        off = off + part.hidden
        low, high = value.value - value.error, value.value + value.error
        if (paid - off >= 0).all():
            low = np.maximum(low, 0.0)
        if (paid + off <= 0).all():
            high = np.minimum(high, 0.0)
        high = np.maximum(low, high)
        middle = (low + high) / 2
        reach = np.maximum(high - middle, middle - low) * (1 + 4 * UNIT) + 4 * UNIT * np.abs(middle)
        return Bound(middle, np.where(high > low, reach, 0.0))

    # -- soft values --------------------------------------------------------------------------------------------------

    @QUIET
    def settled_soft(self, beta: float) -> Bound:
        """Action values (A, S) of the causal maximum-entropy policy."""

        def image(x: Bound) -> Bound:
            return self.soft(self.backup(0, x), beta)

        value = self._soft_candidate(beta)
        if self.is_discounted:
            return self.backup(0, self._contracted(value, image))
        off = self._residual(value, image)
        ratio, w = self._longest()
        return self.backup(0, Bound(value, np.where(self.acting, off * ratio * w * (1 + 1e-12), 0.0)))

    def _soft_candidate(self, beta: float) -> Array:
        """By policy iteration: the policy of the values, and its return with its entropy."""
        value, part = np.zeros(self.model.n_states), self.part(0)
        reward = part.reward.reshape(self.model.n_actions, -1)
        for _ in range(ROUNDS):
            policy = self.boltzmann(self.backup(0, Bound(value, np.zeros_like(value))), beta)
            logs = np.log(np.maximum(policy.table, 1e-300))
            gain = (policy.table * (reward - logs / beta)).sum(axis=0)
            better = Chain(self.model.discount * self._matrix(policy), lambda x: x, self.acting).solved(gain)
            gap, value = float(np.max(np.abs(better - value))), better
            if gap <= 1e-15 * float(np.max(np.abs(value))) or not np.isfinite(gap):
                break
        return value

    def _longest(self) -> tuple[float, Array]:
        """1/c and w >= 0 with w - P w >= c > 0 for every action: no policy goes on for ever."""
        search = self._search(np.ones(self.model.n_states * self.model.n_actions), False)
        w = search.spread(np.maximum(search.found()[1], 0.0))
        image = self._expected(Bound(w, np.zeros_like(w)))
        off = w - image.value - image.error - 4 * UNIT * (w + np.abs(image.value))
        c = float(np.min(off[:, self.acting], initial=np.inf))
        if not (c > 0 and np.isfinite(w).all()):
            refuse("it cannot be shown that episodes end", ENDLESS)
        return 1 / c * (1 + 1e-12), w


def _possible(matrix: Any, policy: Policy) -> Any:
    """Ones for the entries (A*S, S) of a matrix that a policy may follow, whatever their chances."""
    taken = (policy.table > 0) if policy.error is None else (policy.table + policy.error > 0)
    kept = np.repeat(taken.reshape(-1), np.diff(matrix.indptr)) & (matrix.data > 0)
    return type(matrix)((kept.astype(np.float64), matrix.indices, matrix.indptr), shape=matrix.shape)
