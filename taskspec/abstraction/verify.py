"""Verify that an abstraction is faithful: by a proof over all of its steps, or by tests on episodes of the task.

It is proved if the task can be rewritten over the mapped state (`factor`), or is finite itself, and then agrees with the
stand-in in every state, for every action, in the probability of every outcome. Otherwise episodes are compared with it.
"""

from __future__ import annotations

import math
import operator
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.abstraction.abstraction import Abstraction, in_words
from taskspec.abstraction.factor import Unfactored, factored
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Node, Read, Role, draws, reads
from taskspec.lang.types import Refused
from taskspec.lang.variates.entry import once
from taskspec.model.extract import extract
from taskspec.model.model import Model
from taskspec.model.space import Reads, entries_of
from taskspec.model.transitions import TIME, Steps, count, is_finite, joint_outcomes, merge_outcomes, total
from taskspec.rollout.rollout import Choose, Moved, Rollout, at_random, by_expert, is_bounded, reads_of, sampled_actions
from taskspec.solve.enclosure import Inexact, Reader
from taskspec.solve.rational import ExactProbabilities
from taskspec.task.parts import Component

STARTS = 4096
LANES = 512
FEWEST = 32
STEPS = 200_000
"""The most and the fewest episodes, and the steps of all of them together."""
LONGEST = 2000
"""Steps of an episode that are compared."""
SIGMAS = 6.0
"""Standard deviations that a count may be from its expectation."""


@dataclass(frozen=True)
class AbstractionCheck:
    """The result of the verification of an abstraction.

    Args:
        episodes: on which it was tested; 0 if it is proved.
        expert_episodes: the same for its expert.
        why: the reason for which there is no proof.
        problem: a difference from the task; None if none was found.
    """

    episodes: int = 0
    expert_episodes: int = 0
    why: str = ""
    problem: str | None = None

    @property
    def is_proved(self) -> bool:
        return self.problem is None and not self.episodes


def verify(found: Abstraction, seed: int = 0) -> AbstractionCheck:
    """Prove an abstraction, or test it."""
    try:
        return _proof(found, seed)
    except (Unfactored, Uncompared, Refused) as error:
        why = str(error)
    except SpecError as error:
        why = error.diagnostics[0].message
    stand_in = found.stand_in
    for draw in draws(
        (*stand_in.process.initial, *stand_in.process.next, stand_in.process.reward, stand_in.process.terminal)
    ):
        if not is_finite(draw):
            infinite = f"it draws from a {draw.base} distribution, which has infinitely many outcomes"
            return AbstractionCheck(why=why, problem=infinite)
    test = _Test(found, seed)
    problem = test.starts()
    if problem is not None:
        return AbstractionCheck(STARTS, STARTS, why, problem)
    problem = test.steps() or test.expert()
    return AbstractionCheck(test.episodes, test.episodes, why, problem)


def _proof(found: Abstraction, seed: int) -> AbstractionCheck:
    """Return the result of a proof; an expert that depends on more than the mapped state is tested."""
    if found.task.is_finite:
        task = found.task
        nodes = found.nodes
    else:
        task = factored(found)
        nodes = tuple(Read(Role.STATE, c.name, c.type, c.least, c.most) for c in task.state)
    whole = extract(task, True, MOST_ENTRIES)
    other = extract(found.stand_in, True, MOST_ENTRIES)
    has_expert = isinstance(task.annotations.expert, tuple)
    problem = difference(whole, nodes, other, has_expert and isinstance(found.stand_in.annotations.expert, tuple))
    if problem is not None or has_expert or not isinstance(found.task.annotations.expert, tuple):
        return AbstractionCheck(problem=problem)
    test = _Test(found, seed)
    problem = test.expert()
    return AbstractionCheck(0, test.lanes, "the expert depends on more than the mapped state", problem)


# -- tests --------------------------------------------------------------------------------------------------------


class _Tally:
    """Observed and expected counts of each of several outcomes."""

    def __init__(self) -> None:
        self.counts: dict[tuple[int, int], Array] = {}  # observed, expected, variance

    def add(self, number: Array, count: Array, seen: Array, p: Array) -> None:
        """Count outcomes by their number among all of a step.

        Args:
            number, count, seen, p: the number of each outcome, the number of outcomes of its step, its share of what was
                observed, and its probability; all (N,).
        """
        kinds, at = np.unique(np.stack([number + 1, count]), axis=1, return_inverse=True)
        columns = [np.bincount(at.reshape(-1), column, kinds.shape[1]) for column in (seen, p, p * (1 - p))]
        for kind, totals in zip(kinds.T.tolist(), np.stack(columns, axis=1), strict=True):
            self.counts[tuple(kind)] = self.counts.get(tuple(kind), np.zeros(3)) + totals

    def problem(self) -> str | None:
        """Return an outcome whose count is too far from its expectation, or None."""
        for (number, size), (seen, expected, variance) in self.counts.items():
            if abs(seen - expected) > SIGMAS * math.sqrt(max(variance, 0.0)) + SIGMAS:
                which = f"number {number} of {size} outcomes"
                return f"{which} was seen {seen:.0f} times, where {expected:.0f} are expected"
        return None


