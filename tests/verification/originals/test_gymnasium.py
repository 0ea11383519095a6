"""Toy text and classic control beside Gymnasium's own environments: equal spaces, steps and endings.

FrozenLake, CliffWalking and Taxi are compared in every state with every action, too.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.toy_text.frozen_lake import MAPS, generate_random_map
from scipy import stats

import taskspec
from taskspec.language import draws
from taskspec.language.expressions.variates import WordLayout
from taskspec.learn.data.tabular import tabular
from tests.shared.specs import spec_file
from tests.verification.originals.beside import (
    ALPHA,
    STEPS,
    Case,
    Gymnasium,
    among_outcomes,
    any_action,
    cases,
    side_by_side,
)

LAKES = {
    **MAPS,
    "random 5": generate_random_map(size=5, p=0.7, seed=1),
    "random 7": generate_random_map(size=7, p=0.8, seed=2),
    "oblong": ["SFF", "FHF", "FFH", "HFG"],
    "two starts": ["FFS", "SFH", "FFG"],
}

lakes = pytest.mark.parametrize("lake", LAKES)
TAXI = "Taxi-v4" if "Taxi-v4" in gym.registry else "Taxi-v3"


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


def taxi() -> tuple[Any, Any]:
    """Gymnasium's taxi and ours."""
    return gym.make(TAXI).unwrapped, make("taxi")


@pytest.mark.parametrize("slippery", [False, True])
def test_cliff_walking(slippery: bool) -> None:
    theirs: Any = cliff(slippery).unwrapped
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


def place(env: Any) -> dict[str, int]:
    return {"s": int(env.s)}


def ride(env: Any) -> dict[str, int]:
    return dict(zip(("row", "col", "passenger", "goal"), map(int, env.decode(env.s)), strict=True))


def cliff(slippery: bool = False) -> Any:
    """Gymnasium's cliff, in the version it has."""
    if slippery and gym.__version__ < "1":
        pytest.skip("Gymnasium 0.29 has no slippery cliff")
    version = "CliffWalking-v1" if "CliffWalking-v1" in gym.registry else "CliffWalking-v0"
    return gym.make(version, **({"is_slippery": True} if slippery else {}))


GRIDS = [
    Case(
        "toy_text/FrozenLake",
        lambda: Gymnasium(gym.make("FrozenLake-v1", is_slippery=False), place),
        {"slippery": False},
    ),
    Case("toy_text/FrozenLake", lambda: Gymnasium(gym.make("FrozenLake-v1"), place), {"slippery": True}),
    Case("toy_text/CliffWalking", lambda: Gymnasium(cliff(), place), {"N": 100_000}),
    Case("toy_text/CliffWalking", lambda: Gymnasium(cliff(slippery=True), place), {"N": 100_000, "slippery": True}),
    Case("toy_text/Taxi", lambda: Gymnasium(gym.make(TAXI), ride)),
]
MORE = [*GRIDS, Case("toy_text/Blackjack", lambda: Gymnasium(gym.make("Blackjack-v1"), lambda env: {}))]


@STEPS
@cases(GRIDS)
def test_steps_of_grids(case: Case, steps: int) -> None:
    """Equal steps; where they are drawn, from the same distribution."""
    if case.parameters.get("slippery"):
        ended = among_outcomes(case.make().task, case.original(), steps)
    else:
        ended = side_by_side(case.make(), case.original(), steps)
    assert ended > 0 or "Cliff" in case.task


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


