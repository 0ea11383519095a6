"""Whether an abstraction is faithful: proved by looking at every step of it, or tested by episodes beside it."""

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

# ---------- trials
# Episodes of a task beside the finite stand-in that an abstraction gives it: does it do what they do, as often?

State = dict[str, Array]
STARTS = 4096
LANES, FEWEST, STEPS = 512, 32, 200_000
"""Episodes that are run side by side, at least, and steps of all together that are looked at."""
LONGEST = 2000
SIGMAS = 6.0


def endless_draw(task: Task) -> str | None:
    """What of a stand-in has endlessly many outcomes, so that none can be found among them."""
    for draw in draws((*task.initial, *task.next, task.reward, task.terminal)):
        if not is_finite(draw):
            return f"it draws from a {draw.base} distribution, which has infinitely many outcomes"
    return None


class _Tally:
    """How often each of several outcomes happened, and how often it was expected to."""

    def __init__(self) -> None:
        self.known: dict[tuple[int, int], Array] = {}  # seen, expected, variance

    def add(self, number: Array, count: Array, seen: Array, chance: Array) -> None:
        """Outcomes by their number among so many of a step: how much each was seen, and its probability."""
        key = number * (int(count.max(initial=0)) + 1) + count
        for k in np.unique(key).tolist():
            here = key == k
            p = chance[here]
            total = np.array([seen[here].sum(), p.sum(), (p * (1 - p)).sum()])
            name = (int(number[here][0]) + 1, int(count[here][0]))
            self.known[name] = self.known.get(name, np.zeros(3)) + total

    def surprising(self) -> str | None:
        """What differs from its expectation by more than chance makes likely."""
        for (number, count), (seen, expected, variance) in self.known.items():
            if abs(seen - expected) > SIGMAS * math.sqrt(max(variance, 0.0)) + SIGMAS:
                return (
                    f"number {number} of {count} outcomes was seen {seen:.0f} times, where {expected:.0f} are expected"
                )
        return None


