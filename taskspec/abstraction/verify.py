"""Verify that an abstraction is faithful: by a proof over all of its steps, or by tests on episodes of the task.

It is proved if the task can be rewritten over the mapped state (`factor`), or is finite itself, and then agrees with the
stand-in in every state, for every action, in the probability of every outcome (`homomorphism`). Otherwise episodes are
compared with it.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.abstraction.abstraction import Abstraction
from taskspec.abstraction.factor import Unfactored, factored
from taskspec.abstraction.homomorphism import Uncompared, difference
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.lang.ir import Node, Read, Role, draws
from taskspec.lang.types import Refused
from taskspec.model.space import Reads, shown
from taskspec.model.transitions import is_finite, joint_outcomes
from taskspec.rollout.rollout import Choose, Moved, Rollout, at_random, by_expert, is_bounded, reads_of, sampled_actions
from taskspec.task.task import Component, Task

State = dict[str, Array]
STARTS = 4096
LANES = 512
FEWEST = 32
STEPS = 200_000
"""The most and the fewest episodes, and the steps of all of them together."""
LONGEST = 2000
"""Steps of an episode that are compared."""
SIGMAS = 6.0
"""Standard deviations that a count may be from its expectation."""


def infinite_draw(task: Task) -> str | None:
    """Return the problem with a stand-in that has infinitely many outcomes, or None."""
    for draw in draws((*task.initial, *task.next, task.reward, task.terminal)):
        if not is_finite(draw):
            return f"it draws from a {draw.base} distribution, which has infinitely many outcomes"
    return None


class _Tally:
    """Observed and expected counts of each of several outcomes."""

    def __init__(self) -> None:
        self.counts: dict[tuple[int, int], Array] = {}  # observed, expected, variance

    def add(self, number: Array, count: Array, seen: Array, chance: Array) -> None:
        """Count outcomes by their number among all of a step.

        Args:
            number, count, seen, chance: the number of each outcome, the number of outcomes of its step, its share of what was
                observed, and its probability; all (N,).
        """
        key = number * (int(count.max(initial=0)) + 1) + count
        for k in np.unique(key).tolist():
            here = key == k
            p = chance[here]
            total = np.array([seen[here].sum(), p.sum(), (p * (1 - p)).sum()])
            name = (int(number[here][0]) + 1, int(count[here][0]))
            self.counts[name] = self.counts.get(name, np.zeros(3)) + total

    def problem(self) -> str | None:
        """Return an outcome whose count is too far from its expectation, or None."""
        for (number, count), (seen, expected, variance) in self.counts.items():
            if abs(seen - expected) > SIGMAS * math.sqrt(max(variance, 0.0)) + SIGMAS:
                return (
                    f"number {number} of {count} outcomes was seen {seen:.0f} times, where {expected:.0f} are expected"
                )
        return None


class Simulation:
    """Episodes of the task, each step of which is compared with the outcomes of the stand-in."""

    def __init__(self, found: Abstraction, seed: int) -> None:
        self.found = found
        self.seed = seed
        self.task = found.task
        self.stand_in = found.stand_in
        self.last = min(found.task.horizon or LONGEST, LONGEST)
        self.lanes = max(FEWEST, min(LANES, STEPS // self.last))

    def starts(self) -> tuple[str | None, int] | None:
        """Return a problem with the first states, and the number of episodes; or None."""
        mapped = _rows(self.found.map(Rollout(self.task, STARTS, self.seed).start()))
        values, counts = np.unique(mapped, axis=0, return_counts=True)
        expected = _start_distribution(self.stand_in)
        for row, count in zip(values, counts, strict=True):
            p = expected.get(tuple(row.tolist()), 0.0)
            spread = np.sqrt(STARTS * p * (1 - p)) * SIGMAS + 1e-9
            if abs(count - STARTS * p) > spread + (SIGMAS if p else 0):
                state = _describe(self.stand_in, row)
                return f"{count} of {STARTS} episodes start in {state}, where {STARTS * p:.0f} are expected", STARTS
        return None

    def choosers(self) -> Iterator[Choose]:
        yield at_random(self.task) if is_bounded(self.task) else sampled_actions(self.task)
        if isinstance(self.task.expert, tuple):
            yield by_expert(self.task)

    def steps(self) -> tuple[str | None, int]:
        """Return a problem with steps, or None; and the number of episodes."""
        tally = _Tally()
        episodes = 0
        for i, choose in enumerate(self.choosers()):
            episodes += self.lanes
            for t, state, action, moved in self._walk(choose, self.seed + i * self.lanes):
                problem = self._compare(t, state, action, moved, tally)
                if problem is not None:
                    return problem, episodes
        return tally.problem(), episodes

    def _walk(self, choose: Choose, seed: int) -> Iterator[tuple[int, State, Any, Moved]]:
        rollout = Rollout(self.task, self.lanes, seed)
        rng = np.random.default_rng(seed)
        state = rollout.start()
        for t in range(self.last):
            action = choose(state, t, rng)
            moved = rollout.step(state, action, t)
            yield t, state, action, moved
            state = {n: np.where(moved.terminal, state[n], moved.state[n]) for n in state}

    def _compare(self, t: int, state: State, action: Any, moved: Moved, tally: _Tally) -> str | None:
        """Return a lane in which no outcome of the stand-in agrees with the step; otherwise count outcomes."""
        task = self.stand_in
        here = self.found.map(state)
        there = self.found.map(moved.state)
        roots = (*task.next, task.reward, task.terminal)

        def agrees(values: Sequence[Array], at: Array) -> Array:
            *following, paid, ended = values
            same = np.isclose(paid, moved.reward[at], rtol=1e-9, atol=1e-9) & (ended == moved.terminal[at])
            return np.asarray(same & _all_equal(task.state, following, there, at))

        where = self._unexplained(_outcomes(roots, reads_of(here, action, t), self.lanes, agrees), here, tally)
        if where is None:
            return None
        row, lane = where
        did = ", ".join(f"{c.name} = {shown(c, action[c.name][..., lane])}" for c in self.task.action)
        return f"from {row} with {did} it gives another reward, end or next state than the task does"

    def _unexplained(self, found: _Outcomes, here: State, tally: _Tally) -> tuple[str, int] | None:
        """Return a state, and its lane, in which no outcome agrees; count the outcomes that do if there is none."""
        explained = np.bincount(found.at[found.same], found.weight[found.same], self.lanes)
        if (explained == 0).any():
            lane = int(np.flatnonzero(explained == 0)[0])
            row = _rows({c.name: here[c.name] for c in self.stand_in.state})[lane]
            return _describe(self.stand_in, row), lane
        order = np.argsort(found.at, kind="stable")
        first = np.searchsorted(found.at[order], np.arange(self.lanes))
        number = np.empty(len(found.at), np.int64)  # of an outcome among those of its lane
        number[order] = np.arange(len(found.at)) - first[found.at[order]]
        share = np.where(found.same, found.weight / explained[found.at], 0.0)
        count = np.bincount(found.at, minlength=self.lanes)[found.at]
        random = count > 1
        tally.add(number[random], count[random], share[random], found.weight[random])
        return None

    # -- experts ------------------------------------------------------------------------------------------------------

    def experts(self) -> tuple[str | None, int]:
        """Return a problem with the expert of the stand-in, or None; and the number of episodes."""
        nodes = self.stand_in.expert
        if not isinstance(self.task.expert, tuple) or not isinstance(nodes, tuple):
            return None, self.lanes
        tally = _Tally()
        for t, state, action, _ in self._walk(by_expert(self.task), self.seed):
            problem = self._compare_expert(t, self.found.map(state), action, nodes, tally)
            if problem is not None:
                return problem, self.lanes
        return tally.problem(), self.lanes

    def _compare_expert(self, t: int, here: State, action: Any, nodes: Sequence[Node], tally: _Tally) -> str | None:
        def agrees(values: Sequence[Array], at: Array) -> Array:
            return _all_equal(self.task.action, values, action, at)

        where = self._unexplained(_outcomes(nodes, reads_of(here, {}, t), self.lanes, agrees), here, tally)
        return None if where is None else f"in {where[0]} its expert does not act as the task's does"


@dataclass(frozen=True)
class _Outcomes:
    """Outcomes of all lanes: the lane of each, its probability, and whether it agrees with the step; all (N,)."""

    at: Array
    weight: Array
    same: Array


def _outcomes(
    nodes: Sequence[Node], reads: Reads, lanes: int, agrees: Callable[[Sequence[Array], Array], Array]
) -> _Outcomes:
    parts = [(at, weight, agrees(values, at)) for values, at, weight in joint_outcomes(nodes, reads, lanes)]
    at, weight, same = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _Outcomes(at, weight, same)


def _all_equal(
    components: Sequence[Component], values: Sequence[Array], others: Mapping[str, Array], at: Array
) -> Array:
    """Return where (N,) all components have the values of the lanes."""
    same = np.ones(len(at), np.bool_)
    for c, value in zip(components, values, strict=True):
        same &= (value == others[c.name][..., at]).reshape(-1, len(at)).all(axis=0)
    return same


def _start_distribution(task: Task) -> dict[tuple[Any, ...], float]:
    names = [c.name for c in task.state]
    total: dict[tuple[Any, ...], float] = defaultdict(float)
    for values, _, weight in joint_outcomes(task.initial, {}, 1):
        for row, p in zip(_rows(dict(zip(names, values, strict=True))).tolist(), weight.tolist(), strict=True):
            total[tuple(row)] += p
    return total


def _rows(state: State) -> Array:
    """Return all elements of a state as integers (lanes, elements)."""
    return np.concatenate([v.reshape(-1, v.shape[-1]).astype(np.int64) for v in state.values()]).T


def _describe(task: Task, row: Array) -> str:
    words = []
    at = 0
    for c in task.state:
        value = row[at : at + c.type.size].reshape(c.type.shape)
        words.append(f"{c.name} = {shown(c, value)}")
        at += c.type.size
    return ", ".join(words)


# -- verification -----------------------------------------------------------------------------------------------------


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
        proof = _proof(found)
    except (Unfactored, Uncompared, Refused) as error:
        return _tested(found, seed, str(error))
    except SpecError as error:
        return _tested(found, seed, error.diagnostics[0].message)
    if proof.problem is not None or not isinstance(found.task.expert, tuple) or not proof.why:
        return proof
    problem, episodes = Simulation(found, seed).experts()
    return AbstractionCheck(0, episodes, proof.why, problem)


def unfaithful(found: Abstraction, check: AbstractionCheck | None = None) -> Diagnostic | None:
    """Return E604 for an abstraction that is not faithful, or None."""
    problem = (check or verify(found)).problem
    if problem is None:
        return None
    expr = next(iter(found.task.surface.sections["abstraction"].values()))
    return Diagnostic("E604", expr.place.span, f"the abstraction is not faithful: {problem}")


def _proof(found: Abstraction) -> AbstractionCheck:
    """Return the result of a proof; with `why` if the expert is not part of it."""
    if found.task.is_finite:
        task = found.task
        nodes = found.nodes
        has_expert = isinstance(found.task.expert, tuple)
    else:
        result = factored(found)
        task = result.task
        has_expert = result.has_expert
        nodes = tuple(Read(Role.STATE, c.name, c.type, c.least, c.most) for c in task.state)
    wrong = difference(task, nodes, found.stand_in, has_expert and isinstance(found.stand_in.expert, tuple))
    if wrong is not None:
        return AbstractionCheck(problem=wrong)
    return AbstractionCheck(why="" if has_expert else "the expert depends on more than the mapped state")


def _tested(found: Abstraction, seed: int, why: str) -> AbstractionCheck:
    problem = infinite_draw(found.stand_in)
    if problem is not None:
        return AbstractionCheck(why=why, problem=problem)
    simulation = Simulation(found, seed)
    problem, episodes = simulation.starts() or simulation.steps()
    if problem is None and isinstance(found.task.expert, tuple):
        problem, _ = simulation.experts()
    return AbstractionCheck(episodes, episodes, why, problem)
