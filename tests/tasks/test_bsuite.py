"""The behaviour suite, step by step beside the package `bsuite`, from the same states and with the same actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

import taskspec

environments = pytest.importorskip("bsuite.environments")
from bsuite.environments import (  # noqa: E402
    bandit,
    cartpole,
    catch,
    deep_sea,
    discounting_chain,
    memory_chain,
    mountain_car,
    umbrella_chain,
)

State = Callable[[Any], Mapping[str, Any]]
STEPS = 10_000


def compare(ours: Any, theirs: Any, state: State, seen: Callable[[Any], Any], exact: bool = True) -> None:
    """Step both with random actions; `seen` is what of an observation is compared."""
    rng = np.random.default_rng(3)
    timestep = theirs.reset()
    observation, _ = ours.reset(seed=0, options={"state": state(theirs)})
    for _ in range(STEPS):
        np.testing.assert_allclose(seen(observation), seen(timestep.observation), atol=2e-5)
        action = int(rng.integers(ours.action_space.n))
        timestep = theirs.step(action)
        observation, reward, terminated, truncated, _ = ours.step(action)
        assert (terminated or truncated) == timestep.last()
        if exact:
            assert reward == pytest.approx(timestep.reward, abs=1e-12)
        if timestep.last():
            timestep = theirs.reset()
            observation, _ = ours.reset(options={"state": state(theirs)})


def flat(observation: Any) -> Any:
    return np.ravel(np.asarray(observation, dtype=float))


def test_cartpole() -> None:
    def state(theirs: Any) -> Mapping[str, Any]:
        s = theirs._state
        return {"x": s.x, "v": s.x_dot, "theta": s.theta, "w": s.theta_dot}

    compare(taskspec.make("bsuite/CartPole"), cartpole.Cartpole(seed=1), state, flat)


def test_mountain_car() -> None:
    def state(theirs: Any) -> Mapping[str, Any]:
        return {"x": theirs._position, "v": theirs._velocity}

    compare(taskspec.make("bsuite/MountainCar"), mountain_car.MountainCar(seed=1), state, flat)


def test_catch() -> None:
    def state(theirs: Any) -> Mapping[str, Any]:
        return {"ball": [theirs._ball_x, theirs._ball_y], "paddle": theirs._paddle_x}

    compare(taskspec.make("bsuite/Catch"), catch.Catch(seed=1), state, flat)


def test_deep_sea_without_its_mapping() -> None:
    with pytest.warns(UserWarning, match="debug mode"):
        theirs = deep_sea.DeepSea(10, randomize_actions=False)
    ours = taskspec.make("bsuite/DeepSea")
    right = np.asarray(ours.task.constants["right"])
    rng = np.random.default_rng(3)
    for _ in range(1000):
        timestep = theirs.reset()
        observation, _ = ours.reset()
        while not timestep.last():
            np.testing.assert_array_equal(flat(observation), flat(timestep.observation))
            wanted = int(rng.random() < 0.8)
            action = right[theirs._row, theirs._column]
            timestep = theirs.step(wanted)
            observation, reward, terminated, _, _ = ours.step(int(action if wanted else 1 - action))
            assert terminated == timestep.last()
            assert reward == pytest.approx(timestep.reward)


@pytest.mark.parametrize("seed", range(5))
def test_discounting_chain(seed: int) -> None:
    theirs = discounting_chain.DiscountingChain(mapping_seed=seed)
    compare(taskspec.make("bsuite/DiscountingChain", mapping_seed=seed), theirs, lambda _: {"chain": -1}, flat)


@pytest.mark.parametrize(("length", "bits"), [(3, 1), (2, 3), (10, 1)])
def test_memory_chain(length: int, bits: int) -> None:
    def state(theirs: Any) -> Mapping[str, Any]:
        return {"context": theirs._context.astype(bool), "query": theirs._query}

    theirs = memory_chain.MemoryChain(length, bits, seed=1)
    compare(taskspec.make("bsuite/MemoryLength", length=length, bits=bits), theirs, state, flat)


def test_umbrella_chain() -> None:
    def state(theirs: Any) -> Mapping[str, Any]:
        return {"need": bool(theirs._need_umbrella), "has": bool(theirs._has_umbrella)}

    def seen(observation: Any) -> Any:
        return flat(observation)[:3]

    theirs = umbrella_chain.UmbrellaChain(20, 20, seed=1)
    compare(taskspec.make("bsuite/Umbrella"), theirs, state, seen, exact=False)


def test_bandit_pays_the_same_in_another_order() -> None:
    theirs = bandit.SimpleBandit(mapping_seed=1)
    ours = taskspec.make("bsuite/Bandit")
    found = []
    for arm in range(11):
        ours.reset()
        found.append(ours.step(arm)[1])
    np.testing.assert_allclose(sorted(found), sorted(theirs._rewards))
