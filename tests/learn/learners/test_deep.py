"""Learners with nets: their parts beside slow loops, other packages and differences, and what comes of training."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gymnasium.vector.utils import batch_space
from scipy import stats
from scipy.special import softmax

import taskspec
from taskspec.data import demonstrations
from taskspec.exact import score
from taskspec.learn.learners import learner
from taskspec.learn.learners.interface import Vectors
from taskspec.learn.learners.paper_settings import Ppo
from tests.shared.cases import Granted

jax = pytest.importorskip("jax")
pytest.importorskip("optax")
jnp = jax.numpy

from jax.flatten_util import ravel_pytree  # noqa: E402

from taskspec.learn.learners.deep.nets import ActionHead  # noqa: E402
from taskspec.learn.learners.deep.ppo import (  # noqa: E402
    PpoUpdate,
    gae,
    init_actor,
    sampler,
)
from taskspec.learn.learners.deep.world import World  # noqa: E402
from tests.shared.sparse import sparse  # noqa: E402

TASKS = ("RiskyPath", "EarlyTermNeg", "NoisyObs", "Parabola", "Sort", "ProcGoal", "LargestSum")


def head(task: str) -> ActionHead:
    return ActionHead(Vectors.of(taskspec.load(task).action_layout))


@pytest.mark.parametrize("task", ["RiskyPath", "Branching", "ProcGoal?D=3"])
def test_vectors_of_observations_are_the_features_of_the_exact_model(task: str) -> None:
    found = taskspec.data.tabular(taskspec.load(task))
    made = Vectors.of(taskspec.load(task).observation_layout)(np.asarray(found.observations))
    assert made.dtype == np.float32 and np.array_equal(made, found.features)


@pytest.mark.parametrize("name", sparse(TASKS[:3], 3))
def test_steps_of_a_world_are_those_of_the_environment(name: str) -> None:
    """Every step of every lane, with the true next observation of the last one, beside the scalar environment."""
    task = taskspec.load(name)
    world = World.of(task, absorb=False)
    noise = world.head.noise(jax.random.key(1), (40, 3))
    begun = jax.jit(world.begin, static_argnums=1)(jax.random.key(0), 3)
    _, steps = jax.lax.scan(lambda w, n: world.step(w, world.head.uniform(n)), begun, noise)
    words = np.asarray(begun.state.key, np.uint64)
    for lane in range(3):
        env = taskspec.make(task)
        seen, _ = env.reset(seed=int(words[0, lane] << np.uint64(32) | words[1, lane]))
        for t in range(40):
            assert np.allclose(world.seen(np.asarray(seen)[None])[0], steps.seen[t, lane], atol=1e-4)
            seen, reward, terminated, truncated, _ = env.step(played(world, steps.action[t, lane]))
            assert np.allclose(world.seen(np.asarray(seen)[None])[0], steps.next_seen[t, lane], atol=1e-4)
            assert np.isclose(reward, steps.reward[t, lane], atol=1e-4)
            assert (terminated or truncated) == bool(steps.ended[t, lane])
            if terminated or truncated:
                seen, _ = env.reset()


def played(world: World, action: Any) -> Any:
    return np.asarray(world.head.program_action(jnp.asarray(action)[None]))[..., 0]


def test_states_that_absorb_last_until_the_horizon_and_are_flagged() -> None:
    world = World.of(taskspec.load("EarlyTermNeg"), absorb=True)
    noise = world.head.noise(jax.random.key(1), (20, 5))
    _, steps = jax.lax.scan(lambda w, n: world.step(w, world.head.uniform(n)), world.begin(jax.random.key(0), 5), noise)
    assert np.array_equal(np.flatnonzero(np.asarray(steps.ended).all(axis=1)), [9, 19])
    assert np.asarray(steps.gone).any() and not np.asarray(steps.seen)[np.asarray(steps.gone) == 1].any()
    assert np.array_equal(steps.gone[1:10], np.maximum.accumulate(np.asarray(steps.next_gone)[:9], axis=0))
    assert not World.of(taskspec.load("LargestSum"), absorb=True).absorbs


def test_distributions_are_those_of_scipy() -> None:
    rng = np.random.default_rng(0)
    sort = head("Sort")
    parabola = head("Parabola")
    said, other = rng.standard_normal((2, 6, 8)).astype(np.float32)
    p = softmax(said.reshape(6, 2, 4), axis=-1)
    q = softmax(other.reshape(6, 2, 4), axis=-1)
    action = rng.integers(0, 4, (6, 2))
    chosen = np.take_along_axis(p, action[..., None], axis=-1)[..., 0]
    assert np.allclose(sort.log_prob(said, None, action), np.log(chosen).sum(axis=1), atol=1e-5)
    assert np.allclose(sort.entropy(said, None), stats.entropy(p, axis=-1).sum(axis=1), atol=1e-5)
    apart = stats.entropy(p, q, axis=-1).sum(axis=1)
    assert np.allclose(sort.divergence((said, None), (other, None)), apart, atol=1e-4)
    mean = said[:, :1]
    deviation = np.array([0.3], np.float32)
    real = rng.standard_normal((6, 1)).astype(np.float32)
    normal = stats.norm(mean, np.exp(deviation))
    assert np.allclose(parabola.log_prob(mean, deviation, real), normal.logpdf(real)[:, 0], atol=1e-5)
    assert np.allclose(parabola.entropy(mean, deviation), normal.entropy()[:, 0], atol=1e-5)
    drawn = parabola.sample(mean[0], deviation, parabola.noise(jax.random.key(0), (4000,)))
    assert stats.kstest(np.asarray(drawn)[:, 0], stats.norm(mean[0, 0], np.exp(0.3)).cdf).pvalue > 1e-3


def test_advantages_are_those_of_a_slow_loop() -> None:
    rng = np.random.default_rng(0)
    rewards = rng.standard_normal((7, 2))
    values = rng.standard_normal((8, 2))
    ended = rng.random((7, 2)) < 0.3
    wanted = np.zeros((7, 2))
    for lane in range(2):
        for t in range(7):
            weight = 1.0
            for k in range(t, 7):
                following = 0.0 if ended[k, lane] else values[k + 1, lane]
                wanted[t, lane] += weight * (rewards[k, lane] + 0.9 * following - values[k, lane])
                weight *= 0.9 * 0.8
                if ended[k, lane]:
                    break
    found = gae(jnp.array(rewards), jnp.array(values), jnp.array(ended, jnp.float32), 0.9, 0.8)
    assert np.allclose(found, wanted, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("task", "value_clip"), sparse([("Sort", None), ("Parabola", 0.2)], 2))
def test_the_slope_of_ppo_is_that_of_differences(task: str, value_clip: float | None) -> None:
    world = World.of(taskspec.load(task), absorb=False)
    update = PpoUpdate(Ppo(hidden=(5,), value_clip=value_clip), world)
    key = jax.random.key(0)
    held = update.init(key)
    _, steps = world.rollout(world.begin(key, 1), sampler(world, held.actor), key, 32)
    flat = steps.flat()
    noise = jax.random.normal(key, (3, 32))
    old = noise[0] * 0.1 - 1
    args = (flat.seen, flat.action, flat.weight, old, flat.seen, noise[1], noise[2])
    agrees(lambda nets: update.loss(nets, *args), (held.actor, held.critic))


def agrees(loss: Any, at: Any) -> None:
    """Whether a slope is that of differences, in a few directions, computed in float64."""
    with jax.enable_x64(True):
        at = jax.tree.map(lambda x: jnp.asarray(np.asarray(x, np.float64)), at)
        loss = jax.jit(loss)
        slope = jax.jit(jax.grad(loss))(at)
        for i in range(4):
            point, back = ravel_pytree(at)
            way = jax.random.normal(jax.random.key(i), point.shape, point.dtype)
            difference = loss(back(point + 1e-6 * way)) - loss(back(point - 1e-6 * way))
            along = jnp.vdot(ravel_pytree(slope)[0], way)
            assert np.isclose(along, difference / 2e-6, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("task", sparse(TASKS, 2))
def test_policies_in_numpy_say_what_nets_say(task: str) -> None:
    from taskspec.learn.learners.deep.policy_training import policies

    world = World.of(taskspec.load(task), absorb=False)
    actor = init_actor(jax.random.key(0), world, (16, 16))
    (policy,) = policies(Granted(task), world, jax.tree.map(lambda x: x[None], actor))
    env = world.task.observation_space
    env.seed(0)
    seen = batch_space(env, 5).sample()
    from taskspec.learn.learners.deep.nets import forward

    said = np.asarray(forward(actor.net, world.seen(jnp.asarray(seen))))
    chosen = policy.predict(seen, deterministic=True)[0]
    actions = world.task.action_space
    assert batch_space(actions, 5).contains(np.asarray(chosen, actions.dtype))
    if world.head.deviations:
        assert np.allclose(chosen, np.clip(said, actions.low, actions.high), atol=1e-5)
        return
    joint = np.ones((5, 1))
    for part in np.split(said, np.cumsum(world.head.vectors.counts)[:-1], axis=1):
        joint = np.einsum("na,nb->nab", joint, softmax(part, axis=1)).reshape(5, -1)
    assert np.allclose(policy.action_probabilities(seen), joint, atol=1e-5)
    drawn = policy.predict(np.repeat(seen[:1], 300, axis=0))[0]
    assert len(np.unique(np.asarray(drawn).reshape(300, -1)[:, 0])) == world.head.vectors.counts[0]


def test_ties_are_drawn() -> None:
    from taskspec.learn.learners.interface import NetPolicy

    vectors = Vectors.of(taskspec.load("RiskyPath").observation_layout)
    flat = NetPolicy(vectors, head("RiskyPath").vectors, [(np.zeros((4, 2)), np.zeros(2))], np.zeros(0))
    chosen = flat.predict(np.zeros(200, int), deterministic=True)[0]
    assert 50 < chosen.sum() < 150


@pytest.mark.slow
def test_seeds_of_a_block_are_trained_as_one_and_counted() -> None:
    case = Granted("RiskyPath", steps=1300, seeds=2)
    first, second = learner("ppo")(case)
    assert case.counted == 1280 and [steps for steps, _ in case.curve] == list(range(128, 1280, 128))
    assert not np.array_equal(first.layers[0][0], second.layers[0][0])


@pytest.mark.slow
@pytest.mark.parametrize(("task", "steps"), [("RiskyPath", 60_000), ("EarlyTermPos", 20_000), ("NoisyObs?L=5", 60_000)])
def test_ppo_learns_from_the_reward(task: str, steps: int) -> None:
    case = Granted(task, steps, seeds=3)
    for policy in learner("ppo")(case):
        assert score(task, policy, deterministic=True, episodes=300).normalised > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "least"), [("Branching", 0.99), ("Parabola", 0.98), ("Sort", 0.6), ("NoisyObs?L=5", 0.9)]
)
def test_clones_do_as_the_expert(task: str, least: float) -> None:
    for policy in learner("bc")(Granted(task, seeds=2)):
        assert score(task, policy, deterministic=True, episodes=300).normalised > least


@pytest.mark.slow
def test_a_clone_chooses_as_often_as_was_shown() -> None:
    """Of an expert who draws, the fraction of each action in each state."""
    shown = demonstrations("RiskyPath", "soft(1)", transitions=4000)
    counts = np.zeros((4, 2))
    np.add.at(counts, (shown.obs, shown.acts), 1)
    asked = learner("bc")
    asked = replace(asked, settings=replace(asked.settings, updates=1500, hidden=(16,), batch=256, epochs=1))
    (policy,) = asked(Granted("RiskyPath", demonstrations=shown))
    found = policy.action_probabilities(np.arange(4))
    wanted = counts / np.maximum(1, counts.sum(1, keepdims=True))
    often = counts.sum(axis=1) > 500
    assert often.sum() >= 2 and np.allclose(found[often], wanted[often], atol=0.06)
