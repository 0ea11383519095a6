"""Small environments as tables: by their `P`, or by copies of their objects from every state with every action.

Chance is read from `P`, or estimated: where a step draws, it is repeated with other seeds. A table is compared with episodes
before it is used, which shows whether something is not in the object, or depends on the time.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taskspec.base.display import plural
from taskspec.exact.model.extract import tabulated
from taskspec.exact.model.model import Model
from taskspec.tools.audit.snapshot import Place, drawn, place_value, reseed, snapshot
from taskspec.tools.audit.subject import Deadline, EnvEpisode, EnvInstance, EnvStep, Subject, Trace, TracePart, frozen

MOST_STATES = 20_000
STARTS = 300
"""Resets that show first states."""
REPEATS = 100
"""Steps from which the outcomes of a step that draws are estimated."""
ALIKE = 20
"""Steps after which a step that draws counts as certain, if they all did the same."""
Outcome = tuple[int, float, bool]
"""The next state, the reward, and whether the episode ends there."""


class Untabulated(Exception):
    """An environment has no table: a few words that say why."""


@dataclass(eq=False)
class StateTable:
    """An environment as a finite decision process.

    Attributes:
        actions: the values of the actions.
        observations: of each state, in a form that can be compared; `shown` as they were given.
        rows: of each state and action the outcomes with their probabilities; an empty list for states in which no episode acts.
        start: first states with their probabilities.
        traces: how each state was first reached; None for those of `P`.
        drawn: states and actions whose probabilities are estimated.
        is_start_estimated: whether first states are those of some resets.
        declared: the number of states that `P` or the observation space declares.
        states: the numbers of states by their keys, in which what is `ignored` is left out.
        by_time: a state and an action whose reward or end is another one at another time, with an episode that shows it.
    """

    actions: list[Any]
    horizon: int | None
    observations: list[Hashable] = field(default_factory=list)
    shown: list[Any] = field(default_factory=list)
    rows: list[list[dict[Outcome, float]]] = field(default_factory=list)
    start: dict[int, float] = field(default_factory=dict)
    traces: list[Trace | None] = field(default_factory=list)
    drawn: set[tuple[int, int]] = field(default_factory=set)
    is_start_estimated: bool = False
    declared: int | None = None
    by_time: tuple[int, int, Trace] | None = None
    states: dict[Hashable, int] = field(default_factory=dict)
    ignored: frozenset[Place] = frozenset()

    def add(self, key: Hashable, step: EnvStep, trace: Trace | None) -> int:
        """Return the number of a state, which may be new."""
        if key not in self.states:
            self.states[key] = len(self.states)
            self.observations.append(step.seen)
            self.shown.append(step.observation)
            self.rows.append([])
            self.traces.append(trace)
        return self.states[key]

    def ends(self, step: EnvStep, t: int) -> bool:
        """Return whether the step to time t ends the episode by the environment's rules, and not by its time limit."""
        is_late = self.horizon is not None and t >= self.horizon
        return bool(step.terminated or (step.truncated and not is_late))

    @property
    def is_estimated(self) -> bool:
        return bool(self.drawn) or (self.is_start_estimated and len(self.start) > 1)

    def model(self, horizon: int | None) -> Model:
        """Return the table as an exact model; states in which no episode acts stay as they are, and pay nothing."""
        outcomes = []
        for s, by_action in enumerate(self.rows):
            stays: dict[Outcome, float] = {(s, 0.0, False): 1.0}
            for a, row in enumerate(by_action or [stays] * len(self.actions)):
                for (to, reward, ends), p in row.items():
                    outcomes.append((s, a, to, p, reward, ends))
        start = np.zeros(len(self.rows))
        start[list(self.start)] = list(self.start.values())
        return tabulated(outcomes, start, len(self.actions), horizon)


def by_probabilities(subject: Subject, horizon: int | None) -> StateTable | None:
    """Return the table of an environment that has Gymnasium's `P` and `initial_state_distrib`; None without them."""
    env = subject.make().env.unwrapped
    P = getattr(env, "P", None)
    start = getattr(env, "initial_state_distrib", None)
    actions = subject.actions()
    if not isinstance(P, dict) or start is None or actions is None:
        return None
    if not len(P) == len(start) == getattr(subject.observation_space, "n", None):
        return None
    table = StateTable(actions, horizon, declared=len(P))
    for s in range(len(P)):
        table.add(frozen(s), EnvStep(None, s, frozen(s)), None)
        for a in range(len(actions)):
            outcomes: Counter[Outcome] = Counter()
            for p, to, reward, ends in P[s][a]:
                outcomes[int(to), float(reward), bool(ends)] += p
            table.rows[s].append(dict(+outcomes))
    for s, p in enumerate(start):
        if p > 0:
            table.start[s] = float(p)
    return table


