"""Specs of Gymnasium's own environments against the originals: equal spaces, steps and endings.

FrozenLake and Taxi are compared in every state with every action; the others step by step along
random episodes. Random steps are compared by chi-square tests at level `ALPHA` on fixed seeds.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.toy_text.frozen_lake import MAPS, generate_random_map

import taskspec
from taskspec.data.tabular import tabular
from tests.shared.specs import spec_file

stats = pytest.importorskip("scipy.stats")

ALPHA = 1e-6
LAKES = {
    **MAPS,
    "random 5": generate_random_map(size=5, p=0.7, seed=1),
    "random 7": generate_random_map(size=7, p=0.8, seed=2),
    "oblong": ["SFF", "FHF", "FFH", "HFG"],
    "two starts": ["FFS", "SFH", "FFG"],
}

lakes = pytest.mark.parametrize("lake", LAKES)


def make(name: str, **parameters: Any) -> Any:
    return taskspec.make(taskspec.load(str(spec_file(name)), **parameters))


def put(env: Any, **state: Any) -> Any:
    """Start an episode of ours in the given state."""
    return env.reset(options={"state": state})[0]


def frozen_lake(tmp_path: Path, desc: list[str], slippery: bool) -> tuple[Any, Any]:
    """Gymnasium's lake and ours with the same map, written into a copy of the spec."""
    grid = f"grid: {json.dumps(MAPS['4x4'])}"
    source = (spec_file("frozen_lake")).read_text()
    assert grid in source
    path = tmp_path / "frozen_lake.yaml"
    source = source.replace(grid, f"grid: {json.dumps(desc)}")
    path.write_text(source.replace("- states == 16\n", "- states > 1\n"))
    theirs = gym.make("FrozenLake-v1", desc=desc, is_slippery=slippery).unwrapped
    return theirs, taskspec.make(taskspec.load(str(path), slippery=slippery))


def outcomes(row: list[tuple[float, int, float, bool]]) -> dict[tuple[int, float, bool], float]:
    """A row of Gymnasium's `P` with equal outcomes put together."""
    total: dict[tuple[int, float, bool], float] = {}
    for p, *outcome in row:
        key = (int(outcome[0]), float(outcome[1]), bool(outcome[2]))
        total[key] = total.get(key, 0.0) + p
    return total


def step(env: Any, action: int, **state: Any) -> tuple[int, float, bool]:
    put(env, **state)
    obs, reward, terminated, _, _ = env.step(action)
    return int(obs), float(reward), bool(terminated)


def fits(sample: list[Any], expected: dict[Any, float]) -> bool:
    """Whether the outcomes are those expected, in the expected proportions."""
    assert set(sample) == set(expected)
    if len(expected) == 1:
        return True
    counts = [sample.count(outcome) for outcome in expected]
    means = [p * len(sample) for p in expected.values()]
    return bool(stats.chisquare(counts, means).pvalue > ALPHA)


@lakes
@pytest.mark.parametrize("slippery", [True, False])
def test_frozen_lake(tmp_path: Path, lake: str, slippery: bool) -> None:
    theirs, ours = frozen_lake(tmp_path, LAKES[lake], slippery)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    ours.reset(seed=0)
    for state, rows in theirs.P.items():
        for action, row in rows.items():
            expected = outcomes(row)
            sample = [step(ours, action, s=state) for _ in range(1 if len(expected) == 1 else 120)]
            assert fits(sample, expected), (state, action)


@lakes
def test_frozen_lake_starts(tmp_path: Path, lake: str) -> None:
    theirs, ours = frozen_lake(tmp_path, LAKES[lake], slippery=True)
    ours.reset(seed=0)
    starts = [int(ours.reset()[0]) for _ in range(400)]
    expected = enumerate(theirs.initial_state_distrib)
    assert fits(starts, {state: p for state, p in expected if p > 0})


