"""The exact model of a finite task: all states that episodes can be in, and lists of outcomes, in fractions."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

from tests.verification.oracle.reference.chance import Endless, Script, outcomes
from tests.verification.oracle.reference.moment import Moment
from tests.verification.oracle.reference.task import State, Task
from tests.verification.oracle.reference.values import Number

Key = tuple[object, ...]
"""A state as the elements of its components."""


def state_key(state: State) -> Key:
    return tuple(x for v in state.values() for x in v.data)


@dataclass(frozen=True)
class Outcome:
    probability: Fraction
    state: Key
    reward: Number
    terminated: bool


@dataclass
class Model:
    """States by key, and what may follow from each by each action at each time."""

    task: Task
    limit: int = 4096
    """The most outcomes of one step."""
    budget: int = 10**9
    """The most outcomes of all steps together."""
    states: dict[Key, State] = field(default_factory=dict)
    _rows: dict[tuple[Key, int, int], list[Outcome]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not all(c.finite for c in self.task.action):
            raise Endless("endlessly many actions")
        combinations = itertools.product(*(list(c.everything()) for c in self.task.action))
        names = [c.name for c in self.task.action]
        self.actions: list[State] = [dict(zip(names, values, strict=True)) for values in combinations]

    def start(self) -> dict[Key, Fraction]:
        found: dict[Key, Fraction] = {}

        def begin(script: Script) -> State:
            return Moment.begin(self.task, script).state

        for probability, state in outcomes(begin, self.limit):
            found[self.keep(state)] = found.get(self.keep(state), Fraction(0)) + probability
        return found

    def legal(self, key: Key) -> list[int]:
        """The numbers of the actions that may be taken in a state."""
        found = []
        for a, action in enumerate(self.actions):
            if Moment(self.task, self.states[key], action, 0, None).legal():
                found.append(a)
        return found or list(range(len(self.actions)))

    def keep(self, state: State) -> Key:
        key = state_key(state)
        self.states.setdefault(key, state)
        return key

    def row(self, key: Key, action: int, t: int) -> list[Outcome]:
        """The outcomes of an action, equal ones put together."""
        at = key, action, t
        if at not in self._rows:
            self._rows[at] = self._outcomes(key, action, t)
        return self._rows[at]

    def _outcomes(self, key: Key, action: int, t: int) -> list[Outcome]:
        def run(script: Script) -> tuple[State, Number, bool]:
            moment = Moment(self.task, self.states[key], self.actions[action], t, script)
            return moment.next_state(), moment.reward().item, moment.terminal()

        joined: dict[tuple[Key, Number, bool], Fraction] = {}
        for probability, (after, reward, ends) in outcomes(run, self.limit):
            self.budget -= 1
            if self.budget < 0:
                raise Endless("too many outcomes")
            result = self.keep(after), reward, ends
            joined[result] = joined.get(result, Fraction(0)) + probability
        return [Outcome(p, *result) for result, p in joined.items()]

    def layers(self) -> Iterator[list[Key]]:
        """The states that an episode can act in at time 0, 1, ...; ends with the horizon."""
        assert self.task.horizon is not None
        here = list(self.start())
        for t in range(self.task.horizon):
            yield here
            going = [o for key in here for a in range(len(self.actions)) for o in self.row(key, a, t)]
            here = list(dict.fromkeys(o.state for o in going if not o.terminated))


def expert_shares(model: Model, key: Key, t: int) -> dict[int, Fraction]:
    """How likely the expert takes each action in a state."""
    numbers = {state_key(a): i for i, a in enumerate(model.actions)}
    found: dict[int, Fraction] = {}

    def choose(s: Script) -> State:
        return Moment(model.task, model.states[key], None, t, s).expert()

    for probability, action in outcomes(choose, model.limit):
        i = numbers[state_key(action)]
        found[i] = found.get(i, Fraction(0)) + probability
    return found
