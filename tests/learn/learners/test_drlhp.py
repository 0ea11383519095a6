"""Learning from comparisons: what is asked, the loss beside differences, and what comes of training."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exact import score
from taskspec.learn.learners import learner
from taskspec.learn.learners.paper_settings import Comparing, Experience, Novelty, Ppo, Reward
from tests.shared.cases import Granted

jax = pytest.importorskip("jax")
pytest.importorskip("optax")
jnp = jax.numpy

from taskspec.learn.learners.deep.drlhp import PreferenceRound  # noqa: E402
from taskspec.learn.learners.deep.policy_training import init_policy_state  # noqa: E402
from taskspec.learn.learners.deep.ppo import PpoUpdate  # noqa: E402
from taskspec.learn.learners.deep.reward_nets import NoveltyBonus, reward_inputs  # noqa: E402
from taskspec.learn.learners.deep.world import World  # noqa: E402
from tests.learn.learners.test_deep import agrees  # noqa: E402
from tests.shared.sparse import sparse  # noqa: E402


@lru_cache
def asking(task: str, absorb: bool = False, **settings: Any) -> tuple[PreferenceRound, Any]:
    """A round of comparisons, and what it is of: its pairs and steps."""
    world = World.of(taskspec.load(task), absorb)
    policy = Ppo(Experience(absorb=absorb), hidden=(4,))
    reward = Reward(hidden=(4,), activation="tanh", shaped=True, scaled=True)
    found = PreferenceRound(Comparing(policy, reward, episodes=8, **settings), PpoUpdate(policy, world), world)
    return found, jax.jit(found.query)(init_policy_state(found.policy, jax.random.key(0)), jax.random.key(1))


@pytest.mark.slow
@pytest.mark.parametrize(("task", "absorb"), sparse([("RiskyPath", False), ("EarlyTermNeg", True)], 2))
def test_neighbours_are_compared_by_their_returns(task: str, absorb: bool) -> None:
    found, (pairs, steps) = asking(task, absorb, total=False)
    returns = np.asarray(steps.reward).sum(axis=0)
    assert len(returns) == 8 and len(pairs.better) == found.pairs == 4
    assert np.allclose(pairs.better, (np.sign(returns[::2] - returns[1::2]) + 1) / 2)
    assert np.array_equal(pairs.weight, np.ones(4)) and len(set(np.asarray(pairs.better).tolist())) > 1


@pytest.mark.slow
def test_where_lengths_differ_steps_are_compared_and_tie() -> None:
    """On EarlyTerm every step pays the same, so that there is nothing to learn from."""
    found, (pairs, steps) = asking("EarlyTermNeg", total=True)
    assert pairs.live.shape[2] == 1 and found.pairs == 40
    lengths = np.argmax(np.asarray(steps.ended), axis=0) + 1
    assert 0 < int((np.asarray(pairs.live).sum(axis=(1, 2)) == 2).sum()) == lengths.sum() // 2
    nets = found.init(jax.random.key(0)).nets
    slope = jax.grad(found.loss)((nets.theta, nets.phi), nets, pairs)
    assert not any(np.asarray(leaf).any() for leaf in jax.tree.leaves(slope))


@pytest.mark.slow
def test_noise_may_be_said_to_hide_rewards() -> None:
    assert not np.asarray(asking("NoisyObs?L=2", noise_ties=True)[1][0].weight).any()
    assert np.asarray(asking("RiskyPath", noise_ties=True)[1][0].weight).any()


@pytest.mark.slow
@pytest.mark.parametrize("total", sparse([True, False], 2))
def test_the_slope_of_the_loss_is_that_of_differences(total: bool) -> None:
    found, (pairs, _) = asking("RiskyPath", total=total)
    nets = found.reward.init(jax.random.key(0))
    agrees(lambda way: found.loss(way, nets, pairs), (nets.theta, nets.phi))


def test_the_loss_is_that_of_bradley_and_terry() -> None:
    found, (pairs, _) = asking("RiskyPath", total=False)
    nets = found.reward.init(jax.random.key(0))
    sums = np.asarray(found.reward(nets, pairs.at), np.float64).sum(axis=2)
    first = np.exp(sums[:, 0]) / np.exp(sums).sum(axis=1)
    better = np.asarray(pairs.better)
    wanted = -(better * np.log(first) + (1 - better) * np.log(1 - first)).mean()
    assert np.isclose(found.loss((nets.theta, nets.phi), nets, pairs), wanted, atol=1e-5)


@pytest.mark.slow
def test_actions_are_random_as_often_as_they_are_said_to_be() -> None:
    """Of a policy that is all but sure of the first action."""
    for share in (0.0, 1.0):
        found, _ = asking("Branching", random=share)
        learning = init_policy_state(found.policy, jax.random.key(0))
        actor = learning.policy.actor
        *inner, (w, b) = actor.net
        sure = actor._replace(net=(*inner, (w, b + jnp.array([30.0, 0.0]))))
        steps = found.query(learning._replace(policy=learning.policy._replace(actor=sure)), jax.random.key(1))[1]
        assert abs(np.asarray(steps.action).mean() - share / 2) <= 0.2 * share


@pytest.mark.slow
def test_what_is_known_is_no_longer_new() -> None:
    world = World.of(taskspec.load("RiskyPath"), False)
    curious = NoveltyBonus(Novelty(hidden=(8,), outputs=4, learning_rate=0.01), world)
    novel = curious.init(jax.random.key(0))
    _, (_, steps) = asking("RiskyPath")
    at = reward_inputs(steps)
    before = curious.distance(novel.learner, novel.target, at).mean()
    after = jax.lax.fori_loop(0, 200, lambda _, n: curious.fit(n, at), novel)
    assert curious.distance(after.learner, after.target, at).mean() < 0.1 * before
    bonus, moved = curious.bonus(novel, at)
    mean = 0.0
    variance = 1.0
    for error, paid in zip(np.ravel(curious.distance(novel.learner, novel.target, at)), np.ravel(bonus), strict=True):
        mean = 0.99 * mean + 0.01 * error
        variance = 0.99 * variance + 0.01 * (error - mean) ** 2
        assert np.isclose(paid, 0.5 * (error - mean) / np.sqrt(variance), atol=1e-4)
    assert np.isclose(moved.mean, mean, atol=1e-5)


@pytest.mark.slow
@pytest.mark.slow
def test_comparisons_are_counted() -> None:
    asked = learner("drlhp_rnd")
    config = asked.settings
    small = replace(config, episodes=4, policy=replace(config.policy, hidden=(4,)))
    case = Granted("RiskyPath", steps=400)
    (policy,) = replace(asked, settings=small)(case)
    assert (case.counted, case.compared) == (384, 6)
    assert np.isfinite(policy.reward(np.array([0]), np.array([1]), np.array([2]))).all()


@pytest.mark.slow
@pytest.mark.parametrize("task", ["EarlyTermPos", "EarlyTermNeg", "InitShiftLearner"])
def test_mended_learners_find_what_is_preferred(task: str) -> None:
    for policy in learner("drlhp_sa")(Granted(task, 60_000, seeds=2)):
        assert score(task, policy).normalised > 0.9


@pytest.mark.slow
def test_a_reward_of_the_state_says_nothing_of_the_largest_sum() -> None:
    found = [
        score("LargestSum", p, episodes=2000).normalised for p in learner("drlhp_so")(Granted("LargestSum", 30_000, 3))
    ]
    assert np.allclose(found, 0, atol=0.15)
