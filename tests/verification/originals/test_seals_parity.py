"""The `seals` variants against the package they reproduce, seals 0.2.1, step by step.

Deterministic parts must be equal (reals to float32 rounding, since seals stores its states in
float32). Random parts are compared as distributions, by chi-square tests at level `ALPHA` on fixed
seeds: were the seeds drawn anew, a right spec would fail a given comparison once in 1/`ALPHA` runs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import taskspec
from taskspec.language.task.task import Task
from taskspec.programs.scalar import compile_scalar
from tests.shared.seals import State, fits, homogeneous, original, put


@dataclass(frozen=True)
class Case:
    """A registered environment, the spec that reproduces it, and its states in the spec's terms."""

    seals: str
    ours: str
    state: Callable[[Any], State]

    def pair(self) -> tuple[Any, Any]:
        return original(self.seals).unwrapped, taskspec.make(taskspec.load(f"derail/{self.ours}"))


def _single(state: Any) -> State:
    return {"s": int(state)}


def _cell(state: Any) -> State:
    return {"x": int(state[0]), "y": int(state[1])}


def _curve(state: Any) -> State:
    return dict(zip(("x", "y", "c2", "c1", "c0"), map(float, state), strict=True))


def _list(state: Any) -> State:
    return {"s": np.asarray(state, dtype=np.float64)}


def _goal(state: Any) -> State:
    return {"p": np.asarray(state[:2], dtype=np.int64), "g": np.asarray(state[2:], dtype=np.int64)}


TABULAR = (
    Case("RiskyPath", "RiskyPathSeals", _single),
    Case("EarlyTermPos", "EarlyTermPosSeals", _single),
    Case("EarlyTermNeg", "EarlyTermNegSeals", _single),
    Case("Branching", "BranchingSeals", _single),
    Case("InitShiftTrain", "InitShiftExpertSeals", _single),
    Case("InitShiftTest", "InitShiftLearnerSeals", _single),
)
OTHERS = (
    Case("NoisyObs", "NoisyObsSeals", _cell),
    Case("Parabola", "ParabolaSeals", _curve),
    Case("LargestSum", "LargestSumSeals", _list),
    Case("ProcGoal", "ProcGoalSeals", _goal),
    Case("Sort", "SortSeals", _list),
)


def _name(case: Case) -> str:
    return case.ours


each = pytest.mark.parametrize("case", TABULAR + OTHERS, ids=_name)
tabular = pytest.mark.parametrize("case", TABULAR, ids=_name)
other = pytest.mark.parametrize("case", OTHERS, ids=_name)


@each
def test_spaces_are_equal(case: Case) -> None:
    theirs, ours = case.pair()
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space


@each
def test_episodes_have_the_registered_length(case: Case) -> None:
    theirs = original(case.seals)
    ours = taskspec.make(taskspec.load(f"derail/{case.ours}"))
    theirs.reset(seed=0)
    ours.reset(seed=0)
    action = _actions(ours.action_space)[0]
    while True:  # the first action never leaves through the exit of EarlyTerm
        *_, terminated, truncated, _ = theirs.step(action)
        assert ours.step(action)[2:4] == (terminated, truncated)
        if terminated or truncated:
            return


@tabular
def test_every_transition_of_a_tabular_task(case: Case) -> None:
    theirs, ours = case.pair()
    theirs.reset(seed=0)
    ours.reset(seed=0)
    for state, action in np.ndindex(theirs.state_dim, theirs.action_dim):
        row = theirs.transition_matrix[state, action]
        times = 400 if max(row) < 1 else 1
        reached = [_step_in_table(case, theirs, ours, state, action) for _ in range(times)]
        assert fits(reached, row), (state, action)


def _step_in_table(case: Case, theirs: Any, ours: Any, state: int, action: int) -> int:
    """One step of ours, checked against what seals says of it; the state reached."""
    assert put(ours, case.state(state)) == state
    reached, reward, terminated, truncated, info = ours.step(action)
    assert info == {"old_state": state, "new_state": reached}
    assert reward == theirs.reward(np.int64(state), np.int64(action), np.int64(reached))
    assert terminated == theirs.terminal(np.int64(reached), 1)
    assert not truncated
    return int(reached)


def _states(case: Case, theirs: Any) -> Iterator[Any]:
    """Starts, states that random walks reach from them, and corners and samples of the space."""
    for seed in range(60):
        theirs.action_space.seed(seed)
        theirs.reset(seed=seed)
        yield theirs.state
        for _ in range(seed % 10):
            theirs.step(theirs.action_space.sample())
        yield theirs.state
    space = theirs.state_space
    if isinstance(space, gym.spaces.MultiDiscrete):
        yield from (np.array(cell) for cell in np.ndindex(*space.nvec))
    elif space.is_bounded():
        space.seed(0)
        yield from (space.low, space.high, space.high / 2)
        yield from (space.sample() for _ in range(60))
        yield from (np.round(space.sample()).astype(np.float32) for _ in range(60))  # ties in Sort