@STEPS
def test_masks_of_taxi(steps: int) -> None:
    """Equal masks in the infos of resets and steps, whether or not the action was legal."""
    theirs, ours = taxi()
    rng = np.random.default_rng(0)
    for episode in range(steps // 50):
        _, expected = theirs.reset(seed=episode)
        row, col, passenger, goal = (int(v) for v in theirs.decode(theirs.s))
        _, found = ours.reset(seed=0, options={"state": {"row": row, "col": col, "passenger": passenger, "goal": goal}})
        for _ in range(50):
            assert found["action_mask"].dtype == expected["action_mask"].dtype
            assert np.array_equal(found["action_mask"], expected["action_mask"])
            action = ours.action_space.sample(found["action_mask"] if rng.random() < 0.8 else None)
            *_, ended, _, expected = theirs.step(action)
            *_, found = ours.step(action)
            if ended:
                break


def test_taxi_starts() -> None:
    theirs, ours = taxi()
    ours.reset(seed=0)
    starts = [int(ours.reset()[0]) for _ in range(9000)]
    counts = np.bincount(starts, minlength=500)
    possible = theirs.initial_state_distrib > 0
    assert not counts[~possible].any()
    expected = theirs.initial_state_distrib[possible] * len(starts)
    assert stats.chisquare(counts[possible], expected).pvalue > ALPHA


def at(*names: str) -> Callable[[Any], dict[str, float]]:
    return lambda env: dict(zip(names, map(float, env.state), strict=True))


def links(env: Any) -> dict[str, Any]:
    return {"s": env.state}


CASES = [
    Case("classic_control/CartPole", lambda: Gymnasium(gym.make("CartPole-v1"), at("x", "v", "theta", "omega"))),
    Case("classic_control/MountainCar", lambda: Gymnasium(gym.make("MountainCar-v0"), at("x", "v")), tolerance=1e-12),
    Case(
        "classic_control/MountainCarContinuous",
        lambda: Gymnasium(gym.make("MountainCarContinuous-v0"), at("x", "v")),
        tolerance=2e-6,
    ),
    Case("classic_control/Pendulum", lambda: Gymnasium(gym.make("Pendulum-v1"), at("theta", "omega")), tolerance=1e-5),
    Case("classic_control/Acrobot", lambda: Gymnasium(gym.make("Acrobot-v1"), links), tolerance=1e-10),
]
"""Gymnasium computes two of them in float32."""


def original(case: Case) -> Any:
    if "Acrobot" in case.task and gym.__version__ < "1":
        pytest.skip("Gymnasium 0.29's Acrobot needs NumPy 1")
    return case.original()


@cases(CASES)
def test_smooth_spaces(case: Case) -> None:
    theirs = original(case).env
    ours = case.make()
    seen = theirs.observation_space
    largest = np.finfo(np.float32).max  # stands for infinity in Gymnasium 0.29
    low, high = (np.where(np.abs(b) == largest, np.copysign(np.inf, b), b) for b in (seen.low, seen.high))
    assert ours.observation_space == gym.spaces.Box(low, high, dtype=np.float32)
    assert ours.action_space == theirs.action_space


@STEPS
@cases(CASES)
def test_smooth_steps(case: Case, steps: int) -> None:
    """Equal steps; where they differ by rounding, ours is put into Gymnasium's state before each of them."""
    put = case.tolerance > 0
    assert side_by_side(case.make(), original(case), steps, act=pushes, put=put, tolerance=case.tolerance) > 0


def pushes(rng: np.random.Generator, state: Any, space: Any) -> Any:
    """Mostly the action with which a car gets up its hill; random ones otherwise."""
    if "v" not in state or "theta" in state or rng.random() < 0.2:
        return any_action(rng, state, space)
    return 2 * (state["v"] >= 0) if hasattr(space, "n") else np.sign([state["v"] or 1]).astype(np.float32)


@cases(CASES)
def test_smooth_horizons(case: Case) -> None:
    limit = original(case).env.spec.max_episode_steps
    ours = case.make()
    ours.reset(seed=0)
    action = ours.action_space.n // 2 if hasattr(ours.action_space, "n") else np.zeros(1, dtype=np.float32)
    for t in range(limit):
        if "CartPole" in case.task:
            s = ours.state
            action = int(s["x"] + 2 * s["v"] + 20 * s["theta"] + 5 * s["omega"] > 0)
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


class Deck:
    """Stands for a random generator: hands out given cards."""

    def __init__(self, cards: list[int]) -> None:
        self.cards = iter(cards)

    def choice(self, deck: Any) -> int:
        return next(self.cards)


@STEPS
def test_blackjack_is_played_as_gymnasiums(steps: int) -> None:
    theirs: Any = gym.make("Blackjack-v1").unwrapped
    ours = make("blackjack")
    task = ours.task
    layout = WordLayout.of((*task.process.next, task.process.reward, task.process.terminal, *task.next_observation))
    card, dealt = (next(d for d in layout.draws if d.type.size == n) for n in (1, 12))
    rng = np.random.default_rng(0)
    ours.reset(seed=11)
    n = 0
    game = -1
    while n < steps:
        game += 1
        if game:
            ours.reset()
        theirs.reset(seed=game)
        state = ours.state
        total, ace = state["hand"].tolist()
        theirs.player = [1, total - 1] if ace else [total // 2, total - total // 2]
        done = False
        while not done:
            words = draws.words(11, draws.STEP, n, layout.count)
            cards = [min(1 + draws.index(w, 13), 10) for w in words]
            hidden, *later = cards[layout.first[dealt.site] :][:12]
            theirs.dealer = [state["dealer"], hidden]
            action = int(rng.integers(2))
            theirs._np_random = Deck(later if action == 0 else [cards[layout.first[card.site]]])
            expected = theirs.step(action)
            found = ours.step(action)
            assert found[1:3] == expected[1:3]
            assert found[0].tolist() == [int(v) for v in expected[0]]
            n = n + 1
            done = found[2]