class _Test:
    """Episodes of the task, each step of which is compared with the outcomes of the stand-in; each method gives a problem."""

    def __init__(self, found: Abstraction, seed: int) -> None:
        self.found = found
        self.seed = seed
        self.task = found.task
        self.stand_in = found.stand_in
        self.last = min(found.task.horizon or LONGEST, LONGEST)
        self.lanes = max(FEWEST, min(LANES, STEPS // self.last))
        self.episodes = 0

    def starts(self) -> str | None:
        mapped = self.found.map(Rollout(self.task, STARTS, self.seed).start())
        rows, lanes, counts = np.unique(_rows(mapped.values()), axis=0, return_index=True, return_counts=True)
        expected: dict[tuple[Any, ...], float] = defaultdict(float)
        for values, _, weight in joint_outcomes(self.stand_in.process.initial, {}, 1):
            for row, p in zip(_rows(values).tolist(), weight.tolist(), strict=True):
                expected[tuple(row)] += p
        for row, lane, seen in zip(rows.tolist(), lanes, counts, strict=True):
            p = expected.get(tuple(row), 0.0)
            spread = SIGMAS * math.sqrt(STARTS * max(0.0, p * (1 - p))) + SIGMAS * (p > 0)
            if abs(seen - STARTS * p) > spread:
                state = in_words(self.stand_in.state, mapped, lane)
                return f"{seen} of {STARTS} episodes start in {state}, where {STARTS * p:.0f} are expected"
        return None

    def steps(self) -> str | None:
        """Compare steps of random actions, and of the expert."""
        tally = _Tally()
        chosen = [at_random(self.task) if is_bounded(self.task) else sampled_actions(self.task)]
        if isinstance(self.task.annotations.expert, tuple):
            chosen.append(by_expert(self.task))
        for choose in chosen:
            seed = self.seed + self.episodes
            self.episodes += self.lanes
            for t, state, action, moved in self._walk(choose, seed):
                problem = self._step(t, state, action, moved, tally)
                if problem is not None:
                    return problem
        return tally.problem()

    def _step(
        self, t: int, state: Mapping[str, Array], action: Mapping[str, Array], moved: Moved, tally: _Tally
    ) -> str | None:
        stand_in = self.stand_in
        here = self.found.map(state)
        there = self.found.map(moved.state)

        def agrees(values: Sequence[Array], at: Array) -> Array:
            *following, paid, ended = values
            same = np.isclose(paid, moved.reward[at], rtol=1e-9, atol=1e-9) & (ended == moved.terminal[at])
            return np.asarray(same & _are_equal(stand_in.state, following, there, at))

        nodes = (*stand_in.process.next, stand_in.process.reward, stand_in.process.terminal)
        lane = _unexplained(nodes, reads_of(here, action, t), self.lanes, agrees, tally)
        if lane is None:
            return None
        where = in_words(stand_in.state, here, lane)
        did = in_words(self.task.action, action, lane)
        return f"from {where} with {did} it gives another reward, end or next state than the task does"

    def expert(self) -> str | None:
        """Compare the actions of the expert of the stand-in, if both have one."""
        nodes = self.stand_in.annotations.expert
        if not isinstance(self.task.annotations.expert, tuple) or not isinstance(nodes, tuple):
            return None
        tally = _Tally()
        for t, state, action, _ in self._walk(by_expert(self.task), self.seed):
            here = self.found.map(state)

            def agrees(values: Sequence[Array], at: Array, action: Mapping[str, Array] = action) -> Array:
                return _are_equal(self.task.action, values, action, at)

            lane = _unexplained(nodes, reads_of(here, {}, t), self.lanes, agrees, tally)
            if lane is not None:
                return f"in {in_words(self.stand_in.state, here, lane)} its expert does not act as the task's does"
        return tally.problem()

    def _walk(self, choose: Choose, seed: int) -> Iterator[tuple[int, Mapping[str, Array], Mapping[str, Array], Moved]]:
        rollout = Rollout(self.task, self.lanes, seed)
        rng = np.random.default_rng(seed)
        state = rollout.start()
        for t in range(self.last):
            action = choose(state, t, rng)
            moved = rollout.step(state, action, t)
            yield t, state, action, moved
            state = {n: np.where(moved.terminal, state[n], moved.state[n]) for n in state}


def _unexplained(
    nodes: Sequence[Node], reads: Reads, lanes: int, agrees: Callable[[Sequence[Array], Array], Array], tally: _Tally
) -> int | None:
    """Return a lane in which no outcome of some nodes agrees with what was seen; count the outcomes if there is none."""
    parts = [(at, weight, agrees(values, at)) for values, at, weight in joint_outcomes(nodes, reads, lanes)]
    at, weight, same = (np.concatenate(part) for part in zip(*parts, strict=True))
    explained = np.bincount(at[same], weight[same], lanes)
    if (explained == 0).any():
        return int(np.flatnonzero(explained == 0)[0])
    order = np.argsort(at, kind="stable")
    first = np.searchsorted(at[order], np.arange(lanes))
    number = np.empty(len(at), np.int64)  # of an outcome among those of its lane
    number[order] = np.arange(len(at)) - first[at[order]]
    share = np.where(same, weight / explained[at], 0.0)
    count = np.bincount(at, minlength=lanes)[at]
    random = count > 1
    if random.any():
        tally.add(number[random], count[random], share[random], weight[random])
    return None


def _are_equal(
    components: Sequence[Component], values: Sequence[Array], others: Mapping[str, Array], at: Array
) -> Array:
    """Return where (N,) all components have the values of the lanes."""
    same = np.ones(len(at), np.bool_)
    for c, value in zip(components, values, strict=True):
        same &= (value == others[c.name][..., at]).reshape(-1, len(at)).all(axis=0)
    return same


def _rows(values: Iterable[Array]) -> Array:
    """Return all elements of a state as integers (lanes, elements)."""
    return np.concatenate([v.reshape(-1, v.shape[-1]).astype(np.int64) for v in values]).T


MOST = 400_000
"""Outcomes of all steps together up to which models are compared."""
MOST_ENTRIES = 2_000_000


class Uncompared(Exception):
    """The models could not be compared: a few words that say why."""


def difference(
    whole: Model, nodes: Sequence[Node], other: Model, with_expert: bool, as_paid: bool = False
) -> str | None:
    """Return a difference between a model and the one that its states are mapped to; None if there is none.

    Args:
        nodes: the mapped state, as expressions over the state of the first model.
        with_expert: whether the experts, given by expressions, are compared as well.
        as_paid: whether the distributions of rewards have to be the same, instead of their expectations.
    """
    try:
        return _Comparison(whole, nodes, other, as_paid).found(with_expert)
    except Inexact:
        raise Uncompared("probabilities are no rational numbers") from None


class _Comparison:
    """Two models with their steps; `mapped` has the index of each state (S,) in the other one, -1 if it has none."""

    def __init__(self, whole: Model, nodes: Sequence[Node], other: Model, as_paid: bool) -> None:
        self.whole = whole
        self.other = other
        self.steps = Steps(whole.task, as_paid)
        self.other_steps = Steps(other.task, as_paid)
        self.numbers = ExactProbabilities(Reader())
        codes, outside = other.states.encode(evaluate(nodes, whole.reads()), whole.n_states)
        index = np.minimum(np.searchsorted(other.codes, codes), other.n_states - 1)
        missing = other.codes[index] != codes
        if outside is not None:
            missing |= outside
        self.mapped = np.where(missing, -1, index)

    def found(self, with_expert: bool) -> str | None:
        is_timed = self.steps.uses_time or self.other_steps.uses_time
        times = (self.whole.horizon or 1) if is_timed else 1
        for model, steps in ((self.whole, self.steps), (self.other, self.other_steps)):
            if model.n_states * model.n_actions * steps.branching * times > MOST:
                raise Uncompared("there are too many steps to compare")
        nowhere = (self.mapped < 0) & self.whole.entered
        if nowhere.any():
            state = self.whole.state_name(int(np.flatnonzero(nowhere)[0]))
            return f"{state} is mapped to a state that the abstraction is never in"
        problem = self._starts() or self._steps(is_timed)
        if problem is None and with_expert:
            problem = self._experts()
        return problem

    def _starts(self) -> str | None:
        codes, weight = self.steps.starts(self.numbers)
        other_codes, other_weight = self.other_steps.starts(self.numbers)
        states = self.mapped[np.searchsorted(self.whole.codes, codes)]
        other_states = np.searchsorted(self.other.codes, other_codes)
        p = total(states, weight, self.other.n_states)
        q = total(other_states, other_weight, self.other.n_states)
        wrong = np.flatnonzero(p != q)
        if not len(wrong):
            return None
        state = int(wrong[0])
        odds = f"probability {float(p[state]):.6g}, and {float(q[state]):.6g} in the abstraction"
        return f"episodes start in {self.other.state_name(state)} with {odds}"

    def _steps(self, is_timed: bool) -> str | None:
        whole = self.whole
        for t, acting in self._levels(is_timed):
            own = _of_steps(whole, self.steps, self.mapped, t, self.numbers)
            others = _of_steps(self.other, self.other_steps, np.arange(self.other.n_states), t, self.numbers)
            rows = np.flatnonzero(np.tile(acting, whole.n_actions))
            action, state = np.divmod(rows, whole.n_states)
            row = own.differs(others, rows, action * self.other.n_states + self.mapped[state])
            if row is not None:
                a, s = divmod(row, whole.n_states)
                at = f" at t = {t}" if is_timed else ""
                where = f"in {whole.state_name(s)} with {whole.action_name(a)}{at}"
                return f"{where} it gives another reward, end or next state, or with another probability"
        return None

    def _experts(self) -> str | None:
        nodes = [node for model in (self.whole, self.other) for node in _expert(model)]
        for t, acting in self._levels(TIME in reads(nodes)):
            own = _of_expert(self.whole, t, self.numbers)
            others = _of_expert(self.other, t, self.numbers)
            rows = np.flatnonzero(acting)
            state = own.differs(others, rows, self.mapped[rows])
            if state is not None:
                return f"in {self.whole.state_name(state)} the experts act in different ways"
        return None

    def _levels(self, is_timed: bool) -> Iterator[tuple[int, Array]]:
        """Return times, and the states (S,) in which episodes act then; a single time if the time does not matter."""
        if is_timed:
            return self.whole.levels()
        return iter([(0, self.whole.acting)])


@dataclass(frozen=True)
class _Rows:
    """Outcomes of each row a*S + s: (mapped) next states, terminations, rewards, in order, and their probabilities.

    Entries `first[r]` to `first[r + 1]` belong to row r. For experts, rows are states, and `to` are actions.
    """

    first: Array
    to: Array
    ends: Array
    reward: Array
    weight: Array

    @classmethod
    def merged(cls, row: Array, to: Array, ends: Array, reward: Array, weight: Array, rows: int) -> _Rows:
        (row, to, ends, reward), weight = merge_outcomes((row, to, ends, reward), weight)
        return cls(np.searchsorted(row, np.arange(rows + 1)), to, ends, reward, weight)

    def differs(self, others: _Rows, rows: Array, theirs: Array) -> int | None:
        """Return the first of some rows whose outcomes differ from those of a row of others."""
        counts = np.diff(self.first)[rows]
        apart = counts != np.diff(others.first)[theirs]
        if not apart.any():
            own = entries_of(self.first[rows], counts)
            other = entries_of(others.first[theirs], counts)
            wrong = np.zeros(len(own), np.bool_)
            for name in ("to", "ends", "reward", "weight"):
                wrong |= once(operator.ne, getattr(self, name)[own], getattr(others, name)[other]).astype(np.bool_)
            apart = np.bincount(np.repeat(np.arange(len(rows)), counts), wrong, len(rows)) > 0
        if apart.any():
            return int(rows[np.flatnonzero(apart)[0]])
        return None


def _of_steps(model: Model, steps: Steps, mapped: Array, t: int, numbers: ExactProbabilities) -> _Rows:
    found = steps.table(model.codes, t, numbers)
    rows = model.n_states * model.n_actions
    return _Rows.merged(found.row, mapped[found.column], found.ends, found.reward, found.weight, rows)


def _of_expert(model: Model, t: int, numbers: ExactProbabilities) -> _Rows:
    nodes = _expert(model)
    if count(draws(nodes), {}) > MOST:
        raise Uncompared("the expert draws from too many outcomes")
    states = []
    actions = []
    weights = []
    for values, at, weight in joint_outcomes(nodes, model.reads(t), model.n_states, numbers):
        states.append(at)
        actions.append(model.actions.encode(values, len(at))[0])
        weights.append(weight)
    state = np.concatenate(states)
    none = np.zeros(len(state))
    return _Rows.merged(state, np.concatenate(actions), none, none, np.concatenate(weights), model.n_states)


def _expert(model: Model) -> tuple[Any, ...]:
    assert isinstance(model.task.annotations.expert, tuple)
    return model.task.annotations.expert
