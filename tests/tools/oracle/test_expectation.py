"""Expectations over all episodes: bias and variance of estimators as fractions, and refusals that say how many there are."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import oracle
from taskspec.base import limits
from taskspec.base.diagnostics import SpecError
from taskspec.language import source
from taskspec.language.task.build import build
from tests.shared.tasks import Small

Array = np.ndarray[Any, Any]
DISCOUNTED = Small(3, discount=0.5)
NOISY = """
taskspec: 1
name: Noisy
state: {s: {type: int, low: 0, high: 0}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 1
initial: {s: 0}
dynamics: {s': s}
reward: 2 if Bernoulli(1/3) else 0
"""
PROBES = {"CoinToss": [[Fraction(1, 4), Fraction(3, 4)]] * 4, "SecondThought": [[Fraction(2, 3), Fraction(1, 3)]] * 3}
probes = pytest.mark.parametrize(("task", "pi"), [(task, np.array(pi, dtype=object)) for task, pi in PROBES.items()])


def gradient(advantages: Array, episode: oracle.EnumeratedEpisode) -> Array:
    """The sum over steps of advantage times the gradient of the action's log-probability."""
    return np.asarray((advantages[:, None, None] * episode.log_prob_gradients()).sum(axis=0))


def reinforce(episode: oracle.EnumeratedEpisode) -> Array:
    G = oracle.monte_carlo(episode.rewards, episode.terminated, episode.truncated, episode.discount)
    return gradient(episode.discounts * G, episode)


@probes
def test_reinforce_has_the_exact_gradient_as_its_mean(task: str, pi: Array) -> None:
    exact = oracle.policy_gradient(task, pi, exact=True)
    found = oracle.expectation(reinforce, task, pi, exact=True)
    assert (found.mean == exact).all() and (exact != 0).any()
    values = oracle.evaluate(task, pi, exact=True)

    def with_baseline(episode: oracle.EnumeratedEpisode) -> Array:
        G = oracle.monte_carlo(episode.rewards, episode.terminated, episode.truncated, episode.discount)
        return gradient(G - values.V[episode.times, episode.states], episode)

    reduced = oracle.expectation(with_baseline, task, pi, exact=True)
    assert (reduced.mean == exact).all()
    assert reduced.variance[0, 0] < found.variance[0, 0]


def test_with_a_discount_the_weight_of_later_steps_is_a_bias() -> None:
    small = DISCOUNTED
    pi = np.array([[0.25, 0.75], [0.5, 0.5], [0.75, 0.25]])
    found = oracle.expectation(reinforce, small.task, pi, exact=True)
    assert (found.mean == oracle.policy_gradient(small.task, pi, exact=True)).all()

    def unweighted(episode: oracle.EnumeratedEpisode) -> Array:
        return gradient(
            oracle.monte_carlo(episode.rewards, episode.terminated, episode.truncated, episode.discount), episode
        )

    usual = oracle.expectation(unweighted, small.task, pi, exact=True)
    assert (usual.mean == oracle.policy_gradient(small.task, pi, discounted=False, exact=True)).all()
    assert (usual.mean != found.mean).any()


@probes
@pytest.mark.parametrize("lam", [0, Fraction(1, 2), 1])
def test_the_first_gradient_of_ppo_is_exact_with_the_right_critic(task: str, pi: Array, lam: Any) -> None:
    """In the first update all ratios are 1, and nothing is clipped: the mean over the L = 2 steps is half the gradient."""
    values = oracle.evaluate(task, pi, exact=True)
    exact = oracle.policy_gradient(task, pi, exact=True)

    def first_gradient(V: Array) -> Callable[[oracle.EnumeratedEpisode], Array]:
        def of(episode: oracle.EnumeratedEpisode) -> Array:
            before = V[episode.times, episode.states]
            after = V[episode.times + 1, episode.next_states]
            A = oracle.gae(episode.rewards, before, after, episode.terminated, episode.truncated, episode.discount, lam)
            return gradient(A, episode) / len(episode)

        return of

    assert (oracle.expectation(first_gradient(values.V), task, pi, exact=True).mean == exact / 2).all()
    zero = np.full_like(values.V, Fraction(0))  # a critic that is not trained: bias unless lambda is 1
    found = oracle.expectation(first_gradient(zero), task, pi, exact=True).mean
    bias = found - exact / 2
    assert (bias[1:] == 0).all()
    assert (bias == 0).all() if lam == 1 else (bias[0] != 0).all()
    immediate = oracle.expectation(lambda episode: gradient(episode.rewards, episode), task, pi, exact=True).mean
    assert (bias[0] == -(1 - lam) * (exact - immediate)[0] / 2).all()


def group_gradient(advantages: Callable[[Array], Array]) -> Callable[[tuple[oracle.EnumeratedEpisode, ...]], Array]:
    """The mean over a group of advantage times the gradient of the log-probability of an episode."""

    def of(group: tuple[oracle.EnumeratedEpisode, ...]) -> Array:
        A = advantages(np.array([episode.discounted_return for episode in group], dtype=object))
        parts = [a * episode.log_prob_gradients().sum(axis=0) for a, episode in zip(A, group, strict=True)]
        return np.asarray(sum(parts) * Fraction(1, len(group)))

    return of


@probes
@pytest.mark.parametrize("k", [2, 3])
def test_a_group_without_scale_has_1_minus_1_by_k_of_the_gradient(task: str, pi: Array, k: int) -> None:
    exact = oracle.policy_gradient(task, pi, exact=True)
    centred = group_gradient(lambda rewards: oracle.grpo(rewards, scale=False))
    found = oracle.expectation(centred, task, pi, episodes=k, same_start=True, exact=True)
    assert (found.mean == (1 - Fraction(1, k)) * exact).all()
    left_out = oracle.expectation(group_gradient(oracle.rloo), task, pi, episodes=k, exact=True)
    assert (left_out.mean == exact).all()


def test_a_scaled_pair_sees_the_order_of_returns_alone() -> None:
    """The coin is worth 1 and the sure thing 3/10; each is the better of a pair as often, so that GRPO learns nothing."""
    pi = np.array([[Fraction(1, 2), Fraction(1, 2)]] * 4, dtype=object)
    found = oracle.expectation(group_gradient(oracle.grpo), "CoinToss", pi, episodes=2, exact=True)
    assert found.mean[0].tolist() == [0, 0]
    assert oracle.policy_gradient("CoinToss", pi, exact=True)[0].tolist() == [Fraction(-7, 40), Fraction(7, 40)]


@pytest.mark.parametrize("small", [Small(1), DISCOUNTED, Small(6, states=4)], ids=["1", "3", "6"])
def test_means_and_variances_are_those_of_all_episodes(small: Small) -> None:
    pi = np.linspace(0.2, 0.7, small.states)
    pi = np.stack([pi, 1 - pi], axis=1)
    found = oracle.expectation(lambda episode: episode.discounted_return, small.task, pi)
    returns = []
    weights = []
    for probability, pairs, total in small.trajectories():
        if probability:
            returns.append(total)
            weights.append(probability * np.prod([pi[pair] for pair in pairs]))
    mean = np.dot(weights, returns)
    assert found.mean == pytest.approx(mean)
    assert found.variance == pytest.approx(np.dot(weights, np.square(returns)) - mean**2)
    assert found.count == len(returns)
    assert oracle.expectation(lambda episode: 1, small.task, pi).mean == pytest.approx(1)


def product(group: tuple[oracle.EnumeratedEpisode, ...]) -> Any:
    return group[0].discounted_return * group[1].discounted_return


def test_episodes_of_a_group_are_independent() -> None:
    pi = np.full((3, 2), 0.5)
    one = oracle.expectation(lambda episode: episode.discounted_return, DISCOUNTED.task, pi)
    pair = oracle.expectation(product, DISCOUNTED.task, pi, episodes=2)
    assert pair.mean == pytest.approx(one.mean**2)
    assert pair.count == one.count**2


def test_groups_may_share_their_first_state() -> None:
    pi = np.full((2, 2), 0.5)
    for same_start, probability in ((False, Fraction(10, 16)), (True, 1)):
        found = oracle.expectation(
            lambda group: int(group[0].states[0] == group[1].states[0]), "LookAlikes", pi, episodes=2, same_start=same_start,
            exact=True,
        )  # fmt: skip
        assert found.mean == probability
        assert found.count == (8 if same_start else 16)


@pytest.mark.parametrize(("name", "policy", "modifiers"), [
    ("Patience", "expert", []), ("EndInPlace", [1], []), ("ValueLeft", [1, 1], []), ("Patience", "expert", ["relabelled"]),
    ("Patience", lambda observation: int(observation[1] == 0), ["time_observed"]),
])  # fmt: skip
def test_an_episode_is_what_the_environment_returns(name: str, policy: Any, modifiers: list[str]) -> None:
    """A deterministic policy in a deterministic task has one episode; the environment replays it."""
    kept = []
    task = taskspec.load(name, modifiers=modifiers)
    found = oracle.expectation(lambda episode: kept.append(episode) or 0, task, policy)
    (episode,) = kept
    env = taskspec.make(task)
    observation, _ = env.reset(seed=0)
    for t, action in enumerate(episode.actions):
        assert np.array_equal(observation, episode.observations[t])
        observation, *rest, _ = env.step(int(action))
        assert np.array_equal(observation, episode.next_observations[t])
        assert rest == [episode.rewards[t], episode.terminated[t], episode.truncated[t]]
    assert rest[1] or rest[2]
    assert found.count == 1 and episode.probability == 1 and len(episode) == len(episode.log_probs)


def test_noise_of_rewards_is_enumerated_too() -> None:
    """The exact model has expected rewards, but a square depends on their distribution."""
    noisy = build(source.read_text(NOISY, "noisy.yaml"))
    found = oracle.expectation(lambda episode: episode.rewards.sum() ** 2, noisy, "random", exact=True)
    assert (found.mean, found.count) == (Fraction(4, 3), 4)
    continuous = build(source.read_text(NOISY.replace("2 if Bernoulli(1/3) else 0", "Normal(0, 1)"), "noisy.yaml"))
    with pytest.raises(SpecError, match=r"E712.*infinitely many"):
        oracle.expectation(reinforce, continuous, "random")


@pytest.mark.parametrize(("function", "message"), [
    (lambda episode: None, "a number or an array of numbers"), (lambda episode: "all", "a number or an array of numbers"),
    (lambda episode: np.ones(len(episode.states) if episode.actions[0] else 1), "for one episode and"),
])  # fmt: skip
def test_a_function_that_forgets_its_result_or_changes_its_shape_is_refused(function: Any, message: str) -> None:
    with pytest.raises(SpecError, match=f"E713.*{message}"):
        oracle.expectation(function, "CoinToss", "random")


def test_too_many_episodes_are_counted_and_refused() -> None:
    with pytest.raises(SpecError, match=r"E729.*2,097,152 episodes") as caught:
        oracle.expectation(reinforce, "Echo", "random")
    (problem,) = caught.value.diagnostics
    assert problem.hint == "TASKSPEC_LIMITS=enumerated=21e5 allows it"
    with pytest.raises(SpecError, match="7,776 groups of 5"), limits.also("enumerated=7000"):
        oracle.expectation(lambda group: 0, "CoinToss", "random", episodes=5)
    with pytest.raises(SpecError, match=r"more than about 10\^15"):
        oracle.expectation(reinforce, "FrozenLake", "random")
    with pytest.raises(SpecError, match="infinitely many"):
        oracle.expectation(reinforce, Small(5, horizon="none", discount=0.75).task, "random")
    with pytest.raises(SpecError, match="E713"):
        oracle.expectation(reinforce, "CoinToss", "random", episodes=0)
