"""A task beside its original: the same state, the same action, and then the same step.

`side_by_side` runs the environment of a task. Where a step is drawn, `among_outcomes` looks for the original's step among
the outcomes that the task has, and tests that their probabilities are those with which the original draws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np
import pytest
from scipy import stats

import taskspec
from taskspec.envs.state import flat_state
from taskspec.exact.model.transitions import Steps
from taskspec.language.task.task import Task

ALPHA = 1e-6
"""The level of tests of distributions, on fixed seeds."""
State = Mapping[str, Any]
Act = Callable[[np.random.Generator, State, Any], Any]
"""Chooses an action of ours from random numbers, the state and the space of actions."""
Outcome = tuple[int, bool, float]
"""The code of the next state, whether the episode ends, and the reward."""
Chances = dict[Outcome, tuple[float, float]]

STEPS = pytest.mark.parametrize("steps", [2_000, pytest.param(100_000, marks=pytest.mark.slow)])
"""How many steps are compared: few in every run, and all of them with `-m slow`."""


class Result(NamedTuple):
    observation: Any
    reward: float
    terminated: bool
    truncated: bool
    measures: Mapping[str, float] = MappingProxyType({})


class Original(Protocol):
    """An environment of others."""

    def reset(self, seed: int) -> Any: ...
    def step(self, action: Any) -> Result: ...
    def state(self) -> State: ...


@dataclass(frozen=True)
class Gymnasium:
    """An environment with Gymnasium's interface; `read` is the state of its inside, under the names of the task."""

    env: Any
    read: Callable[[Any], State]

    def reset(self, seed: int) -> Any:
        return self.env.reset(seed=seed)[0]

    def step(self, action: Any) -> Result:
        return Result(*self.env.step(action)[:4])

    def state(self) -> State:
        return self.read(self.env.unwrapped)


@dataclass(frozen=True)
class DmEnv:
    """An environment with the interface of dm_env, in which nothing tells an end from a limit of time."""

    env: Any
    read: Callable[[Any], State]

    def reset(self, seed: int) -> Any:
        return self.env.reset().observation

    def step(self, action: Any) -> Result:
        found = self.env.step(action)
        return Result(found.observation, found.reward, found.last(), found.last())

    def state(self) -> State:
        return self.read(self.env)


def flat(observation: Any) -> Any:
    return np.ravel(np.asarray(observation, dtype=float))


def any_action(rng: np.random.Generator, state: State, space: Any) -> Any:
    """A random action."""
    if hasattr(space, "nvec"):
        return rng.integers(space.nvec)
    if hasattr(space, "n"):
        return int(rng.integers(space.n))
    return rng.uniform(space.low, space.high).astype(space.dtype)


@dataclass(frozen=True)
class Case:
    """A task for given parameters, its original, what acts, and how far a step may differ."""

    task: str
    original: Callable[[], Original]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    act: Act = any_action
    tolerance: float = 0.0

    def __str__(self) -> str:
        return " ".join([self.task, *(f"{name}={value}" for name, value in self.parameters.items())])

    def make(self) -> Any:
        return taskspec.make(self.task, **self.parameters)


