"""GAIL, AIRL and TRPO: their parts beside dense solutions, differences and closed forms, and what comes of training."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy import stats

import taskspec
from taskspec.data import demonstrations
from taskspec.exact import score
from taskspec.learn.learners import learner
from taskspec.learn.learners.paper_settings import Adversarial, Experience, Ppo, Reward, Trpo
from tests.shared.cases import Granted

jax = pytest.importorskip("jax")
pytest.importorskip("optax")
jnp = jax.numpy

from taskspec.learn.learners.deep.gail_airl import Discriminator  # noqa: E402
from taskspec.learn.learners.deep.ppo import init_actor, sampler  # noqa: E402
from taskspec.learn.learners.deep.reward_nets import RewardInputs, RewardModel, demonstration_inputs, reward_inputs  # noqa: E402
from taskspec.learn.learners.deep.trpo import TrpoUpdate, objective, ridge_regression  # noqa: E402
from taskspec.learn.learners.deep.world import StepBatch, World, in_complete_episode  # noqa: E402
from tests.learn.learners.test_deep import agrees  # noqa: E402
from tests.shared.sparse import sparse  # noqa: E402


@lru_cache
def walked(task: str, config: Trpo | Ppo, steps: int = 40, absorb: bool = False) -> tuple[World, Any, StepBatch]:
    world = World.of(taskspec.load(task), absorb)
    held = TrpoUpdate(Trpo(config.experience, hidden=config.hidden), world).init(jax.random.key(0))

    @jax.jit
    def walk(actor: Any) -> StepBatch:
        begun = world.begin(jax.random.key(2), 1)
        return world.rollout(begun, sampler(world, actor), jax.random.key(1), steps)[1]

    return world, held, walk(held.actor)


@pytest.mark.slow
def test_the_step_of_trpo_is_that_of_a_dense_solution() -> None:
    config = Trpo(hidden=(2,), cg_iterations=60, damping=0.05, fisher_every=1)
    world, held, steps = walked("RiskyPath", config)
    gains = jax.random.normal(jax.random.key(3), (40,))
    start, whole = jax.flatten_util.ravel_pytree(held.actor)
    after = jax.flatten_util.ravel_pytree(
        TrpoUpdate(config, world).natural_gradient_step(held.actor, steps.flat(), gains)
    )[0]
    better, apart = objective(world, held.actor, steps.flat(), gains, 0.0)
    slope = np.asarray(jax.grad(lambda x: better(whole(x)))(start), np.float64)
    fisher = np.asarray(jax.hessian(lambda x: apart(whole(x)))(start), np.float64) + 0.05 * np.eye(len(start))
    way = np.linalg.solve(fisher, slope)
    wanted = way * np.sqrt(2 * config.kl / (way @ fisher @ way))
    found = np.asarray(after - start, np.float64)
    shrunk = np.log2(np.linalg.norm(wanted) / np.linalg.norm(found))
    assert np.isclose(shrunk, round(shrunk), atol=0.01)
    assert np.allclose(found * 2 ** round(shrunk), wanted, atol=2e-3 * np.abs(wanted).max())
    assert better(whole(after)) > better(held.actor) and apart(whole(after)) <= config.accepted_kl


@pytest.mark.slow
def test_a_step_that_would_be_refused_is_not_taken() -> None:
    config = Trpo(hidden=(2,), strict=True)
    world, held, steps = walked("RiskyPath", config)
    after = TrpoUpdate(config, world).natural_gradient_step(held.actor, steps.flat(), jnp.zeros(40))
    assert all(jax.tree.leaves(jax.tree.map(np.array_equal, after, held.actor)))


def test_the_regression_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((50, 4))
    targets = rng.standard_normal(50)
    weight = (rng.random(50) < 0.7).astype(float)
    some = weight > 0
    wanted = np.linalg.lstsq(rows[some], targets[some], rcond=None)[0]
    assert np.allclose(
        ridge_regression(jnp.array(rows), jnp.array(targets), jnp.array(weight), 1e-6), wanted, atol=1e-4
    )
    twice = np.hstack([rows, rows])  # as where what is one-hot is its own square
    found = ridge_regression(jnp.array(twice), jnp.array(targets), jnp.array(weight), 0.0)
    assert np.allclose(twice @ np.asarray(found), rows @ wanted, atol=1e-3)


def test_steps_of_whole_episodes_count() -> None:
    _, _, steps = walked("EarlyTermPos", Ppo(hidden=(4,)), steps=25)
    last = int(np.flatnonzero(np.asarray(steps.ended)[:, 0])[-1])
    assert np.array_equal(np.asarray(in_complete_episode(steps))[:, 0], np.arange(25) <= last)


def test_demonstrations_that_end_early_stay_where_states_absorb() -> None:
    world = World.of(taskspec.load("EarlyTermNeg"), absorb=True)
    shown = demonstrations("EarlyTermNeg", episodes=7)
    found = demonstration_inputs(world, shown)
    assert len(found.gone) == 70 and found.gone.sum() == 70 - len(shown)
    assert found.next_gone.sum() == found.gone.sum() + 7
    assert not found.seen[found.gone == 1].any() and not found.next_seen[found.next_gone == 1].any()
    plain = demonstration_inputs(World.of(taskspec.load("EarlyTermNeg"), absorb=False), shown)
    assert len(plain.gone) == len(shown) and not plain.next_gone.any()


@pytest.mark.slow
@pytest.mark.parametrize(("task", "shaped"), sparse([("EarlyTermNeg", True), ("Parabola", False)], 2))
def test_the_slope_of_the_discriminator_is_that_of_differences(task: str, shaped: bool) -> None:
    world, held, steps = walked(task, Ppo(hidden=(4,)), absorb=True)
    config = Adversarial(
        reward=Reward(hidden=(5,), activation="tanh", shaped=shaped, scaled=True), minus_log_policy=shaped, entropy=0.1
    )
    judge = Discriminator(config, world)
    nets, _ = judge.init(jax.random.key(0))
    own = reward_inputs(steps.flat())
    shown = demonstration_inputs(world, demonstrations(task, episodes=3))
    agrees(lambda way: judge.loss(way, nets, held.actor, own, shown), (nets.theta, nets.phi))


def test_the_best_discriminator_of_two_piles_knows_their_odds() -> None:
    """With D a table over states and actions, l is the logarithm of the ratio of frequencies, which the pay then is."""
    world, held, _ = walked("RiskyPath", Ppo(hidden=(4,)))
    judge = Discriminator(Adversarial(reward=Reward(hidden=(), learning_rate=0.05), pay="l"), world)
    nets, optimiser = judge.init(jax.random.key(0))

    def pile(first: int) -> RewardInputs:
        action = (np.arange(100) >= first).astype(np.int32)[:, None]
        zero = np.zeros(100, np.float32)
        seen = np.tile(np.eye(4, dtype=np.float32)[0], (100, 1))
        return RewardInputs(
            *map(jnp.asarray, (seen, zero, action, np.eye(2, dtype=np.float32)[action[:, 0]], seen, zero))
        )

    own = pile(80)
    shown = pile(20)
    judge.config = replace(judge.config, updates=1500)
    update = jax.jit(lambda *learned: judge.update(*learned, lambda key: (own, shown), jax.random.key(0)))
    nets, _ = update(nets, optimiser, held.actor)
    assert np.allclose(judge.pay(nets, held.actor, own)[jnp.array([0, 99])], np.log([0.25, 4.0]), atol=0.02)


@pytest.mark.parametrize(("pay", "least", "most"), [("softplus(l)", 0, np.inf), ("-softplus(-l)", -np.inf, 0)])
def test_pay_has_its_sign(pay: Any, least: float, most: float) -> None:
    world, held, steps = walked("RiskyPath", Ppo(hidden=(4,)))
    judge = Discriminator(Adversarial(pay=pay), world)
    nets, _ = judge.init(jax.random.key(0))
    found = judge.pay(nets, held.actor, reward_inputs(steps))
    logit = np.asarray(judge.logit(nets, held.actor, reward_inputs(steps)), np.float64)
    exact = -np.log(1 - 1 / (1 + np.exp(-logit))) if least == 0 else np.log(1 / (1 + np.exp(-logit)))
    assert np.allclose(found, exact, atol=1e-5) and (found >= least).all() and (found <= most).all()


@pytest.mark.parametrize(("task", "standardised"), [("EarlyTermNeg", False), ("Parabola", True)])
def test_rewards_in_numpy_say_what_nets_say(task: str, standardised: bool) -> None:
    world = World.of(taskspec.load(task), absorb=True)
    judge = RewardModel(Reward(hidden=(6,), shaped=True, scaled=True, standardised=standardised), world, 0.99)
    shown = demonstrations(task, episodes=3)
    at = demonstration_inputs(world, shown)
    nets = judge.with_statistics(judge.init(jax.random.key(0)), at.seen)
    said = judge.learned(nets, "f")(shown.obs, shown.acts, shown.next_obs)
    goes_on = np.asarray(at.next_gone)[: len(shown)] == 0
    assert np.allclose(said[goes_on], np.asarray(judge(nets, at))[: len(shown)][goes_on], atol=1e-4)


def test_the_deviation_as_variance_is_the_density_that_it_is() -> None:
    world = World.of(taskspec.load("Parabola"), absorb=False)
    actor = init_actor(jax.random.key(0), world, (4,))._replace(deviations=jnp.array([0.8]))
    config = Adversarial(minus_log_policy=True, deviation_as_variance=True)
    judge = Discriminator(config, world)
    nets, _ = judge.init(jax.random.key(0))
    at = demonstration_inputs(world, demonstrations("Parabola", episodes=3))
    from taskspec.learn.learners.deep.nets import forward

    wrong = stats.norm(np.asarray(forward(actor.net, at.seen)), np.exp(0.4)).logpdf(np.asarray(at.action))[:, 0]
    assert np.allclose(judge.reward(nets, at) - judge.logit(nets, actor, at), wrong, atol=1e-4)


def scores(name: str, task: str, steps: int, family: str = "corrected", seeds: int = 2) -> list[float]:
    found = learner(name, family)(Granted(task, steps, seeds))
    return [score(task, p, episodes=300).normalised for p in found]


@pytest.mark.slow
@pytest.mark.parametrize("task", ["EarlyTermPos", "EarlyTermNeg", "RiskyPath"])
@pytest.mark.parametrize("name", ["gail_im", "gail_fu", "gail_sb", "airl_im_sa", "airl_fu"])
def test_mended_learners_imitate(name: str, task: str) -> None:
    assert min(scores(name, task, 100_000)) > 0.7


@pytest.mark.slow
def test_the_sign_of_the_pay_decides_about_survival() -> None:
    """As published, where the end of an episode is worth 0: a pay that is positive stays on, one that is negative leaves."""
    assert min(scores("gail_im", "EarlyTermPos", 100_000, "paper")) > 0.9
    assert max(scores("gail_im", "EarlyTermNeg", 100_000, "paper")) < 0
    assert max(scores("gail_fu", "EarlyTermPos", 100_000, "paper")) < 0.2
    assert min(scores("gail_fu", "EarlyTermNeg", 100_000, "paper")) > 0.9


@pytest.mark.slow
@pytest.mark.slow
def test_rounds_are_counted_as_the_family_counts_them() -> None:
    config = learner("gail_sb", "paper").settings
    small = replace(config, policy=replace(config.policy, hidden=(4,), experience=Experience(steps=64)))
    case = Granted("RiskyPath", steps=130)
    (policy,) = replace(learner("gail_sb", "paper"), settings=small)(case)
    assert case.counted == 128  # two rounds of three times 64 steps, of which every third is counted
    assert np.isfinite(policy.reward(np.array([0, 1]), np.array([0, 1]), np.array([1, 2]))).all()
