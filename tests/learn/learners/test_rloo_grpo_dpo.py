"""RLOO, GRPO and DPO: their advantages and losses beside the oracle, and what they learn."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import oracle
from taskspec.learn.learners import learner

jax = pytest.importorskip("jax")
pytest.importorskip("optax")
jnp = jax.numpy

from taskspec.learn.learners.deep import rloo_grpo_dpo  # noqa: E402
from taskspec.learn.learners.deep.ppo import init_actor  # noqa: E402
from taskspec.learn.learners.deep.world import World  # noqa: E402

TASK = "derail/EarlyTermPos-v0"  # whose episodes are of unequal length
AVERAGES: dict[str, Any] = {"episode": "sequence", "step": "token", "sum": 1}


@cache
def played() -> tuple[World, Any, Any, rloo_grpo_dpo.GroupEpisodes]:
    """Two policies, and six pairs of episodes of the first."""
    world = World.of(taskspec.load(TASK), absorb=False)
    first, second, begin, noise = jax.random.split(jax.random.key(3), 4)
    actor = init_actor(first, world, (8,))
    other = init_actor(second, world, (8,))
    louder = other._replace(net=jax.tree.map(lambda x: 3 * x, other.net))
    play = jax.jit(
        lambda actor: rloo_grpo_dpo.play(world, actor, rloo_grpo_dpo.begin_groups(world, begin, 6, 2), noise)
    )
    return world, actor, louder, play(actor)


def test_a_group_begins_in_one_state_and_goes_on_by_chance() -> None:
    world = World.of(taskspec.load("derail/NoisyObs-v0"), absorb=False)
    walk = jax.jit(lambda key: rloo_grpo_dpo.begin_groups(world, key, 5, 4))(jax.random.key(0))
    seen = np.asarray(walk.seen).reshape(5, 4, -1)
    assert (seen == seen[:, :1]).all()
    assert len(np.unique(np.asarray(walk.state.key), axis=1).T) == 20


def test_episodes_are_over_at_their_ends() -> None:
    _, _, _, episodes = played()
    ended = np.asarray(episodes.steps.ended)
    live = np.asarray(episodes.live)
    assert np.array_equal(live, np.cumsum(ended, axis=0) - ended == 0)
    assert len(np.unique(live.sum(axis=0))) > 2


@pytest.mark.parametrize("name", ["rloo", "grpo"])
def test_advantages_are_those_of_the_oracle(name: str) -> None:
    update = rloo_grpo_dpo.GroupUpdate(learner(f"paper/{name}").settings, World.of(taskspec.load(TASK), absorb=False))
    gained = np.random.default_rng(0).normal(size=(4, 8))
    gained[1] = 2.0
    if name == "rloo":
        expected = oracle.rloo(gained)
    else:
        expected = oracle.grpo(gained, ddof=1, epsilon=rloo_grpo_dpo.SMALL)
    actual = np.asarray(update.advantages(jnp.array(gained.reshape(-1)))).reshape(4, 8)
    assert np.allclose(actual, expected, atol=1e-4)
    assert not actual[1].any()


@pytest.mark.parametrize("average", AVERAGES)
def test_the_loss_of_groups_is_the_oracle_s(average: Any) -> None:
    world, actor, other, episodes = played()
    config = replace(learner("paper/grpo").settings, average=average, kl=0.3)
    update = rloo_grpo_dpo.GroupUpdate(config, world)
    log_probs = rloo_grpo_dpo.log_probs(world, actor, episodes)
    reference = rloo_grpo_dpo.log_probs(world, other, episodes)
    advantages = jnp.linspace(-1, 2, 12)
    old = log_probs + jnp.linspace(-0.5, 0.5, 12)
    actual = jax.jit(update.loss)(actor, episodes, old, reference, advantages)
    expected = oracle.grpo_loss(
        np.asarray(log_probs, float).T, np.asarray(old, float).T, np.asarray(advantages), np.asarray(episodes.live).T == 1,
        average=AVERAGES[average], reference_log_probs=np.asarray(reference).T, beta=0.3,
    )  # fmt: skip
    assert float(actual) == pytest.approx(expected, rel=1e-4)


def test_the_loss_of_comparisons_is_the_oracle_s() -> None:
    world, actor, other, episodes = played()
    update = rloo_grpo_dpo.DirectUpdate(learner("dpo").settings, world, world)
    reference = rloo_grpo_dpo.log_probs(world, other, episodes)
    actual = jax.jit(update.loss)(actor, episodes, reference, jnp.array([[1.0, 0.0], [0.0, 1.0]] * 3))
    log_probs = jnp.stack([rloo_grpo_dpo.log_probs(world, actor, episodes), reference])
    totals = np.asarray((log_probs * episodes.live).sum(axis=1), float).reshape(2, 6, 2)
    totals[:, 1::2] = totals[:, 1::2, ::-1]  # the chosen one of each pair first
    now, before = totals
    expected = oracle.dpo_loss(now[:, 0], now[:, 1], before[:, 0], before[:, 1])
    assert float(actual) == pytest.approx(expected, rel=1e-4)