def cases(found: Sequence[Case]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("case", found, ids=str)


def side_by_side(
    ours: Any,
    theirs: Original,
    steps: int,
    *,
    act: Act = any_action,
    seen: Callable[[Any], Any] | None = flat,
    put: bool = False,
    rewards: bool = True,
    tolerance: float = 0.0,
) -> int:
    """Step both, and compare states, observations, rewards and ends.

    Args:
        seen: what of an observation is compared; None: nothing.
        put: ours is put into their state before every step, so that rounding does not add up.
        rewards: whether they are compared; not where they are drawn.
        tolerance: of states, observations and rewards, absolute and relative.

    Returns:
        The number of episodes that ended.
    """
    rng = np.random.default_rng(3)
    ended = 0
    running = False
    for _ in range(steps):
        if not running:
            their_view = theirs.reset(seed=ended)
            state = theirs.state()
        if put or not running:
            our_view, _ = ours.reset(seed=0, options={"state": dict(state)})
        if seen is not None:
            assert_close("observation", seen(our_view), seen(their_view), tolerance)
        action = act(rng, state, ours.action_space)
        expected = theirs.step(action)
        our_view, reward, terminated, truncated, info = ours.step(action)
        their_view = expected.observation
        state = theirs.state()
        if rewards:
            assert_close("reward", reward, expected.reward, tolerance or 1e-12)
        found = ours.state
        for name, value in state.items():
            assert_close(name, found[name], value, tolerance)
        for name, value in expected.measures.items():
            assert_close(name, info["measures"][name], value, 1e-9)
        running = not (expected.terminated or expected.truncated)
        if put:
            assert bool(terminated) == bool(expected.terminated)
        else:
            assert (terminated or truncated) == (not running)
        ended += not running
    return ended


def assert_close(what: str, ours: Any, theirs: Any, tolerance: float) -> None:
    """Compare labels, numbers or arrays, up to an absolute and relative tolerance."""
    if isinstance(theirs, str):
        assert ours == theirs, what
        return
    difference = np.abs(np.asarray(ours, dtype=float) - np.asarray(theirs, dtype=float))
    allowed = tolerance * (1 + np.abs(np.asarray(theirs, dtype=float)))
    assert np.shape(ours) == np.shape(theirs) and (difference <= allowed).all(), (what, ours, theirs)


def among_outcomes(
    task: Task,
    theirs: Original,
    steps: int,
    *,
    act: Act = any_action,
) -> int:
    """Find each step of theirs among the outcomes of the task, and test with which probabilities they are drawn.

    A step that is drawn gives a number that is uniform if the probabilities are the same, as in the probability integral
    transform.

    Returns:
        The number of episodes that ended.
    """
    outcomes = OutcomesOf(task)
    rng = np.random.default_rng(3)
    uniform = []
    ended = 0
    running = False
    t = 0
    for _ in range(steps):
        if not running:
            theirs.reset(seed=ended)
            following = theirs.state()
            t = 0
        before = following
        action = act(rng, before, task.action_space)
        result = theirs.step(action)
        following = theirs.state()
        outcome = (outcomes.code(following), bool(result.terminated), round(float(result.reward), 9))
        chances = outcomes.of(before, action, t)
        assert outcome in chances, (before, action, following, result)
        chance, below = chances[outcome]
        if chance < 1:
            uniform.append(below + chance * rng.random())
        running = not (result.terminated or result.truncated)
        ended += not running
        t += 1
    if uniform:
        assert stats.kstest(uniform, "uniform").pvalue > ALPHA
    return ended


class OutcomesOf:
    """The outcomes of a task's steps, each with its probability and the sum of the probabilities before it."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.steps = Steps(task)
        self.known: dict[tuple[int, int, int], Chances] = {}

    def code(self, state: State) -> int:
        values = flat_state(self.task, state, (0,) * len(self.task.state))
        columns = [
            np.asarray(value).reshape(*c.type.shape, 1) for c, value in zip(self.task.state, values, strict=True)
        ]
        return int(self.steps.states.encode(columns, 1)[0][0])

    def of(self, state: State, action: int, t: int) -> Chances:
        key = (self.code(state), action, t * self.steps.uses_time)
        if key not in self.known:
            self.known[key] = self._enumerated(*key)
        return self.known[key]

    def _enumerated(self, state: int, action: int, t: int) -> Chances:
        chances: dict[Outcome, float] = {}
        for batch in self.steps.outcomes(np.array([state]), np.array([action]), t):
            _, codes, weights, rewards, ends, outside = batch.spread(1)
            assert not outside.any()
            for code, weight, reward, end in zip(codes, weights, rewards, ends, strict=True):
                outcome = (int(code), bool(end), round(float(reward), 9))
                chances[outcome] = chances.get(outcome, 0.0) + float(weight)
        below = np.cumsum([0.0, *chances.values()])
        return {outcome: (chance, below[k]) for k, (outcome, chance) in enumerate(chances.items())}
