"""The exact expectation of anything that is computed from episodes: all of them are enumerated with their probabilities."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, product
from typing import Any, NamedTuple

import numpy as np

from taskspec.base.arrays import Array, end_to_end, part_at
from taskspec.base.diagnostics import spec_error
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.model.probabilities import Inexact
from taskspec.exact.policies.state_observations import StateObservations
from taskspec.exact.solve.outcomes import Number, OutcomeLists
from taskspec.language.task.task import TaskLike
from taskspec.tools.oracle.tables import model_of, plain, policy_table
from taskspec.tools.oracle.values import By

COUNTED = 10**15
"""Episodes are counted up to here."""
LARGEST = 1_000_000
"""Transitions of a model whose outcomes are listed one by one."""


@dataclass(frozen=True, eq=False)
class EnumeratedEpisode:
    """One possible episode of L steps, as a rollout buffer holds it, with its probability.

    Attributes:
        probability: of the episode, its first state included.
        states, next_states: int64 (L,), states of the model before and after each step.
        actions: int64 (L,), actions of the model, which a discrete action space counts from its least number.
        rewards: (L,), float64, or fractions in an object array.
        terminated, truncated: bool (L,), as `step` returns them; both are True where the last step of the horizon terminates.
        probabilities: (L, A), the policy's probabilities of all actions before each step.
        observations, next_observations: (L, *shape), as the environment shows them, a dict of arrays for a dict space; None
            where they are drawn.
        discount: gamma of the task.
        rows: for tables by "state" and by "observation", the row int64 (L,) of each step, and the number of rows.
    """

    probability: Any
    states: Array
    actions: Array
    rewards: Array
    next_states: Array
    terminated: Array
    truncated: Array
    probabilities: Array
    observations: Any
    next_observations: Any
    discount: Any
    rows: Mapping[str, tuple[Array, int]]

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def times(self) -> Array:
        """int64 (L,), the number of steps before each step."""
        return np.arange(len(self))

    @property
    def discounts(self) -> Array:
        """(L,), the weights gamma^t of the steps, in the arithmetic of the rewards."""
        return np.array([self.discount**t for t in range(len(self))], dtype=self.rewards.dtype)

    @property
    def action_probabilities(self) -> Array:
        """(L,), the policy's probabilities of the actions that are taken."""
        return np.asarray(self.probabilities[self.times, self.actions])

    @property
    def log_probs(self) -> Array:
        """float64 (L,), their logarithms."""
        return np.log(self.action_probabilities.astype(np.float64))

    @property
    def discounted_return(self) -> Any:
        """The sum of gamma^t times the reward of step t."""
        return (self.discounts * self.rewards).sum()

    def log_prob_gradients(self, by: By = "state") -> Array:
        """Return the gradient of each step's log pi(a | x) with respect to the logits theta[x, a] of a softmax table.

            d log pi(a_t | x_t) / d theta[x, b] = [x = x_t] ([b = a_t] - pi(b | x_t))

        Args:
            by: the rows x: states of the model, or observations.

        Returns:
            (L, S, A) or (L, O, A), in the arithmetic of the probabilities.

        Raises:
            SpecError: E713 for other rows, or observations that are drawn.

        Source: R. Sutton and A. Barto, Reinforcement Learning (2018), equation (13.9) with one-hot features.
        """
        if by not in self.rows:
            misused(f"'{by}' is no kind of row here", '"state", or "observation" where observations are not drawn')
        row, count = self.rows[by]
        gradients = np.zeros((len(self), count, self.probabilities.shape[1]), dtype=self.probabilities.dtype)
        gradients[self.times, row] = -self.probabilities
        gradients[self.times, row, self.actions] += 1
        return gradients


@dataclass(frozen=True)
class Expectation:
    """The exact mean and variance of a function of episodes.

    Attributes:
        mean, variance: numbers, or arrays of the shape of the function's result; the variance of each entry.
        count: how many episodes, or groups of them, were enumerated.
    """

    mean: Any
    variance: Any
    count: int