class Simulation:
    """Episodes of the task, each step of which is compared with what the stand-in would do."""

    def __init__(self, found: Abstraction, seed: int) -> None:
        self.found, self.seed, self.task, self.stand_in = found, seed, found.task, found.stand_in
        self.last = min(found.task.horizon or LONGEST, LONGEST)
        self.lanes = max(FEWEST, min(LANES, STEPS // self.last))

    def starts(self) -> tuple[str | None, int] | None:
        """A problem with where episodes start, or None."""
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
        """A problem with steps, or None; and how many episodes were looked at."""
        tally, episodes = _Tally(), 0
        for i, choose in enumerate(self.choosers()):
            episodes += self.lanes
            for t, state, action, moved in self._walk(choose, self.seed + i * self.lanes):
                here, there = self.found.map(state), self.found.map(moved.state)
                problem = self._compare(t, here, action, there, moved, tally)
                if problem is not None:
                    return problem, episodes
        return tally.surprising(), episodes

    def _walk(self, choose: Choose, seed: int) -> Iterator[tuple[int, State, Any, Moved]]:
        rollout, rng = Rollout(self.task, self.lanes, seed), np.random.default_rng(seed)
        state = rollout.start()
        for t in range(self.last):
            action = choose(state, t, rng)
            moved = rollout.step(state, action, t)
            yield t, state, action, moved
            state = {n: np.where(moved.terminal, state[n], moved.state[n]) for n in state}

    def _compare(self, t: int, here: State, action: Any, there: State, moved: Moved, tally: _Tally) -> str | None:
        """Whether some outcome of the stand-in agrees with what happened, in every lane; each outcome is counted."""
        task = self.stand_in
        roots, reads = (*task.next, task.reward, task.terminal), reads_of(here, action, t)

        def agrees(values: Sequence[Array], at: Array) -> Array:
            *following, paid, ended = values
            same = np.isclose(paid, moved.reward[at], rtol=1e-9, atol=1e-9) & (ended == moved.terminal[at])
            return np.asarray(same & _all_equal(task.state, following, there, at))

        where = self._unexplained(_outcomes(roots, reads, self.lanes, agrees), here, tally)
        if where is None:
            return None
        row, lane = where
        did = ", ".join(f"{c.name} = {shown(c, action[c.name][..., lane])}" for c in self.task.action)
        return f"from {row} with {did} it gives another reward, end or next state than the task does"

    def _unexplained(self, found: _Outcomes, here: State, tally: _Tally) -> tuple[str, int] | None:
        """A state, and its lane, where no outcome agrees; outcomes that do are counted."""
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
        """A problem with what the expert of the stand-in does, or None; and how many episodes were looked at."""
        mine, others = self.task.expert, self.stand_in.expert
        if not isinstance(mine, tuple) or not isinstance(others, tuple):
            return None, self.lanes
        tally, expert = _Tally(), by_expert(self.task)
        for t, state, action, _ in self._walk(expert, self.seed):
            problem = self._acting(t, self.found.map(state), action, others, tally)
            if problem is not None:
                return problem, self.lanes
        return tally.surprising(), self.lanes

    def _acting(self, t: int, here: State, action: Any, nodes: Sequence[Node], tally: _Tally) -> str | None:
        def agrees(values: Sequence[Array], at: Array) -> Array:
            return _all_equal(self.task.action, values, action, at)

        where = self._unexplained(_outcomes(nodes, reads_of(here, {}, t), self.lanes, agrees), here, tally)
        return None if where is None else f"in {where[0]} its expert does not act as the task's does"


@dataclass(frozen=True)
class _Outcomes:
    """Outcomes of all lanes: the lane of each, its probability, and whether it agrees with what happened; all (N,)."""

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
    """Where (N,) all components have the values of the lanes."""
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
    """All elements of a state as numbers, (lanes, elements)."""
    return np.concatenate([v.reshape(-1, v.shape[-1]).astype(np.int64) for v in state.values()]).T


def _describe(task: Task, row: Array) -> str:
    words, at = [], 0
    for c in task.state:
        value = row[at : at + c.type.size].reshape(c.type.shape)
        words.append(f"{c.name} = {shown(c, value)}")
        at += c.type.size
    return ", ".join(words)


# ---------- faith
# Whether an abstraction is faithful: proved by looking at every step of it, or tested on episodes of the task.
#
# It is proved where the task can be rewritten over the mapped state (`homomorphism.factor`), or is finite itself, and then
# agrees with the stand-in in every state, for every action, in the probability of every outcome. Elsewhere episodes are
# compared with it; what rests on such an abstraction is tested, and no more.


@dataclass(frozen=True)
class Faith:
    """What is known of an abstraction.

    `problem` says where it differs from the task (None: nowhere that was looked at). Otherwise it is proved where
    `episodes` is 0, and was tested on that many; `expert_episodes` is the same for its expert. `why` says what stood in
    the way of a proof.
    """

    episodes: int = 0
    expert_episodes: int = 0
    why: str = ""
    problem: str | None = None

    @property
    def is_proved(self) -> bool:
        return self.problem is None and not self.episodes


def examined(found: Abstraction, seed: int = 0) -> Faith:
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
    return Faith(0, episodes, proof.why, problem)


def unfaithful(found: Abstraction, faith: Faith | None = None) -> Diagnostic | None:
    """What is wrong with an abstraction, or None."""
    problem = (faith or examined(found)).problem
    if problem is None:
        return None
    expr = next(iter(found.task.surface.sections["abstraction"].values()))
    return Diagnostic("E604", expr.place.span, f"the abstraction is not faithful: {problem}")


def _proof(found: Abstraction) -> Faith:
    """`why` says why the expert is not part of the proof."""
    if found.task.is_finite:
        task, nodes, has_expert = found.task, found.nodes, isinstance(found.task.expert, tuple)
    else:
        result = factored(found)
        task, has_expert = result.task, result.has_expert
        nodes = tuple(_read(c) for c in task.state)
    wrong = difference(task, nodes, found.stand_in, has_expert and isinstance(found.stand_in.expert, tuple))
    if wrong is not None:
        return Faith(problem=wrong)
    return Faith(why="" if has_expert else "the expert depends on more than the mapped state")


def _read(c: Component) -> Node:
    return Read(Role.STATE, c.name, c.type, c.least, c.most)


def _tested(found: Abstraction, seed: int, why: str) -> Faith:
    endless = endless_draw(found.stand_in)
    if endless is not None:
        return Faith(why=why, problem=endless)
    simulation = Simulation(found, seed)
    problem, episodes = simulation.starts() or simulation.steps()
    if problem is None and isinstance(found.task.expert, tuple):
        problem, _ = simulation.experts()
    return Faith(episodes, episodes, why, problem)