def test_frozen_lake_episodes(tmp_path: Path) -> None:
    """The same actions lead through the same episode, to its end, when nothing slips."""
    _, ours = frozen_lake(tmp_path, MAPS["4x4"], slippery=False)
    theirs = gym.make("FrozenLake-v1", is_slippery=False)
    rng = np.random.default_rng(0)
    for seed in range(50):
        assert ours.reset(seed=seed)[0] == theirs.reset(seed=seed)[0]
        done = False
        while not done:
            action = int(rng.integers(4))
            result = theirs.step(action)[:4]
            assert ours.step(action)[:4] == result
            done = result[2] or result[3]


def taxi() -> tuple[Any, Any]:
    """Gymnasium's taxi, in the version it has, and ours."""
    version = "Taxi-v4" if "Taxi-v4" in gym.registry else "Taxi-v3"
    return gym.make(version).unwrapped, make("taxi")


@pytest.mark.parametrize("slippery", [False, True])
def test_cliff_walking(slippery: bool) -> None:
    if slippery and gym.__version__ < "1":
        pytest.skip("Gymnasium 0.29 has no slippery cliff")
    version = "CliffWalking-v1" if "CliffWalking-v1" in gym.registry else "CliffWalking-v0"
    options = {"is_slippery": True} if slippery else {}
    theirs: Any = gym.make(version, **options).unwrapped
    ours = make("cliff_walking", slippery=slippery)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    found = tabular(ours.task)
    places = [found.model.state(i)["s"] for i in range(found.model.n_states)]
    for s, actions in theirs.P.items():
        if s == 47 or 36 < s < 47:  # an episode is over, or never there
            continue
        for a, outcomes in actions.items():
            expected: dict[int, float] = {}
            for p, following, _, _ in outcomes:
                expected[int(following)] = expected.get(int(following), 0) + p
            row = found.P[places.index(s), a]
            assert {places[k]: row[k] for k in row.nonzero()[0]} == pytest.approx(expected)


def test_cliff_walking_steps() -> None:
    version = "CliffWalking-v1" if "CliffWalking-v1" in gym.registry else "CliffWalking-v0"
    theirs: Any = gym.make(version)
    ours = make("cliff_walking", N=100_000)
    rng = np.random.default_rng(3)
    assert ours.reset(seed=0)[0] == theirs.reset(seed=0)[0]
    for action in rng.integers(4, size=100_000):
        expected = theirs.step(int(action))
        assert ours.step(int(action))[:4] == expected[:4]
        if expected[2]:
            ours.reset()
            theirs.reset()


def test_taxi() -> None:
    theirs, ours = taxi()
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    ours.reset(seed=0)
    for state, rows in theirs.P.items():
        row, col, passenger, goal = (int(v) for v in theirs.decode(state))
        assert put(ours, row=row, col=col, passenger=passenger, goal=goal) == state
        for action, entries in rows.items():
            result = step(ours, action, row=row, col=col, passenger=passenger, goal=goal)
            assert result == next(iter(outcomes(entries))), (state, action)


def test_taxi_starts() -> None:
    theirs, ours = taxi()
    ours.reset(seed=0)
    starts = [int(ours.reset()[0]) for _ in range(9000)]
    counts = np.bincount(starts, minlength=500)
    possible = theirs.initial_state_distrib > 0
    assert not counts[~possible].any()
    expected = theirs.initial_state_distrib[possible] * len(starts)
    assert stats.chisquare(counts[possible], expected).pvalue > ALPHA


# environment, spec, names of the entries of Gymnasium's state, error allowed after one step
SMOOTH = [
    ("CartPole-v1", "cart_pole", ("x", "v", "theta", "omega"), 1e-6),
    ("MountainCarContinuous-v0", "mountain_car_continuous", ("x", "v"), 2e-6),
    ("Pendulum-v1", "pendulum", ("theta", "omega"), 2e-5),
]
smooth = pytest.mark.parametrize(("name", "spec", "names", "tolerance"), SMOOTH, ids=[entry[1] for entry in SMOOTH])


