"""Tasks as environments of gymnax: its wrappers, its spaces, and a learner that knows nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import taskspec
from tests.shared.sections import build_text

jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402

from taskspec.programs.jax import Functional  # noqa: E402

SIDES = """
summary: On which side of the line is the point?
state:
  x: {type: real, shape: [2], low: -1, high: 1}
action:
  side: {type: int, low: -1, high: 0}
horizon: 5
initial: {x: "Uniform(-1, 1, shape=2)"}
dynamics: {x': "Uniform(-1, 1, shape=2)"}
reward: 1 if side == (0 if x[0] > x[1] else -1) else 0
"""
ODD = """
summary: Values that do not count from zero.
state:
  s: {type: int, low: 3, high: 6}
  y: {type: real}
action:
  a: {type: int, low: -2, high: 2}
horizon: 4
initial: {s: 3, y: 0}
dynamics: {s': "clip(s + a, 3, 6)", y': "Normal(0, 1)"}
reward: s'
observation: SEEN
"""


def adapted(text: str) -> Any:
    return Functional(build_text(text)).gymnax()


def odd(seen: str) -> Any:
    return adapted(ODD.replace("SEEN", seen))


def test_steps_have_the_shape_of_gymnax() -> None:
    env = Functional(taskspec.load("derail/RiskyPath-v0")).gymnax()
    key = jax.random.key(3)
    seen, state = env.reset(key, env.default_params)
    assert int(seen) == 0
    assert len(env.step(key, state, jnp.int32(1), env.default_params)) == 6
    assert len(env.step_env(key, state, jnp.int32(1), env.default_params)) == 5
    assert (env.num_actions, env.default_params.max_steps_in_episode) == (2, 5)
    for _ in range(5):
        assert not env.is_truncated(state)
        _, state, _, terminated, _ = env.step_env(key, state, jnp.int32(0))
    assert env.is_truncated(state)
    assert not terminated


def test_finite_values_count_from_zero() -> None:
    env = odd("{s: s}")
    key = jax.random.key(0)
    seen, state = env.reset(key)
    assert int(seen) == 0
    for action, expected in ((3, 1), (4, 3), (0, 1)):
        seen, state, reward, _, _, info = env.step(key, state, jnp.int32(action))
        assert (int(seen), int(info["final_observation"])) == (expected, expected)
        assert reward == 3 + expected
    seen, state, *_, truncated, info = env.step(key, state, jnp.int32(4))
    assert (int(seen), int(info["final_observation"]), bool(truncated)) == (0, 3, True)


@pytest.mark.parametrize(
    "case",
    [
        "derail/RiskyPath-v0",
        "derail/NoisyObs-v0",
        "derail/Parabola-v0",
        "derail/Sort-v0",
        "{s: s}",
        "{s: s, y: y, space: dict}",
        "{s: s, space: multi_discrete}",
        "{s: s, space: one_hot}",
    ],
)
def test_values_lie_in_the_spaces(case: str) -> None:
    pytest.importorskip("gymnax")
    env = Functional(taskspec.load(case)).gymnax() if "/" in case else odd(case)
    key = jax.random.key(0)
    seen, state = env.reset(key, env.default_params)
    for k in range(8):
        action = env.action_space(env.default_params).sample(jax.random.key(k))
        space = env.observation_space(env.default_params)
        if isinstance(seen, dict):
            assert seen.keys() == space.spaces.keys()
            assert all(bool(s.contains(seen[name])) for name, s in space.spaces.items())
        else:
            assert bool(space.contains(seen))
            assert seen.shape == space.shape
            assert seen.dtype == space.dtype
        seen, state, *_ = env.step(key, state, action, env.default_params)


# -- a learner, written for gymnax alone --------------------------------------------------------------------------


def train(env: Any, lanes: int, updates: int, length: int = 8, rate: float = 1.0) -> Any:
    """Advantage actor-critic with linear functions, in the style of PureJaxRL; gives the mean reward of every update."""
    params = env.default_params
    actions = env.action_space(params).n
    (features,) = env.observation_space(params).shape

    def policy(weights: Any, seen: Any) -> Any:
        return jax.nn.log_softmax(seen @ weights["actor"])

    def act(carry: Any, _: Any) -> Any:
        weights, state, seen, key = carry
        key, to_act, to_step = jax.random.split(key, 3)
        action = jax.random.categorical(to_act, policy(weights, seen))
        each = jax.random.split(to_step, lanes)
        following, state, reward, done, info = jax.vmap(env.step, in_axes=(0, 0, 0, None))(each, state, action, params)
        return (weights, state, following, key), (seen, action, reward, done, info)

    def loss(weights: Any, seen: Any, action: Any, returns: Any) -> Any:
        value = seen @ weights["critic"]
        taken = jnp.take_along_axis(policy(weights, seen), action[..., None], -1)[..., 0]
        return jnp.mean((returns - value) ** 2 - taken * jax.lax.stop_gradient(returns - value))

    def discounted(following: Any, step: Any) -> Any:
        total = step[0] + 0.5 * following * (1 - step[1])
        return total, total

    def update(carry: Any, _: Any) -> Any:
        carry, (seen, action, reward, done, info) = jax.lax.scan(act, carry, None, length)
        weights, *rest = carry
        _, returns = jax.lax.scan(discounted, jnp.zeros(lanes), (reward, done), reverse=True)
        slopes = jax.grad(loss)(weights, seen, action, returns)
        weights = jax.tree.map(lambda w, g: w - rate * g, weights, slopes)
        return (weights, *rest), (reward.mean(), info["returned_episode_returns"].mean())

    @jax.jit
    def run(key: Any) -> Any:
        seen, state = jax.vmap(env.reset, in_axes=(0, None))(jax.random.split(key, lanes), params)
        weights = {"actor": jnp.zeros((features, actions)), "critic": jnp.zeros(features)}
        return jax.lax.scan(update, (weights, state, seen, key), None, updates)[1]

    return run(jax.random.key(1))


def test_a_learner_for_gymnax_learns() -> None:
    gymnax = pytest.importorskip("gymnax")
    purerl, compat = (pytest.importorskip(f"gymnax.wrappers.{name}") for name in ("purerl", "compat"))

    def wrapped(env: Any) -> Any:
        return compat.LegacyStepAPIWrapper(purerl.LogWrapper(purerl.FlattenObservationWrapper(env)))

    rewards, returns = train(wrapped(adapted(SIDES)), lanes=32, updates=400)
    assert rewards[0] < 0.7
    assert rewards[-10:].mean() > 0.9
    assert returns[-10:].mean() > 4.4
    of_theirs, _ = train(wrapped(gymnax.make("CartPole-v1")[0]), lanes=4, updates=2)
    of_ours, _ = train(wrapped(Functional(taskspec.load("derail/NoisyObs-v0")).gymnax()), lanes=4, updates=2)
    assert np.isfinite([*of_theirs, *of_ours]).all()


def test_parameters_that_would_have_no_effect_are_refused() -> None:
    params = Functional("RiskyPath").gymnax().default_params
    assert params.replace() == params.replace(max_steps_in_episode=5) == params
    with pytest.raises(taskspec.SpecError, match="E713"):
        params.replace(max_steps_in_episode=3)


PAIRED = """
state: {s: {type: int, low: 3, high: 6}, d: {type: bool}}
action: {x: {type: choice, values: [down, stay, up]}, y: {type: int, low: 5, high: 6}}
horizon: 9
initial: {s: 4, d: false}
dynamics: {s': "clip(s + x - 1, 3, 6)", d': y == 6}
reward: 10 * x + y
observation: {space: multi_discrete, s: s, d: d}
"""


def test_observations_may_be_one_hot_and_actions_one_number() -> None:
    task = build_text(PAIRED)
    plain = Functional(task).gymnax()
    changed = Functional(task).gymnax(one_hot=True, flat_actions=True)
    assert changed.num_actions == 6 and plain.num_actions == 2
    key = jax.random.key(0)
    (seen, one) = plain.reset(key)
    (shown, other) = changed.reset(key)
    for flat in (5, 0, 3, 4, 1, 2):
        expected = np.zeros(6)
        expected[[int(seen[0]), 4 + int(seen[1])]] = 1
        assert np.array_equal(shown, expected) and shown.dtype == jnp.float32
        seen, one, reward, *_ = plain.step(key, one, jnp.array([flat // 2, flat % 2]))
        shown, other, found, *_ = jax.jit(changed.step)(key, other, jnp.int32(flat))
        assert found == reward == 10 * (flat // 2) + 5 + flat % 2


def test_options_for_what_is_not_finite_are_refused() -> None:
    for options in ({"one_hot": True}, {"flat_actions": True}):
        with pytest.raises(taskspec.SpecError, match="E713"):
            Functional("derail/Parabola").gymnax(**options)


def test_spaces_of_the_options_hold_their_values() -> None:
    pytest.importorskip("gymnax")
    env = Functional(build_text(PAIRED)).gymnax(one_hot=True, flat_actions=True)
    seen, _ = env.reset(jax.random.key(0))
    assert env.action_space().n == 6
    assert env.observation_space().shape == seen.shape and bool(env.observation_space().contains(seen))
