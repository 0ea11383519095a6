"""Tasks that tests of exact results share: shipped ones, those of the tests, and small random ones."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.exact import extract
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.model.model import Model
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.specs import spec_file

ROOT = Path(__file__).parents[2]
Array = np.ndarray[Any, Any]


def shipped(name: str, variant: str | None = None, *, suite: str = "derail", **parameters: Any) -> Task:
    return build(source.read_file(ROOT / "tasks" / suite / f"{name}.yaml"), variant, parameters, suite)


def model_of(task: Task) -> Model:
    found = abstraction(task)
    return extract(task if found is None else found.stand_in)


def spec(name: str) -> Task:
    return build(source.read_file(spec_file(name)))


RANDOM = """
taskspec: 1
name: Small
constants:
  P: {P}
  R: {R}
state:
  s: {{type: int, low: 0, high: {S} - 1}}
action:
  a: {{type: int, low: 0, high: {A} - 1}}
horizon: {H}
discount: {discount}
initial:
  s: Categorical({start})
dynamics:
  s': Categorical(P[s, a])
reward: R[s, a][s']
terminal: s' == {last}
"""


class Small:
    """A random MDP with R(s, a, s') whose last state is terminal, as dense arrays and as a spec."""

    def __init__(self, seed: int, states: int = 3, actions: int = 2, horizon: Any = 3, discount: float = 1.0) -> None:
        rng = np.random.default_rng(seed)
        weights = rng.integers(0, 4, (states, actions, states)) + np.eye(states, dtype=int)[:, None, :]
        self.p = weights / weights.sum(axis=-1, keepdims=True)
        self.r = rng.integers(-5, 6, (states, actions, states)).astype(float)
        start = rng.integers(1, 4, states)
        start[-1] = 0
        self.start = start / start.sum()
        self.horizon = horizon
        self.discount = discount
        self.states = states
        self.actions = actions
        text = RANDOM.format(
            P=self.p.tolist(), R=self.r.tolist(), S=states, A=actions, H=horizon, discount=discount,
            start=self.start.tolist(), last=states - 1,
        )  # fmt: skip
        self.task = build(source.read_text(text, "small.yaml"))
        self.model = extract(self.task)

    def going(self, s: int) -> bool:
        return s != self.states - 1

    def trajectories(
        self, t: int = 0, s: int | None = None
    ) -> Iterator[tuple[float, tuple[tuple[int, int], ...], float]]:
        """Probability of the outcomes, the (state, action) pairs, and the return, of every episode."""
        if s is None:
            for first in range(self.states):
                for p, pairs, total in self.trajectories(0, first):
                    yield self.start[first] * p, pairs, total
            return
        if t == self.horizon:
            yield 1.0, (), 0.0
            return
        for a in range(self.actions):
            for s2 in range(self.states):
                p = self.p[s, a, s2]
                r = self.r[s, a, s2]
                rest = self.trajectories(t + 1, s2) if self.going(s2) else [(1.0, (), 0.0)]
                for q, pairs, total in rest if p > 0 else ():
                    yield p * q, ((s, a), *pairs), r + self.discount * total

    def value(self, policy: Any) -> float:
        """The expected return of `policy(t, s) -> probabilities`, by plain recursion."""

        def at(t: int, s: int) -> float:
            if t == self.horizon:
                return 0.0
            total = 0.0
            for a, pi in enumerate(policy(t, s)):
                for s2 in range(self.states):
                    after = self.discount * at(t + 1, s2) if self.going(s2) else 0.0
                    total += pi * self.p[s, a, s2] * (self.r[s, a, s2] + after)
            return total

        return sum(self.start[s] * at(0, s) for s in range(self.states))


ROAD = """
taskspec: 1
name: Road
state: {s: {type: int, low: 0, high: 19999}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 500
initial: {s: 0}
dynamics: {s': "min(s + a, 19999)"}
reward: s'
expert: {a: 1}
"""
"""A road of 20,000 places, of which episodes enter 501."""
