"""Models without a horizon: values by policy iteration, with bounds that are verified.

A candidate need not be trusted. With a weight w > 0 and w - gamma P w >= c > 0 in every state, for every action that may be
taken, the Bellman operator is a contraction in the maximum norm weighted by w, so that a candidate with a residual of at most r
is off by at most (r / c) w (D. Bertsekas and J. Tsitsiklis, Neuro-Dynamic Programming, 1996, section 2.2). With a discount
w is 1; without one it is the largest expected number of steps. Where some policy never ends, there is none, and no value is
known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from taskspec.base.arrays import Array
from taskspec.base.extras import is_installed
from taskspec.base.limits import limits
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.probabilities import UNIT
from taskspec.exact.solve.bounded import QUIET, Bound, Bounded, Policy
from taskspec.exact.solve.enclosure import Enclosure, negative

if TYPE_CHECKING:
    from taskspec.exact.solve.backward import Rule

DIRECT = 3000
"""The number of states up to which equations are solved directly."""
WORK = 300_000_000
"""The number of non-zeros that repeated substitution may go through."""
COMPILED = 100_000
"""Non-zeros above which sweeps are compiled: importing Numba takes as long as a thousand sweeps over them in SciPy."""
RATE = 1_000_000_000
"""Non-zeros that compiled substitution goes through in each second of the limit."""
SWEEP = 10_000
"""The number of non-zeros that would take as long as starting to go through them does."""
ROUNDS = 500
UNENDING = "it cannot be shown that episodes end"
HINT = "give the task a horizon, or a discount below 1"


def chain_values(matrix: Any, gain: Array, inside: Array) -> Array:
    """Solve v = gain + P v over some states; v is 0 elsewhere.

    Args:
        matrix: sparse (S, S), P.
        gain: float64 (S,).
        inside: bool (S,), the states.

    Returns:
        float64 (S,), by sparse LU with one step of refinement; of many states by repeated substitution.
    """
    states = np.flatnonzero(inside)
    found = np.zeros(len(inside))
    if not len(states):
        return found
    P = matrix[states][:, states]
    r = gain[states]
    if len(states) > DIRECT:
        found[states] = fixed_point(lambda v: r + P @ v, r, P.nnz)
        return found
    from scipy.sparse.linalg import splu  # a twentieth of a second, for this alone

    left = sparse.identity(len(r), format="csc") - P.tocsc()
    try:
        factors = splu(left)
    except RuntimeError:  # singular
        refuse(UNENDING, HINT)
    v = factors.solve(r)
    v += factors.solve(r - left @ v)
    if not np.isfinite(v).all():
        refuse(UNENDING, HINT)
    found[states] = v
    return found


def fixed_point(image: Callable[[Array], Array], value: Array, cost: int, enough: float = 0.0) -> Array:
    """Return a fixed point of an operator by repeated substitution, within the limit `WORK`.

    Args:
        cost: of a substitution, in non-zeros.
        enough: the change of values at which to stop.
    """
    before = np.inf
    for _ in range(WORK // (SWEEP + cost + len(value)) + 1):
        better = image(value)
        gap = float(np.max(np.abs(better - value), initial=0.0))
        value = better
        if gap <= enough or is_fixed(gap, before, value):
            break
        before = gap
    return value


def is_fixed(gap: float, before: float, value: Array) -> bool:
    """Return whether substitution ends: values change by rounding alone, by the last gap and the one before, or are infinite."""
    if gap <= 1e-16 * float(np.max(np.abs(value), initial=0.0)) or not np.isfinite(gap):
        return True
    return gap >= before and gap < 1e-12


def followed(P: Any, policy: Array) -> Any:
    """Return the transitions (S, S) of a policy (A, S), from those of all actions (A*S, S)."""
    columns = np.tile(np.arange(policy.shape[1]), len(policy))
    choice = sparse.csr_array((policy.reshape(-1), (columns, np.arange(len(columns)))))
    return (choice @ P).tocsr()


def leading_to(matrix: Any, targets: Array) -> Array:
    """Return the states (S,) from which targets can be reached, these included, by a matrix (S, S) or rows (A*S, S)."""
    found = np.zeros(len(targets), np.bool_)
    found[nearest_first(matrix, targets)] = True
    return found


def nearest_first(matrix: Any, targets: Array) -> Array:
    """Return the indices of the states of `leading_to` by their number of steps to a target, the least first."""
    from scipy.sparse.csgraph import breadth_first_order  # a fiftieth of a second, for this alone

    n = len(targets)
    if n <= DIRECT:  # there may be many more entries than pairs of states
        leads = np.zeros((n, n), np.bool_)
        source = np.repeat(np.arange(matrix.shape[0]) % n, np.diff(matrix.indptr))
        possible = matrix.data > 0
        leads[matrix.indices[possible], source[possible]] = True
        back = sparse.csr_array(leads)
    else:
        back = matrix.tocsc(copy=True)
        back.eliminate_zeros()
    first = np.flatnonzero(targets)
    indices = np.append(back.indices % n, first)  # one more node, before all targets
    indptr = np.append(back.indptr, len(indices))
    graph = sparse.csr_array((np.ones(len(indices)), indices, indptr), shape=(n + 1, n + 1))
    return np.asarray(breadth_first_order(graph, n, return_predecessors=False)[1:])


class InfiniteHorizon(Bounded):
    """`Bounded` arithmetic with one time, and the answers for models without a horizon."""

    is_whole = False  # sums have as many terms as it takes

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.is_discounted = model.discount < 1
        self.only = model.step(0)

    @property
    def numbers(self) -> InfiniteHorizon:
        return self

    def best(self) -> Enclosure:
        return self._enclosed(self.stationary_values(), self.live)

    def worst(self) -> Enclosure:
        return negative(self.negated().best())

    def policies(self, rule: Rule) -> Iterator[tuple[int, Policy]]:
        yield 0, rule.stationary(self)

    @QUIET
    def value(self, rule: Rule, paid: InfiniteHorizon | None = None) -> Enclosure:
        """Return the expected return of a policy; `paid` as for models with a horizon."""
        if rule.is_best and paid is None:
            return self.best()
        policy = rule.stationary(self)
        n = self
        if paid is not None:
            n = paid

        def image(V: Bound) -> Bound:
            return n.follow(policy, n.backup(0, V))

        return n._enclosed(n._chain(policy, image, n.live, n.model.discount), n.live)

    @QUIET
    def probability(self, rule: Rule, states: Array) -> Enclosure:
        """Return how likely an episode is ever in one of the states (S,)."""
        policy = rule.stationary(self)
        taken = ((policy.table > 0) | (policy.absolute > 0)).reshape(-1)  # however improbably
        P = self.only.P
        possible = np.repeat(taken, np.diff(P.indptr)) & (P.data > 0)
        moves = type(P)((possible.astype(np.float64), P.indices, P.indptr), shape=P.shape)
        directly = moves @ states.astype(np.float64)
        if self.only.P_end is not None:
            directly += taken * (self.only.P_end @ states.astype(np.float64) > 0)
        targets = (directly > 0).reshape(self.shape).any(axis=0)
        inside = leading_to(moves, targets) & ~states & self.model.acting

        def image(V: Bound) -> Bound:
            return self.follow(policy, self.reached(0, self.marked(V, states), states))

        found = self.marked(self._chain(policy, image, inside, 1.0), states)
        return self._at_start(replace(found, is_signed=False), inside)

    def negated(self) -> InfiniteHorizon:
        """Return the same for the negative reward."""
        lowest = self.only.rounding.lowest
        highest = self.only.rounding.highest
        return InfiniteHorizon(self.model.with_reward(-self.only.R, -highest, -lowest))

    def _chain(self, policy: Policy, image: Callable[[Bound], Bound], inside: Array, discount: float) -> Bound:
        """Return the fixed point of the affine operator of a policy over the states `inside`; 0 elsewhere."""
        matrix = followed(self.only.P, policy.table) * discount
        candidate = chain_values(matrix, image(Bound(np.zeros(len(inside)))).value, inside)
        weight = inside.astype(np.float64)
        if discount == 1:
            weight = np.maximum(chain_values(matrix, weight, inside), 0.0)
        later = self.follow(policy, self._expected(weight, discount))
        return self._contracted(candidate, image, weight, later, inside)

    def _expected(self, w: Array, discount: float) -> Bound:
        value = (self.only.P @ w).reshape(self.shape) * discount
        return self.errors(self.only).expectation(value, Bound(w, is_signed=True))

    def _contracted(
        self, candidate: Array, image: Callable[[Bound], Bound], weight: Array, later: Bound, inside: Array
    ) -> Bound:
        """Return the fixed point of a contraction, with its bound.

        Args:
            candidate: float64 (S,), near the fixed point.
            image: the operator.
            weight: float64 (S,), w.
            later: the largest expectation of w (S,) after a step.
            inside: bool (S,), the states that count.
        """
        if not inside.any():
            return Bound(candidate)
        found = image(Bound(candidate))
        rounding = found.error + 2 * UNIT * (np.abs(found.value) + np.abs(candidate))
        residual = float(np.max((np.abs(found.value - candidate) + rounding)[inside]))
        c = float(np.min((weight - later.value - later.error - 2 * UNIT * weight)[inside]))
        if not c > 0:
            refuse(UNENDING, HINT)
        return Bound(candidate, 0.0, residual / c * float(np.max(weight[inside])) * (1 + 16 * UNIT))

    def _at_start(self, V: Bound, inside: Array) -> Enclosure:
        is_inside = bool((inside & (self.model.start > 0)).any())
        return self.at_start(V if is_inside else Bound(V.value))

    def _enclosed(self, V: Bound, inside: Array) -> Enclosure:
        found = self._at_start(V, inside)
        zero = Fraction(0)
        if self.only.rounding.lowest >= 0:
            return Enclosure(max(found.low, zero), max(found.high, zero))
        if self.only.rounding.highest <= 0:
            return Enclosure(min(found.low, zero), min(found.high, zero))
        return found

    @cached_property
    def live(self) -> Array:
        """States (S,) in which episodes act, without those from which nothing is ever paid again."""
        if self.is_discounted:
            return self.model.acting
        found = np.zeros(self.model.n_states, np.bool_)
        found[self.paying_first] = True
        return self.model.acting & found

    @cached_property
    def paying_first(self) -> Array:
        """Indices of the states from which something may still be paid, by their number of steps to that, the least first."""
        pays = self.only.R != 0
        if not self.is_signed and self.only.rounding.terms > 1:  # outcomes of both signs may cancel
            pays = np.ones_like(pays)
        return nearest_first(self.only.P, pays.reshape(self.shape).any(axis=0))

    def q_values(self, shift: Fraction = Fraction(0)) -> Bound:
        """Return Q (A, S) of the best policy, for the reward plus a constant."""
        if not shift:
            return self.backup(0, self.stationary_values())
        lowest = self.only.rounding.lowest - float(abs(shift))
        highest = self.only.rounding.highest + float(abs(shift))
        return InfiniteHorizon(self.model.with_reward(self.only.R + float(shift), lowest, highest)).q_values()

    @QUIET
    def stationary_values(self) -> Bound:
        """Return the largest values (S,)."""
        live = self.live
        candidate = self._policy_iteration(self.only.R.reshape(self.shape), live)
        weight = self._weight(live)
        later = self.top(self._expected(weight, self.model.discount))
        return self._contracted(candidate, lambda V: self.top(self.backup(0, V)), weight, later, live)

    def _weight(self, live: Array) -> Array:
        """Return w (S,): without a discount, the expected number of so many steps that another one adds at most 0.1; so much is
        w - P w below 1.

        Where steps end about as probably in all states, 1 is as good: no w can be smaller than 1 / (1 - p) everywhere, for the
        least p.
        """
        weight = live.astype(np.float64)
        if self.is_discounted:
            return np.ones_like(weight)
        p = self.top(self._expected(weight, 1.0)).value[live]  # the largest probability to go on
        if 1 - p.max(initial=0.0) >= 0.9 * (1 - p.min(initial=1.0)):
            return weight
        return self._policy_iteration(np.ones(self.shape), live, enough=0.1)

    def _policy_iteration(self, reward: Array, live: Array, enough: float = 0.0) -> Array:
        P = self.only.P
        states = np.arange(self.model.n_states)
        discount = self.model.discount

        def q_values(V: Array) -> Array:
            return self.model.among_legal(np.where(live, reward + discount * (P @ V).reshape(self.shape), 0.0), -np.inf)

        if np.count_nonzero(live) > DIRECT:
            if P.nnz > COMPILED and is_installed("numba"):
                return self._compiled_values(reward, live, enough)
            value = fixed_point(lambda V: q_values(V).max(axis=0), np.zeros(len(states)), P.nnz, enough)
            if not np.isfinite(value).all():
                refuse(UNENDING, HINT)
            return value
        choice = self.model.among_legal(reward, -np.inf).argmax(axis=0)
        for _ in range(ROUNDS):
            value = chain_values(discount * P[choice * len(states) + states], reward[choice, states], live)
            q = q_values(value)
            top = q.max(axis=0)
            now = q[choice, states]
            better = np.where(top > now + 1e-13 * (np.abs(top) + np.abs(now)), q.argmax(axis=0), choice)
            if (better == choice).all():
                break
            choice = better
        return value

    def _compiled_values(self, reward: Array, live: Array, enough: float) -> Array:
        """Return values by substitution in compiled sweeps; those of states that are not live are 0.

        Each sweep goes from the rewards backwards and uses the values that it has just found, so that one sweep carries a
        reward to all states (P. Dai and E. Hansen, Prioritizing Bellman backups without a priority queue, ICAPS 2007).
        """
        from taskspec.exact.solve.kernels_numba import largest_fixed_point

        states = self.model.n_states
        unpaid = live.copy()
        unpaid[self.paying_first] = False
        order = np.append(self.paying_first[live[self.paying_first]], np.flatnonzero(unpaid))
        rows = np.add.outer(order, states * np.arange(len(reward))).reshape(-1)
        place = np.full(states, len(order), np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        P = self.only.P[rows]
        paid = self.model.among_legal(reward, -np.inf).T[order]
        most = int(RATE * limits().seconds) // self.only.P.nnz + 1

        def is_over(gap: float, before: float, value: Array) -> bool:
            return gap <= enough or is_fixed(gap, before, value)

        found = largest_fixed_point((P.indptr, place[P.indices], P.data), paid, self.model.discount, most, is_over)
        if not np.isfinite(found).all():
            refuse(UNENDING, HINT)
        value = np.zeros(states)
        value[order] = found
        return value

    @QUIET
    def soft_q_values(self, beta: float) -> Bound:
        """Return Q (A, S) of the causal maximum-entropy policy.

        The candidate is found by policy iteration: the return of the policy of the values, and its entropy.
        """
        live = self.model.acting
        weight = self._weight(live)
        value = np.zeros(self.model.n_states)
        for _ in range(ROUNDS):
            policy = self.boltzmann(self.backup(0, Bound(value)), beta)
            pi = policy.table
            gain = (pi * (self.only.R.reshape(self.shape) - np.log(np.maximum(pi, 1e-300)) / beta)).sum(axis=0)
            better = chain_values(self.model.discount * followed(self.only.P, pi), gain, live)
            gap = float(np.max(np.abs(better - value)))
            value = better
            if gap <= 1e-15 * float(np.max(np.abs(value))) or not np.isfinite(gap):
                break
        later = self.top(self._expected(weight, self.model.discount))
        found = self._contracted(value, lambda V: self.soft(self.backup(0, V), beta), weight, later, live)
        return self.backup(0, found)