def expectation(
    function: Callable[..., Any], task: TaskLike, policy: Any, *, episodes: int = 1, same_start: bool = False,
    exact: bool = False,
) -> Expectation:  # fmt: skip
    """Return the exact expectation of a function of episodes: no sampling noise, so that a bias is a number.

        E[f] = sum over tau of Pr(tau) f(tau),    Pr(tau) = p(s_0) prod over t of pi(a_t | s_t) p(s_{t+1}, r_t | s_t, a_t)

    Args:
        function: from one `EnumeratedEpisode` to a number or an array, of the same shape for all; with `episodes=k`, from a
            tuple of k independent ones.
        task: a finite task whose episodes end, its id or its path.
        policy: the policy that acts, as `evaluate` takes it.
        episodes: the size of a group.
        same_start: whether all episodes of a group begin in the same state, as completions of one prompt do.
        exact: in rationals, as for `evaluate`; the result has fractions where the function gives fractions.

    Returns:
        Mean and variance, in the unit of the function.

    Raises:
        SpecError: E729 where there are too many episodes, which are counted before any is enumerated; E713 for a function
            that gives anything else; E712, E713 as for `evaluate`.
    """
    if episodes < 1:
        misused("a group has at least one episode", "episodes=1")
    model = model_of(task)
    tree = _Tree(model, policy_table(model, policy, exact), exact)
    count = tree.checked_count(episodes, same_start)
    mean: Any = 0
    square: Any = 0
    shape = None
    for probability, group in tree.groups(episodes, same_start):
        if episodes == 1:
            value = plain(function(group[0]))
        else:
            value = plain(function(group))
        if shape is None:
            shape = value.shape
        _check_answer(value, shape)
        mean = mean + probability * value
        square = square + probability * value * value
    return Expectation(_tidy(mean), _tidy(square - mean * mean), count)


def _check_answer(value: Array, shape: tuple[int, ...]) -> None:
    if value.dtype.kind in "SU" or (value.dtype == object and None in value.reshape(-1)):
        misused("the function of an episode returns a number or an array of numbers")
    if value.shape != shape:
        hint = "a sum or a mean over the steps, or a table of states"
        misused(f"the function returns shape {shape} for one episode and {value.shape} for another", hint)


def _tidy(value: Any) -> Any:
    """Return an array, or the number that it holds; floats in an object array as float64."""
    array = np.asarray(value)
    if array.dtype == object and any(isinstance(x, float) for x in array.reshape(-1)):
        array = array.astype(np.float64)
    if array.ndim:
        return array
    return array.item()


class _Step(NamedTuple):
    state: int
    action: int
    reward: Number
    next_state: int
    ends: bool