@other
def test_steps_from_equal_states(case: Case) -> None:
    theirs, ours = case.pair()
    ours.reset(seed=0)
    for state in list(_states(case, theirs)):
        for action in _actions(theirs.action_space):
            _compare_step(case, theirs, ours, state, action)


def _actions(space: gym.Space[Any]) -> list[Any]:
    if isinstance(space, gym.spaces.Discrete):
        return list(range(int(space.n)))
    if isinstance(space, gym.spaces.MultiDiscrete):
        return [np.array(pair) for pair in np.ndindex(*space.nvec)]
    assert isinstance(space, gym.spaces.Box)
    inner = [np.array(a, dtype=np.float32) for a in (-3.5, -0.25, 0, 0.1, 7)]
    return [space.low, space.high, *inner]


def _compare_step(case: Case, theirs: Any, ours: Any, state: Any, action: Any) -> None:
    theirs.reset(seed=0)
    theirs.state = state
    their_obs, their_reward, their_terminated, _, their_info = theirs.step(action)
    put(ours, case.state(state))
    obs, reward, terminated, _, info = ours.step(action)
    _compare_infos(info, their_info)
    seen = 2 if case.seals == "NoisyObs" else len(their_obs)
    np.testing.assert_allclose(obs[:seen], their_obs[:seen], rtol=1e-6, atol=1e-6)
    assert reward == pytest.approx(float(their_reward), rel=1e-4, abs=1e-5)
    assert terminated == their_terminated
    for name, value in case.state(theirs.state).items():
        np.testing.assert_allclose(ours.state[name], value, rtol=1e-6, atol=1e-6)