@smooth
def test_smooth_spaces(name: str, spec: str, names: tuple[str, ...], tolerance: float) -> None:
    theirs, ours = gym.make(name), make(spec)
    seen = theirs.observation_space
    largest = np.finfo(np.float32).max  # stands for infinity in Gymnasium 0.29
    low, high = (np.where(np.abs(b) == largest, np.copysign(np.inf, b), b) for b in (seen.low, seen.high))
    assert ours.observation_space == gym.spaces.Box(low, high, dtype=np.float32)
    assert ours.action_space == theirs.action_space


@smooth
def test_smooth_episodes(name: str, spec: str, names: tuple[str, ...], tolerance: float) -> None:
    """Step by step along Gymnasium's episodes, ours being put into its state before every step."""
    theirs, ours = gym.make(name), make(spec)
    ours.reset(seed=0)
    for seed in range(8):
        theirs.action_space.seed(seed)
        theirs.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            action = _push(theirs, seed)
            put(ours, **dict(zip(names, map(float, theirs.unwrapped.state), strict=True)))
            their_obs, their_reward, terminated, truncated, _ = theirs.step(action)
            obs, reward, ended, _, _ = ours.step(action)
            np.testing.assert_allclose(obs, their_obs, rtol=tolerance, atol=tolerance)
            assert reward == pytest.approx(float(their_reward), rel=tolerance, abs=tolerance)
            assert ended == terminated


def _push(env: Any, seed: int) -> Any:
    """A random action, or in every second episode one that pushes the way the system moves."""
    if seed % 2 or isinstance(env.action_space, gym.spaces.Discrete):
        return env.action_space.sample()
    return env.action_space.high if env.unwrapped.state[1] >= 0 else env.action_space.low


@smooth
def test_smooth_trajectories(name: str, spec: str, names: tuple[str, ...], tolerance: float) -> None:
    """Whole episodes from one start, with nothing put right on the way: the ends agree."""
    theirs, ours = gym.make(name), make(spec)
    for seed in range(5):
        theirs.action_space.seed(seed)
        theirs.reset(seed=seed)
        put(ours, **dict(zip(names, map(float, theirs.unwrapped.state), strict=True)))
        done = False
        steps = 0
        while not done and steps < 100:
            action = theirs.action_space.sample()
            their_obs, _, terminated, truncated, _ = theirs.step(action)
            obs, _, ended, stopped, _ = ours.step(action)
            np.testing.assert_allclose(obs, their_obs, rtol=1e-3, atol=1e-3)
            assert (ended, stopped) == (terminated, truncated)
            done = terminated or truncated
            steps += 1


@smooth
def test_smooth_horizons(name: str, spec: str, names: tuple[str, ...], tolerance: float) -> None:
    limit = gym.spec(name).max_episode_steps
    assert limit is not None
    ours = make(spec)
    ours.reset(seed=0)
    action = np.zeros(1, dtype=np.float32) if name != "CartPole-v1" else 0
    for t in range(limit):
        if name == "CartPole-v1":
            x, v, theta, omega = (float(ours.state[key]) for key in names)
            action = int(x + 2 * v + 20 * theta + 5 * omega > 0)
        *_, terminated, truncated, _ = ours.step(action)
        assert not terminated
        assert truncated == (t == limit - 1)


LOWS_AND_HIGHS = [
    ("cart_pole", dict.fromkeys(("x", "v", "theta", "omega"), (-0.05, 0.05))),
    ("mountain_car_continuous", {"x": (-0.6, -0.4), "v": (0, 0)}),
    ("pendulum", {"theta": (-np.pi, np.pi), "omega": (-1, 1)}),
]


@pytest.mark.parametrize(("spec", "ranges"), LOWS_AND_HIGHS, ids=[entry[0] for entry in LOWS_AND_HIGHS])
def test_smooth_starts_are_uniform(spec: str, ranges: dict[str, tuple[float, float]]) -> None:
    ours = make(spec)
    ours.reset(seed=0)
    starts = []
    for _ in range(1000):
        ours.reset()
        starts.append(dict(ours.state))
    for name, (low, high) in ranges.items():
        values = [float(start[name]) for start in starts]
        if low == high:
            assert set(values) == {low}
        else:
            assert stats.kstest(values, "uniform", (low, high - low)).pvalue > ALPHA