class _Tree:
    """All episodes of a policy (T, S, A): a branch for each action and outcome."""

    def __init__(self, model: Model, pi: Array, exact: bool) -> None:
        if model.entries > LARGEST:
            refuse(f"{model.task.id} has more than {LARGEST:,} transitions: its episodes are not enumerated")
        try:
            self.lists = OutcomeLists(model, exact, as_paid=True)
        except Inexact:
            refuse(f"{model.task.id} draws with irrational probabilities", "take `exact=False`")
        self.model = model
        self.pi = pi
        self.seen = StateObservations(model)
        self.starts = [s for s, probability in enumerate(self.lists.start) if probability]

    def branches(self, t: int, s: int) -> Iterator[tuple[Number, _Step]]:
        """Yield the steps that may follow in a state, with their probabilities."""
        policy = self._policy(t)[s]
        for a in np.flatnonzero(policy).tolist():
            for o in self.lists.at(t).get((s, a), ()):
                yield policy[a] * o.probability, _Step(s, a, o.reward, o.state, o.ends)

    def _policy(self, t: int) -> Array:
        return np.asarray(self.pi[min(t, len(self.pi) - 1)])

    def _is_last(self, t: int, step: _Step) -> bool:
        return step.ends or t + 1 == self.model.horizon

    # -- counting, before anything is enumerated

    def checked_count(self, size: int, same_start: bool) -> int:
        """Return the number of groups of so many episodes; refuse (E729) too many."""
        each = [self.count_from(s) for s in self.starts]
        count: int = sum(each) ** size
        if same_start:
            count = sum(number**size for number in each)
        most = limits().enumerated
        if count <= most:
            return count
        number = count_of(count)
        if max(each) > COUNTED:
            number = f"more than {count_of(COUNTED)}"
        kind = f"groups of {size} episodes" if size > 1 else "episodes"
        hint = how_to_raise("enumerated", count) or "choose a shorter task, or a policy with fewer random actions"
        message = f"{self.model.task.id} has {number} {kind} under this policy; the limit is {most:,}"
        raise spec_error("E729", message, hint)

    def count_from(self, start: int) -> int:
        """Return the number of episodes from a state, by dynamic programming over the states that are reached."""
        paths = {start: 1}
        ended = 0
        t = 0
        while paths and ended + sum(paths.values()) <= COUNTED:
            if self.model.horizon is None and t > self.model.n_states:  # some state is visited again and again
                message = f"{self.model.task.id} has infinitely many episodes under this policy"
                raise spec_error("E729", message, "give the task a horizon")
            after: dict[int, int] = defaultdict(int)
            for s, number in paths.items():
                for _, step in self.branches(t, s):
                    if self._is_last(t, step):
                        ended += number
                    else:
                        after[step.next_state] += number
            paths = after
            t += 1
        return ended + sum(paths.values())

    # -- enumeration

    def groups(self, size: int, same_start: bool) -> Iterator[tuple[Number, tuple[EnumeratedEpisode, ...]]]:
        """Yield all groups of so many independent episodes, with their probabilities."""
        if size == 1:
            for s in self.starts:
                for episode in self.episodes_from(s):
                    yield episode.probability, (episode,)
            return
        each = [list(self.episodes_from(s)) for s in self.starts]
        if not same_start:
            each = [list(chain(*each))]
        for episodes in each:
            p0 = self.lists.start[episodes[0].states[0]] if same_start else 1
            for group in product(episodes, repeat=size):
                yield p0 * math.prod(episode.probability / p0 for episode in group), group

    def episodes_from(self, start: int) -> Iterator[EnumeratedEpisode]:
        """Yield the episodes that begin in a state, depth first."""
        waiting: list[tuple[Number, int, tuple[_Step, ...]]] = [(self.lists.start[start], start, ())]
        while waiting:
            before, s, steps = waiting.pop()
            t = len(steps)
            for probability, step in self.branches(t, s):
                if self._is_last(t, step):
                    yield self._episode(before * probability, (*steps, step))
                else:
                    waiting.append((before * probability, step.next_state, (*steps, step)))

    def _episode(self, probability: Number, steps: tuple[_Step, ...]) -> EnumeratedEpisode:
        columns = [np.array(column) for column in zip(*steps, strict=True)]
        states, actions, rewards, next_states, terminated = columns
        times = np.arange(len(steps))
        truncated = times + 1 == self.model.horizon
        probabilities = np.array([self._policy(t)[s] for t, s in enumerate(states)])
        rows = {"state": (states, self.model.n_states)}
        observations = None
        next_observations = None
        if self.seen.is_known:
            observations = self._shown(times, states)
            next_observations = self._shown(times + 1, next_states)
            last = len(self.seen.rows) - 1
            rows["observation"] = (self.seen.rows[np.minimum(times, last), states], self.seen.count)
        return EnumeratedEpisode(
            probability, states, actions, rewards, next_states, terminated, truncated, probabilities, observations,
            next_observations, self.lists.discount, rows,
        )  # fmt: skip

    def _shown(self, times: Iterable[int], states: Array) -> Any:
        if not self.seen.is_timed:
            return part_at(self.seen.at(0), states)
        shown = []
        for t, s in zip(times, states, strict=True):
            shown.append(part_at(self.seen.at(t), slice(s, s + 1)))
        return end_to_end(shown)
