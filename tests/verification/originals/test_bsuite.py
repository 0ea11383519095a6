"""The behaviour suite beside the package `bsuite` 0.3.6."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import taskspec
from tests.verification.originals.beside import STEPS, Case, DmEnv, State, among_outcomes, cases, flat, side_by_side

pytest.importorskip("bsuite.environments")
from bsuite.environments import (
    bandit,
    cartpole,
    catch,
    deep_sea,
    discounting_chain,
    memory_chain,
    mountain_car,
    umbrella_chain,
)
from bsuite.experiments.cartpole_swingup.cartpole_swingup import CartpoleSwingup
from bsuite.utils.wrappers import RewardScale


def pole(env: Any) -> State:
    s = env._state
    return {"x": s.x, "v": s.x_dot, "theta": s.theta, "w": s.theta_dot}


def car(env: Any) -> State:
    return {"x": env._position, "v": env._velocity}


def falling(env: Any) -> State:
    return {"ball": [env._ball_x, env._ball_y], "paddle": env._paddle_x}


def chain(env: Any) -> State:
    return {"chain": env._context}


def context(env: Any) -> State:
    return {"context": env._context.astype(bool), "query": env._query}


def depth(env: Any) -> State:
    return {"row": env._row, "col": env._column}


def umbrella(env: Any) -> State:
    return {"need": bool(env._need_umbrella), "has": bool(env._has_umbrella)}


CASES = [
    Case("bsuite/CartPole", lambda: DmEnv(cartpole.Cartpole(seed=1), pole)),
    Case("bsuite/CartPoleSwingUp", lambda: DmEnv(CartpoleSwingup(seed=1), pole)),
    Case(
        "bsuite/CartPoleSwingUp",
        lambda: DmEnv(CartpoleSwingup(height_threshold=0.9, x_reward_threshold=0.1, seed=1), pole),
        {"height": 0.9, "reach": 0.1},
    ),
    Case("bsuite/MountainCar", lambda: DmEnv(mountain_car.MountainCar(seed=1), car)),
    Case("bsuite/Catch", lambda: DmEnv(catch.Catch(seed=1), falling)),
    *[
        Case(
            "bsuite/DiscountingChain",
            lambda k=k: DmEnv(discounting_chain.DiscountingChain(mapping_seed=k), chain),
            {"mapping_seed": k},
        )
        for k in range(5)
    ],
    *[
        Case(
            "bsuite/MemoryLength",
            lambda length=length, bits=bits: DmEnv(memory_chain.MemoryChain(length, bits, seed=1), context),
            {"length": length, "bits": bits},
        )
        for length, bits in [(3, 1), (2, 3), (10, 1)]
    ],
]
UMBRELLA = Case("bsuite/Umbrella", lambda: DmEnv(umbrella_chain.UmbrellaChain(20, 20, seed=1), umbrella))
MORE = [
    UMBRELLA,
    Case("bsuite/DeepSea", lambda: DmEnv(deep_sea.DeepSea(10, mapping_seed=0), depth)),
    Case("bsuite/Bandit", lambda: DmEnv(bandit.SimpleBandit(mapping_seed=1), lambda env: {"s": 0})),
]


@STEPS
@cases(CASES)
def test_families(case: Case, steps: int) -> None:
    assert side_by_side(case.make(), case.original(), steps, tolerance=2e-5) > 0


@STEPS
def test_umbrella(steps: int) -> None:
    """Also the rewards that are coin tosses, as their distribution."""
    ours = UMBRELLA.make()
    assert among_outcomes(ours.task, UMBRELLA.original(), steps) > 0
    assert side_by_side(ours, UMBRELLA.original(), steps, seen=lambda o: flat(o)[:3], rewards=False) > 0


class Quiet:
    """A generator of random numbers whose normal ones are 0."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.RandomState(seed)

    def rand(self) -> float:
        return self.rng.rand()

    def randn(self) -> float:
        return 0.0


@STEPS
@pytest.mark.parametrize("stochastic", [False, True])
def test_deep_sea(stochastic: bool, steps: int) -> None:
    """With our meanings of actions; the noise of the last rewards is left out."""
    task = taskspec.load("bsuite/DeepSeaStochastic" if stochastic else "bsuite/DeepSea")
    theirs = deep_sea.DeepSea(10, deterministic=not stochastic, mapping_seed=0)
    theirs._action_mapping = np.asarray(task.constants["right"])
    theirs._rng = Quiet(1)

    def act(rng: np.random.Generator, at: State, space: Any) -> int:
        """Mostly to the right."""
        right = theirs._action_mapping[at["row"], at["col"]]
        return int(right if rng.random() < 0.8 else 1 - right)

    if stochastic:
        assert among_outcomes(task, DmEnv(theirs, depth), steps, act=act) > 0
    else:
        assert side_by_side(taskspec.make(task), DmEnv(theirs, depth), steps, act=act, tolerance=1e-12) > 0


def test_bandit_pays_the_same_in_another_order() -> None:
    theirs = bandit.SimpleBandit(mapping_seed=1)
    ours = taskspec.make("bsuite/Bandit")
    found = []
    for arm in range(11):
        ours.reset()
        found.append(ours.step(arm)[1])
    np.testing.assert_allclose(sorted(found), sorted(theirs._rewards))


def test_scaled_rewards_are_a_modifier() -> None:
    theirs = DmEnv(RewardScale(catch.Catch(seed=1), 100), lambda env: falling(env._env))
    assert side_by_side(taskspec.make("bsuite/Catch-v0+reward_scale=100"), theirs, 500) > 0