class TableSearch:
    """The table of an environment by copies: every action from every state, level by level from the start.

    Args:
        ignored: places that do not belong to the state.
        counters: those of them that count steps.
        until: the end of the time that the search may take.
        deepest: the time from which no actions are tried.

    Raises:
        Untabulated: for too many states, or an environment that cannot be copied and draws.
    """

    def __init__(
        self, subject: Subject, horizon: int | None, ignored: frozenset[Place], counters: frozenset[Place],
        until: Deadline, deepest: float,
    ) -> None:  # fmt: skip
        actions = subject.actions()
        if actions is None:
            raise Untabulated("its actions are not finitely many")
        self.subject = subject
        self.ignored = ignored
        self.counters = counters & ignored
        self.until = until
        self.table = StateTable(actions, horizon, is_start_estimated=True, ignored=ignored)
        self.deepest = deepest
        self.waiting: deque[tuple[int, int, EnvInstance | None, Trace]] = deque()
        self.listed: set[int] = set()

    def run(self) -> StateTable:
        starts: Counter[int] = Counter()
        for seed in range(STARTS):
            instance = self.subject.make()
            step = instance.reset(seed)
            if step.error:
                raise Untabulated(step.error)
            starts[self._state(instance, step, 0, (TracePart(seed),))] += 1
            if seed == STARTS // 10 and len(starts) == 1:
                break
            if seed >= 60 and len(starts) > seed * 0.9:
                raise Untabulated("nearly every reset gives another state")
        self.table.start = {s: n / starts.total() for s, n in starts.items()}
        while self.waiting:
            s, depth, held, trace = self.waiting.popleft()
            self.table.rows[s] = [self._outcomes(s, a, depth, held, trace) for a in range(len(self.table.actions))]
        return self.table

    def _state(self, instance: EnvInstance, step: EnvStep, depth: int, trace: Trace) -> int:
        """Return the number of the state that an instance is in; a new one is put on the list, unless no episode acts there."""
        state = self.table.add(snapshot(instance.env).key(self.ignored), step, trace)
        if not self.table.ends(step, depth) and depth < self.deepest and state not in self.listed:
            self.listed.add(state)
            self.waiting.append((state, depth, _copied(instance), trace))
        if len(self.table.states) > MOST_STATES:
            raise Untabulated(f"it has more than {MOST_STATES:,} states")
        if self.until.is_over:
            count = plural(len(self.table.states), "state")
            raise Untabulated(f"the time for its table ran out after {count}, and --seconds allows more")
        return state

    def _fork(self, held: EnvInstance | None, trace: Trace) -> EnvInstance:
        """Return an instance in a state: a copy, or a new one that played the actions that lead there."""
        if held is not None:
            return held.copy()
        instance = self.subject.make()
        for part in trace:
            instance.play(part)
        return instance

    def _outcomes(self, s: int, a: int, depth: int, held: EnvInstance | None, trace: Trace) -> dict[Outcome, float]:
        (part,) = trace
        after = (TracePart(part.seed, (*part.actions, self.table.actions[a])),)
        counts: Counter[Outcome] = Counter()
        is_drawn = False
        for repeat in range(REPEATS):
            instance = self._fork(held, trace)
            generators = snapshot(instance.env).generators
            if repeat:
                reseed(generators, repeat)
            before = ""
            if not is_drawn:
                before = drawn(generators)
            step = instance.step(self.table.actions[a])
            if step.error:
                raise Untabulated(step.error)
            to = self._state(instance, step, depth + 1, after)
            counts[to, step.paid, self.table.ends(step, depth + 1)] += 1
            if (not is_drawn and drawn(generators) == before) or (repeat == ALIKE and len(counts) == 1):
                break
            is_drawn = True
            if held is None:
                raise Untabulated("its steps draw, and its object cannot be copied")
        if is_drawn:
            self.table.drawn.add((s, a))
        elif self.counters and not self.table.by_time and (step.paid or step.terminated):
            later = self._later(held, trace, a)
            if later is not None and (later.paid, bool(later.terminated)) != (step.paid, bool(step.terminated)):
                self.table.by_time = (s, a, after)
        return {outcome: n / counts.total() for outcome, n in counts.items()}

    def _later(self, held: EnvInstance | None, trace: Trace, a: int) -> EnvStep | None:
        """Return a step where the counters of steps are one further; None where they cannot be set."""
        try:
            instance = self._fork(held, trace)
            leaves = snapshot(instance.env).leaves
            for place in self.counters:
                place_value(instance.env, place, leaves[place] + 1)
        except Exception:  # an object that is not to be changed
            return None
        step = instance.step(self.table.actions[a])
        if step.error:
            return None
        return step


def _copied(instance: EnvInstance) -> EnvInstance | None:
    try:
        return instance.copy()
    except Exception:
        return None


def compare(
    table: StateTable, subject: Subject, episodes: Iterable[EnvEpisode], ignored: frozenset[Place] | None
) -> None:
    """Play episodes again, and compare each step with the table; `ignored` as in the search, None for a table of `P`.

    Raises:
        Untabulated: where a step leads elsewhere, or something else is observed, than in the table.
    """
    numbers = {frozen(action): a for a, action in enumerate(table.actions)}
    for episode in episodes:
        instance = subject.make()
        step = instance.reset(episode.seed)
        state = _known(table, instance, step, ignored)
        for t, action in enumerate(episode.actions):
            a = numbers[frozen(action)]
            step = instance.step(action)
            if state is None or not table.rows[state]:
                break
            to = _known(table, instance, step, ignored)
            outcomes = table.rows[state][a]
            ends = table.ends(step, t + 1)
            if (to, step.paid, ends) not in outcomes and (state, a) not in table.drawn:
                if all(outcome[0] != to for outcome in outcomes):
                    raise Untabulated(f"t = {t}: a state that the table does not lead to")
                table.by_time = table.by_time or (state, a, episode.trace(t + 1))
            state = None if ends else to


def _known(table: StateTable, instance: EnvInstance, step: EnvStep, ignored: frozenset[Place] | None) -> int | None:
    key: Hashable = step.seen
    if ignored is not None:
        key = snapshot(instance.env).key(ignored)
    state = table.states.get(key)
    if state is not None and table.observations[state] != step.seen:
        raise Untabulated("what is observed is drawn, or depends on what its object does not hold")
    return state
