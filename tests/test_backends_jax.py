"""The JAX program as pure functions: under jit, vmap and scan, in gymnax's shape, as Gymnasium's FuncEnv."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import taskspec

jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402

from taskspec.backends.jax import Functional  # noqa: E402
from taskspec.backends.jax.library import threefry  # noqa: E402
from taskspec.envs.functional import TaskFuncEnv  # noqa: E402


def scalar_episode(name: str, seed: int, actions: Any) -> tuple[list[Any], list[float]]:
    env = taskspec.make(name)
    seen, rewards = [env.reset(seed=seed)[0]], []
    for action in actions:
        obs, reward, terminated, truncated, _ = env.step(action)
        rewards.append(reward)
        seen.append(env.reset()[0] if terminated or truncated else obs)
    return seen, rewards


def test_threefry_gives_the_published_answers() -> None:
    """Known answers of Random123 for threefry2x32, 20 rounds."""
    ones = jnp.uint32(0xFFFFFFFF)
    known = [
        ((0, 0, 0, 0), (0x6B200159, 0x99BA4EFE)),
        ((ones, ones, ones, ones), (0x1CB996FC, 0xBB002BE7)),
        ((0x13198A2E, 0x03707344, 0x243F6A88, 0x85A308D3), (0xC4923A9C, 0x483DF7A0)),
    ]
    for words, answer in known:
        assert tuple(int(x) for x in threefry(*(jnp.uint32(w) for w in words))) == answer


@pytest.mark.parametrize("name", ["derail/RiskyPath-v0", "derail/Sort-v0", "derail/NoisyObs-v0"])
def test_the_key_is_the_seed(name: str) -> None:
    functional = Functional(taskspec.load(name))
    env = taskspec.make(name)
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(30)]
    expected, rewards = scalar_episode(name, 7, actions)
    seen, state = jax.jit(functional.reset)(jax.random.key(7))
    np.testing.assert_allclose(seen, expected[0], rtol=2e-6, atol=2e-6)
    step = jax.jit(functional.step)
    for action, following, reward in zip(actions, expected[1:], rewards, strict=True):
        seen, state, paid, _, _ = step(state, jnp.array(action))
        np.testing.assert_allclose(seen, following, rtol=2e-6, atol=2e-6)
        assert float(paid) == reward


def test_vmap_and_scan() -> None:
    """Environments in a batch over the first axis, all steps in one scan."""
    functional = Functional(taskspec.load("derail/RiskyPath-v0"))
    keys = jnp.stack([jax.random.key_data(jax.random.key(s)) for s in range(5)])
    actions = jnp.array(np.random.default_rng(0).integers(0, 2, (20, 5)))
    _, states = jax.vmap(functional.reset)(keys)

    def body(states: Any, action: Any) -> Any:
        seen, states, reward, done, _ = jax.vmap(functional.step)(states, action)
        return states, (seen, reward, done)

    _, (seen, rewards, _) = jax.jit(lambda s: jax.lax.scan(body, s, actions))(states)
    for lane in range(5):
        expected, paid = scalar_episode("derail/RiskyPath-v0", lane, [int(a) for a in actions[:, lane]])
        assert seen[:, lane].tolist() == expected[1:]
        assert rewards[:, lane].tolist() == paid


def test_the_shape_of_gymnax() -> None:
    env = Functional(taskspec.load("derail/RiskyPath-v0")).gymnax()
    key = jax.random.key(3)
    seen, state = env.reset(key, env.default_params)
    following = env.step(key, state, jnp.int32(1), env.default_params)
    assert len(following) == 6
    assert len(env.step_env(key, state, jnp.int32(1))) == 5
    assert env.num_actions == 2
    assert int(seen) == 0


def test_func_env() -> None:
    task = taskspec.load("derail/EarlyTermPos-v0")
    env, scalar = TaskFuncEnv(task), task.make()
    key = jax.random.key(0)
    state = env.initial(key)
    assert int(env.observation(state, key)) == scalar.reset(seed=0)[0]
    for action in (1, 1):
        following = env.transition(state, jnp.int32(action), key)
        seen, reward, terminated, _, _ = scalar.step(action)
        assert int(env.observation(following, key)) == seen
        assert float(env.reward(state, action, following, key)) == reward
        assert bool(env.terminal(following, key)) == terminated
        state = following