def _compare_infos(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        assert isinstance(ours[name], np.ndarray) and ours[name].dtype == np.asarray(value).dtype
        np.testing.assert_allclose(ours[name], value, rtol=1e-6, atol=1e-6)


@each
def test_infos_tell_the_state_step_by_step(case: Case) -> None:
    """The state left and the state reached, as `env.state` has them, after resets and after a state that was set."""
    theirs = original(case.seals)
    ours = gym.make(f"derail/{case.ours}-v0")
    theirs.reset(seed=0)
    kind = type(theirs.step(_actions(ours.action_space)[0])[4]["new_state"])
    ours.action_space.seed(0)
    assert ours.reset(seed=1)[1] == {}
    handed = []
    for episode in range(3):
        if episode == 2:
            ours.reset(options={"state": dict(ours.state)})
        over = False
        while not over:
            before = ours.state
            *_, terminated, truncated, info = ours.step(ours.action_space.sample())
            for name, state in (("old_state", before), ("new_state", ours.state)):
                told = info[name]
                assert isinstance(told, int if kind is np.int64 else kind)
                np.testing.assert_allclose(np.ravel(told), _flat(ours.task, state), rtol=1e-6)
                handed.append((told, np.copy(told)))
            over = terminated or truncated
        ours.reset()
    assert all(np.array_equal(told, then) for told, then in handed)


@each
def test_infos_make_no_array_of_numbers_at_a_step(case: Case) -> None:
    """An array is copied or written into a row of a block: made of Python's numbers, it would take longer than the step."""
    source = compile_scalar(taskspec.load(f"derail/{case.ours}-v0")).source
    step = source[source.index("def step") : source.index("def get")]
    assert '"new_state": ' in step
    assert not re.search(r"\b(array|singles)\(", step)


def _flat(task: Task, state: State) -> Any:
    numbers = [state[c.name] if c.domain is None else c.domain.index(state[c.name]) for c in task.state]
    return np.concatenate([np.ravel(np.asarray(value, np.float64)) for value in numbers])


PUBLISHED: list[tuple[str, dict[str, Any]]] = [
    ("Branching", {"branch_factor": 3, "length": 4}),
    ("NoisyObs", {"size": 4, "noise_length": 3}),
    ("Parabola", {"x_step": 0.5, "bounds": 2.0}),
    ("ProcGoal", {"bounds": 20, "distance": 3}),
    ("LargestSum", {"length": 12}),
    ("Sort", {"length": 3}),
]


@pytest.mark.parametrize(("name", "options"), PUBLISHED)
def test_published_keywords_are_taken(name: str, options: dict[str, Any]) -> None:
    theirs = original(name, **options).unwrapped
    ours = gym.make(f"derail/{name}Seals-v0", **options)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    if name == "ProcGoal":  # no space tells it
        ours.reset(seed=0)
        assert {int(np.abs(ours.state["g"] - ours.state["p"]).sum()) for _ in range(9) if ours.reset()} == {3}
    again = taskspec.load(taskspec.load(f"derail/{name}Seals"), **options)
    assert again == ours.task
    first, *_ = options
    own = next(p.name for p in ours.task.parameters if first in (p.name, p.alias))
    if own != first:
        with pytest.raises(taskspec.SpecError, match=r"E702.*are one parameter"):
            taskspec.load(f"derail/{name}Seals", **options, **{own: 1})


def _given(name: str, ours: str, **options: Any) -> Any:
    return pytest.param(Case(name, ours, _single), options, id=f"{name}-{options}")


@pytest.mark.parametrize(
    ("case", "options"),
    [
        _given("EarlyTermPos", "EarlyTermPosSeals", is_reward_positive=False),
        _given("EarlyTermNeg", "EarlyTermNegSeals", is_reward_positive=True),
        *(_given("InitShiftTrain", "InitShiftExpertSeals", initial_state=s) for s in range(7)),
        _given("InitShiftTest", "InitShiftLearnerSeals", initial_state=0),
    ],
)
def test_published_keywords_change_the_table(case: Case, options: dict[str, Any]) -> None:
    theirs = original(case.seals, **options).unwrapped
    ours = gym.make(f"derail/{case.ours}-v0", **options)
    assert ours.reset(seed=0)[0] == theirs.reset(seed=0)[0]
    for state, action in np.ndindex(theirs.state_dim, theirs.action_dim):
        reached = _step_in_table(case, theirs, ours, state, action)
        assert theirs.transition_matrix[state, action, reached] == 1


# What is compared of a start: a few discrete outcomes that together pin the distribution down.
def _tenths(*indices: int) -> Callable[[Any], tuple[int, ...]]:
    return lambda obs: tuple(min(int(np.floor(obs[i] * 10)), 9) for i in indices)


STARTS: dict[str, tuple[Callable[[Any], Any], ...]] = {
    "NoisyObs": (
        lambda o: (int(o[0]), int(o[1])),
        lambda o: int(np.clip(np.floor(2 * o[2]), -5, 4)),
    ),
    "Parabola": (
        lambda o: (int(np.floor(o[2] * 4)), int(np.floor(o[3] * 4))),
        lambda o: (int(np.floor(o[3] * 4)), int(np.floor(o[4] * 4))),
        lambda o: (float(o[0]), bool(o[1] == o[4])),
    ),
    "LargestSum": (_tenths(0, 1), _tenths(0, -1), _tenths(24, 25)),
    "ProcGoal": (
        lambda o: (int(o[2] - o[0]), int(o[3] - o[1])),
        lambda o: (int(o[0]) // 25, int(o[1]) // 25),
        lambda o: (int(o[0]) // 50, int(o[2] - o[0]) // 5, int(o[3] - o[1]) // 5),
    ),
    "Sort": (_tenths(0, 1), _tenths(2, 3), _tenths(0, 3)),
}


@other
def test_starts_have_one_distribution(case: Case) -> None:
    theirs, ours = case.pair()
    theirs.reset(seed=1)
    ours.reset(seed=1)
    first = [np.asarray(theirs.reset()[0]) for _ in range(4000)]
    second = [np.asarray(ours.reset()[0]) for _ in range(4000)]
    for outcome in STARTS[case.seals]:
        assert homogeneous(map(outcome, first), map(outcome, second))


@tabular
def test_tabular_starts(case: Case) -> None:
    theirs, ours = case.pair()
    theirs.reset(seed=0)
    assert {int(ours.reset(seed=seed)[0]) for seed in range(20)} == {int(theirs.initial_state())}


@pytest.mark.parametrize("length", [2, 3, 7, 50])
def test_largest_sum_takes_the_whole_length(length: int) -> None:
    from seals.diagnostics.largest_sum import LargestSumEnv

    theirs = LargestSumEnv(length=length)
    ours = taskspec.make(taskspec.load("derail/LargestSumSeals", length=length))
    assert ours.observation_space == theirs.observation_space
    case = Case("LargestSum", "LargestSumSeals", _list)
    ours.reset(seed=0)
    for seed in range(40):
        theirs.reset(seed=seed)
        for action in (0, 1):
            _compare_step(case, theirs, ours, theirs.state, action)


@pytest.mark.parametrize(("branching", "length"), [(2, 1), (3, 4), (5, 2)])
def test_branching_at_other_sizes(branching: int, length: int) -> None:
    from seals.diagnostics.branching import BranchingEnv

    theirs = BranchingEnv(branch_factor=branching, length=length)
    ours = taskspec.make(taskspec.load("derail/BranchingSeals", B=branching, L=length))
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    case = Case("Branching", "BranchingSeals", _single)
    ours.reset(seed=0)
    for state, action in np.ndindex(theirs.state_dim, theirs.action_dim):
        reached = _step_in_table(case, theirs, ours, state, action)
        assert theirs.transition_matrix[state, action, reached] == 1
