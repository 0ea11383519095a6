"""Models without a horizon: values by policy iteration, with bounds that are verified.

A candidate need not be trusted. With a weight w > 0 and w - gamma P w >= c > 0 in every state, for every action that may be
taken, the Bellman operator is a contraction in the maximum norm weighted by w, so that a candidate with a residual of at most r
is off by at most (r / c) w (D. Bertsekas and J. Tsitsiklis, Neuro-Dynamic Programming, 1996, section 2.2). With a discount
w is 1; without one it is the largest expected number of steps, if that is finite.

Where some policy never ends, the largest values without a discount lie between those of a policy that ends, and any function
u >= r + P u which is positive everywhere, or falls by some c > 0 with every step, as paid for by the rewards (A. Hartmanns and
B. Kaminski, Optimistic Value Iteration, 2020). Where neither can be shown, there is no value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.model.model import Model, NoModel, refuse, scipy_module, scipy_sparse
from taskspec.solve.backward import Rule
from taskspec.solve.bounded import QUIET, UNIT, Bound, Bounded, Policy
from taskspec.solve.enclosure import Enclosure

DIRECT = 3000
"""The number of states up to which equations are solved directly."""
WORK = 300_000_000
"""The number of non-zeros that repeated substitution may go through."""
SWEEP = 10_000
"""The number of non-zeros that would take as long as starting to go through them does."""
ROUNDS = 500
HINT = "give the task a horizon, or a discount below 1"

Image = Callable[[Bound, int], Bound]
"""An operator on values (S,), for either of the sides between which a policy may be open."""

# -- linear equations -------------------------------------------------------------------------------------------------


def chain_values(matrix: Any, gain: Array, inside: Array) -> Array:
    """Solve v = gain + P v over some states; v is 0 elsewhere.

    Args:
        matrix: sparse (S, S), P.
        gain: float64 (S,).
        inside: bool (S,), the states.

    Returns:
        float64 (S,), by sparse LU with one step of refinement; of many states by repeated substitution.

    Raises:
        SpecError: (E712) where the chain is never left.
    """
    states = np.flatnonzero(inside)
    found = np.zeros(len(inside))
    if len(states):
        part = matrix[states][:, states]
        found[states] = _direct(part, gain[states]) if len(states) <= DIRECT else _substituted(part, gain[states])
    return found


def _direct(matrix: Any, gain: Array) -> Array:
    left = scipy_sparse().identity(len(gain), format="csc") - matrix.tocsc()
    try:
        factors = scipy_module("linalg").splu(left)
    except RuntimeError:  # singular
        refuse("it cannot be shown that episodes end", HINT)
    found = factors.solve(gain)
    found = found + factors.solve(gain - left @ found)
    if not np.isfinite(found).all():
        refuse("it cannot be shown that episodes end", HINT)
    return np.asarray(found)


def _substituted(matrix: Any, gain: Array) -> Array:
    return _swept(lambda value: gain + matrix @ value, gain, matrix.nnz)


def _swept(image: Callable[[Array], Array], value: Array, cost: int) -> Array:
    """Return a fixed point of an operator by repeated substitution, as far as `WORK` goes."""
    before = np.inf
    for _ in range(WORK // (SWEEP + cost + len(value)) + 1):
        better = image(value)
        gap = float(np.max(np.abs(better - value), initial=0.0))
        value = better
        if gap <= 1e-16 * float(np.max(np.abs(value), initial=0.0)) or not np.isfinite(gap):
            break
        if gap >= before and gap < 1e-12:
            break
        before = gap
    return value


def leading_to(matrix: Any, targets: Array) -> Array:
    """Return the states (S,) from which targets can be reached, these included, by a matrix (S, S) or rows (A*S, S)."""
    found = targets.copy()
    actions = matrix.shape[0] // matrix.shape[1]
    while True:
        more = found | ((matrix @ found.astype(np.float64)) > 0).reshape(actions, -1).any(axis=0)
        if (more == found).all():
            return found
        found = more


# -- answers ----------------------------------------------------------------------------------------------------------


class InfiniteHorizon(Bounded):
    """`Bounded` arithmetic with one time, and the answers for models without a horizon."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.is_discounted = model.discount < 1
        self.model_step = model.step(0)

    @cached_property
    def is_whole(self) -> bool:
        return False  # sums have as many terms as it takes

    @property
    def numbers(self) -> InfiniteHorizon:
        return self

    def best(self) -> Enclosure:
        return self._enclosed(self.stationary_values(1), self.live, self._sign)

    def worst(self) -> Enclosure:
        return self._enclosed(self.stationary_values(-1).negative(), self.live, self._sign)

    def policies(self, rule: Rule) -> Iterator[tuple[int, Policy]]:
        yield 0, rule.stationary(self)

    @QUIET
    def value(self, rule: Rule) -> Enclosure:
        """Return the expected return of a policy."""
        if rule.is_best:
            return self.best()
        policy = rule.stationary(self)
        inside = self.live
        if not self.is_discounted:
            everywhere = np.ones(self.model.n_states, np.bool_)
            ends = self._leading_to(policy, np.zeros_like(everywhere), everywhere)
            if (inside & ~ends & (self._pays & _taken(policy)).any(axis=0)).any():
                refuse("episodes may go on for ever, and are paid", HINT)
            inside = inside & ends

        def image(V: Bound, side: int) -> Bound:
            return self.follow(policy, self.backup(0, V), side)

        gain = self.follow(policy, self.backup(0, self._zero)).value
        found = self._chain(policy, gain, image, inside, self.model.discount, self._sign)
        return self._enclosed(found, inside, self._sign)

    @QUIET
    def probability(self, rule: Rule, states: Array) -> Enclosure:
        """Return how likely an episode is ever in one of the states (S,)."""
        policy = rule.stationary(self)
        inside = self._leading_to(policy, states, states) & ~states & self.model.acting

        def image(V: Bound, side: int) -> Bound:
            return self.follow(policy, self.reached(0, self.marked(V, states), states), side)

        gain = image(self._zero, 1).value
        found = self._chain(policy, gain, image, inside, 1.0, 1)
        return self._enclosed(replace(self.marked(found, states), is_signed=False), inside)

    @property
    def _zero(self) -> Bound:
        return Bound(np.zeros(self.model.n_states))

    def _chain(self, policy: Policy, gain: Array, image: Image, inside: Array, discount: float, sign: int) -> Bound:
        """Return the fixed point of the affine operator of a policy over the states `inside`; 0 elsewhere."""
        n = self.model.n_states
        columns = np.tile(np.arange(n), self.model.n_actions)
        choice = scipy_sparse().csr_array((policy.table.reshape(-1), (columns, np.arange(len(columns)))))
        matrix = (choice @ self.model_step.P).tocsr() * discount
        candidate = chain_values(matrix, gain, inside)
        weight = np.ones(n)
        if discount == 1:
            weight = np.where(inside, np.maximum(chain_values(matrix, inside.astype(np.float64), inside), 0.0), 0.0)
        later = self._discounted_mean(Bound(weight * inside), discount)
        return self._contracted(candidate, image, weight, self.follow(policy, later), inside, sign)

    def _discounted_mean(self, w: Bound, discount: float) -> Bound:
        """Return discount * P w (A, S)."""
        value = self._table(self.model_step.P @ w.value) * discount
        return self.weights(self.model_step).expectation(value, replace(w, is_signed=True))

    def _contracted(
        self, candidate: Array, image: Image, weight: Array, later: Bound, inside: Array, sign: int = 0
    ) -> Bound:
        """Return the fixed point of a contraction, with its bound.

        Args:
            candidate: float64 (S,), near the fixed point.
            image: the operator.
            weight: float64 (S,), w.
            later: the largest expectation of w (S,) after a step.
            inside: bool (S,), the states that count.
            sign: that of all values, or 0.

        Raises:
            SpecError: (E712) where it cannot be shown that the operator is a contraction.
        """
        if sign:
            candidate = sign * np.maximum(sign * candidate, 0.0)
        if not inside.any():
            return Bound(candidate)
        off = 0.0
        for side in (1, -1):
            found = image(Bound(candidate, is_signed=sign != 0), side)
            rounding = found.error + 2 * UNIT * (np.abs(found.value) + np.abs(candidate))
            off = max(off, float(np.max((np.abs(found.value - candidate) + rounding)[inside])))
        c = float(np.min((weight - later.value - later.error - 2 * UNIT * weight)[inside]))
        if not c > 0:
            refuse("it cannot be shown that episodes end", HINT)
        return Bound(candidate, 0.0, off / c * float(np.max(weight[inside])) * (1 + 16 * UNIT))

    def _enclosed(self, V: Bound, inside: Array, sign: int = 0) -> Enclosure:
        """Return the expectation over the first state of values that are exact outside of some states (S,)."""
        is_inside = bool((inside & (self.model.start > 0)).any())
        found = self.at_start(V if is_inside else Bound(V.value))
        if not sign:
            return found
        zero = Fraction(0)
        if sign > 0:
            return Enclosure(max(found.low, zero), max(found.high, zero))
        return Enclosure(min(found.low, zero), min(found.high, zero))

    @cached_property
    def _sign(self) -> int:
        """The sign of all rewards; 0 where both occur."""
        if not self.is_signed:
            return 0
        return 1 if self.model_step.rounding.lowest >= 0 else -1

    def _leading_to(self, policy: Policy, states: Array, last: Array) -> Array:
        """Return the states (S,) from which a policy may come to some states, or end in some, however improbably."""
        P = _possible(self.model_step.P, policy)
        directly = P @ states.astype(np.float64)
        if self.model_step.P_end is not None:
            directly += _possible(self.model_step.P_end, policy) @ last.astype(np.float64)
        return leading_to(P, np.asarray((directly > 0).reshape(policy.table.shape).any(axis=0)))

    # -- the best policy ----------------------------------------------------------------------------------------------

    @cached_property
    def live(self) -> Array:
        """States (S,) in which episodes act, without those from which nothing is ever paid again."""
        if self.is_discounted:
            return self.model.acting
        return self.model.acting & leading_to(self.model_step.P, np.asarray(self._pays.any(axis=0)))

    @cached_property
    def _pays(self) -> Array:
        """Actions (A, S) that may pay something; where outcomes of both signs may cancel, rounding hides which do."""
        if not self.is_signed and self.model_step.rounding.terms > 1:
            return np.ones((self.model.n_actions, self.model.n_states), np.bool_)
        return self._table(self.model_step.R != 0)

    def q_values(self, shift: Fraction = Fraction(0)) -> Bound:
        """Return Q (A, S) of the best policy, for the reward plus a constant."""
        return self.backup(0, self.stationary_values(1, shift), shift)

    @QUIET
    def stationary_values(self, sign: int, shift: Fraction = Fraction(0)) -> Bound:
        """Return the largest values (S,) of the reward times `sign`, plus a constant.

        Raises:
            SpecError: (E712) where they cannot be enclosed.
        """
        live = self.model.acting if shift else self.live
        reward = self._table(sign * self.model_step.R + float(shift))

        def backup(V: Bound, side: int = 1) -> Bound:
            q = self.backup(0, replace(V, value=sign * V.value), sign * shift)
            return q if sign > 0 else q.negative()

        value, choice = self._policy_iteration(reward, live)
        weight = self._weight(live)
        if weight is not None:
            later = self.top(self._discounted_mean(Bound(weight), self.model.discount))
            signs = 0 if shift else sign * self._sign
            found = self._contracted(value, lambda V, side: self.top(backup(V)), weight, later, live, signs)
        else:
            found = self._between(value, choice, backup, live, reward)
        return found

    def _weight(self, live: Array) -> Array | None:
        """Return the weight (S,) of a norm in which all steps contract; None where some policy never ends."""
        if self.is_discounted:
            return np.ones(self.model.n_states)
        try:
            found, _ = self._policy_iteration(np.ones((self.model.n_actions, self.model.n_states)), live)
        except NoModel:
            return None
        later = self.top(self._discounted_mean(Bound(found), 1.0))
        falls = (found - later.value - later.error)[live] > 0
        return found if np.isfinite(found).all() and falls.all() else None

    def _between(
        self, value: Array, choice: Array, backup: Callable[[Bound], Bound], live: Array, reward: Array
    ) -> Bound:
        """Return the largest values (S,) where some policy never ends, between those of a policy and an upper bound."""
        table = np.zeros((self.model.n_actions, self.model.n_states))
        table[choice, np.arange(self.model.n_states)] = 1
        policy = Policy(table)
        gain = reward[choice, np.arange(self.model.n_states)]
        low = self._chain(policy, gain, lambda V, side: self.follow(policy, backup(V)), live, 1.0, 0)
        rough = backup(Bound(value)).error
        least = float(np.max(rough[:, live], initial=0.0)) + 4 * UNIT * float(np.max(np.abs(value), initial=0.0))
        for bonus in (0.0, 4 * least, 64 * least, 4096 * least):
            try:
                u, _ = self._policy_iteration(reward + bonus, live)
            except NoModel:
                continue
            if self._is_above(u, reward, backup, live):
                middle = (low.value + u) / 2
                reach = np.maximum(u - middle, middle - low.value) + low.absolute + 4 * UNIT * np.abs(middle)
                return Bound(middle, 0.0, float(np.max(reach[live], initial=0.0)))
        refuse("it cannot be shown that values settle", HINT)

    def _is_above(self, u: Array, reward: Array, backup: Callable[[Bound], Bound], live: Array) -> bool:
        """Return whether u (S,) bounds the values of all policies from above."""
        q = backup(Bound(u))
        slack = (u - q.value - q.error - 4 * UNIT * (np.abs(q.value) + np.abs(u)))[:, live]
        if (slack > 0).all():
            return True
        single = self._table(np.diff(self.model_step.P.indptr) <= 1) & (self.model_step.rounding.terms == 1)
        exact = single & (np.mod(reward, 1) == 0) & bool((np.mod(u, 1) == 0).all())
        return bool(((slack > 0) | (exact & (u >= q.value))[:, live]).all() and (u[live] >= 0).all())

    def _policy_iteration(self, reward: Array, live: Array) -> tuple[Array, Array]:
        """Return values (S,) and actions (S,) of a policy that ends, where no other action is better.

        Raises:
            SpecError: (E712) where there is no such policy, or better ones never end.
        """
        P = self.model_step.P
        states = np.arange(self.model.n_states)
        discount = self.model.discount
        choice = reward.argmax(axis=0) if self.is_discounted else self._ending(live)

        def q_values(V: Array) -> Array:
            return np.where(live, reward + discount * self._table(P @ V), 0.0)

        if np.count_nonzero(live) > DIRECT:
            value = _swept(lambda V: q_values(V).max(axis=0), np.zeros(len(states)), P.nnz)
            if not np.isfinite(value).all():
                refuse("the task has no horizon and its values do not settle", HINT)
            return value, np.asarray(q_values(value).argmax(axis=0))
        value = np.zeros(len(states))
        for _ in range(ROUNDS):
            rows = choice * len(states) + states
            value = chain_values(discount * P[rows], reward[choice, states], live)
            q = q_values(value)
            top = q.max(axis=0)
            now = q[choice, states]
            better = np.where(top > now + 1e-13 * (np.abs(top) + np.abs(now)), q.argmax(axis=0), choice)
            if (better == choice).all():
                break
            choice = better
        return value, choice

    def _ending(self, live: Array) -> Array:
        """Return actions (S,) by which every episode ends, or comes to where nothing is paid."""
        step = self.model_step
        hit = self._table(step.P @ (~live).astype(np.float64)) > 0
        if step.P_end is not None:
            hit |= self._table(step.P_end @ np.ones(len(live))) > 0
        choice = np.zeros(len(live), np.int64)
        done = ~live
        while True:
            new = hit.any(axis=0) & ~done
            if not new.any():
                break
            choice[new] = hit.argmax(axis=0)[new]
            done = done | new
            hit = self._table(step.P @ done.astype(np.float64)) > 0
        if not done.all():
            refuse("the task has no horizon and its values do not settle", HINT)
        return choice

    # -- soft values --------------------------------------------------------------------------------------------------

    @QUIET
    def soft_q_values(self, beta: float) -> Bound:
        """Return Q (A, S) of the causal maximum-entropy policy."""
        live = self.model.acting
        weight = self._weight(live)
        if weight is None:
            refuse("it cannot be shown that episodes end", HINT)
        value = self._soft_candidate(beta, live)
        later = self.top(self._discounted_mean(Bound(weight), self.model.discount))
        found = self._contracted(value, lambda V, side: self.soft(self.backup(0, V), beta), weight, later, live)
        return self.backup(0, found)

    def _soft_candidate(self, beta: float, live: Array) -> Array:
        """Return soft values (S,) by policy iteration: the return of the policy of the values, and its entropy."""
        value = np.zeros(self.model.n_states)
        reward = self._table(self.model_step.R)
        columns = np.tile(np.arange(self.model.n_states), self.model.n_actions)
        for _ in range(ROUNDS):
            pi = self.boltzmann(self.backup(0, Bound(value)), beta).table
            gain = (pi * (reward - np.log(np.maximum(pi, 1e-300)) / beta)).sum(axis=0)
            choice = scipy_sparse().csr_array((pi.reshape(-1), (columns, np.arange(len(columns)))))
            better = chain_values(self.model.discount * (choice @ self.model_step.P).tocsr(), gain, live)
            gap = float(np.max(np.abs(better - value)))
            value = better
            if gap <= 1e-15 * float(np.max(np.abs(value))) or not np.isfinite(gap):
                break
        return value


def _possible(matrix: Any, policy: Policy) -> Any:
    """Return a matrix (A*S, S) with ones for the entries that a policy may follow, however improbably."""
    kept = np.repeat(_taken(policy).reshape(-1), np.diff(matrix.indptr)) & (matrix.data > 0)
    return type(matrix)((kept.astype(np.float64), matrix.indices, matrix.indptr), shape=matrix.shape)


def _taken(policy: Policy) -> Array:
    """Return which actions (A, S) a policy may take."""
    return (policy.table > 0) | (policy.absolute > 0)
