"""Twelve mistakes of public code, rebuilt as small functions: the oracle fails each and passes its repair.

Each entry names the public thread that reported it. Functions are ours: short, and wrong in the way of the report. Two correct
implementations that were reported as wrong are acquitted.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from taskspec import oracle

Array = np.ndarray[Any, Any]
GAMMA = 0.9
LAM = 0.75
B = oracle.batch(seed=1)
END = B.terminated
CUT = B.dones


def backwards(delta: Array, weight: Array, last: Any = 0.0) -> Array:
    """Sums of delta, weighted from row to row."""
    found = np.zeros_like(delta)
    following = last
    for t in reversed(range(len(delta))):
        following = delta[t] + weight[t] * following
        found[t] = following
    return found


def close(found: Array, expected: Array) -> bool:
    return np.allclose(np.asarray(found, np.float64), np.asarray(expected, np.float64))


# -- 1: the value after the last row is counted twice (simonsays1980/rl-triton #4) ------------------------------------


def gae_boundary(last: Any) -> Array:
    delta = B.rewards + GAMMA * ~END * B.next_values - B.values
    return backwards(delta, GAMMA * LAM * ~CUT, last)


def is_gae(advantages: Array) -> bool:
    return close(advantages, oracle.gae(B.rewards, B.values, B.next_values, END, B.truncated, GAMMA, LAM))


# -- 2: V-trace takes the target of the next episode after a truncation (pytorch/rl #4209) ----------------------------


def vtrace_advantages(is_repaired: bool) -> Array:
    rho = np.minimum(1.0, B.ratios)
    delta = rho * (B.rewards + GAMMA * ~END * B.next_values - B.values)
    v = B.values + backwards(delta, GAMMA * rho * ~CUT)
    following = np.concatenate([v[1:], B.next_values[-1:]])
    if is_repaired:
        following = np.where(CUT, B.next_values, following)
    return rho * (B.rewards + GAMMA * ~END * following - B.values)


def is_vtrace(advantages: Array) -> bool:
    found = oracle.vtrace(B.rewards, B.values, B.next_values, END, B.truncated, B.ratios, GAMMA)
    return close(advantages, found[1])


# -- 3: the flag of the step after decides (DLR-RM/stable-baselines3 #105) --------------------------------------------


def gae_from_starts(stored: Array, last: Array) -> Array:
    """Advantages of a buffer whose rows hold whether an observation is the first of an episode; ends are all alike."""
    goes_on = ~np.concatenate([stored[1:], last[None]])
    following = np.concatenate([B.values[1:], B.last_values[None]])
    return backwards(B.rewards + GAMMA * goes_on * following - B.values, GAMMA * LAM * goes_on)


def is_gae_of_ends(advantages: Array) -> bool:
    none = np.zeros_like(CUT)
    return close(advantages, oracle.gae(B.rewards, B.values, B.next_values, CUT, none, GAMMA, LAM))


# -- 4: a step is stored with the reward of the step before (openai/spinningup #67) -----------------------------------


def reinforce(rewards: Array, episode: oracle.EnumeratedEpisode) -> Array:
    G = backwards(rewards, episode.discount * np.ones(len(rewards)))
    return np.asarray((G[:, None, None] * episode.log_prob_gradients()).sum(axis=0))


def stored_late(episode: oracle.EnumeratedEpisode) -> Array:
    return reinforce(np.concatenate([[0.0], episode.rewards[:-1]]), episode)


def stored_with_its_action(episode: oracle.EnumeratedEpisode) -> Array:
    return reinforce(episode.rewards, episode)


PI = np.array([[0.25, 0.75], [0.5, 0.5], [0.75, 0.25]])


def is_gradient(estimate: Callable[[oracle.EnumeratedEpisode], Array]) -> bool:
    return close(oracle.expectation(estimate, "Sizes", PI).mean, oracle.policy_gradient("Sizes", PI))


# -- 5: the policy learns from returns, and the critic is not subtracted (bentrevett/pytorch-rl #2) -------------------


def returns_minus(baseline: Any) -> Array:
    after = np.where(END, 0.0, B.next_values)
    is_cut = CUT.copy()
    is_cut[-1] = True
    return backwards(B.rewards + GAMMA * np.where(is_cut, after, 0.0), GAMMA * ~is_cut) - baseline


def is_advantage(weights: Array) -> bool:
    return close(weights, oracle.gae(B.rewards, B.values, B.next_values, END, B.truncated, GAMMA, 1))


# -- 6: rewards are discounted by their time, and not summed (hunkim/ReinforcementZeroToAll #1) -----------------------


def discounted(rewards: Array) -> Array:
    return rewards * GAMMA ** np.arange(len(rewards))


def discounted_and_summed(rewards: Array) -> Array:
    return backwards(rewards, GAMMA * np.ones(len(rewards)))


def is_return(function: Callable[[Array], Array]) -> bool:
    rewards = B.rewards[:, 0]
    none = np.zeros(len(rewards), np.bool_)
    return close(function(rewards), oracle.monte_carlo(rewards, none, none, GAMMA))


# -- 7: deviations of the whole batch in place of the group's (XU-YIJIE/grpo-flat #2) ---------------------------------

REWARDS = np.array([[1.0, 0.0, 0.0, 1.0], [5.0, 5.0, 4.0, 2.0], [3.0, 3.0, 3.0, 3.0]])


def group_advantages(axis: int | None) -> Array:
    centred = REWARDS - REWARDS.mean(axis=axis, keepdims=True)
    return centred / (REWARDS.std(axis=axis, ddof=1, keepdims=True) + 1e-4)


def is_grpo(advantages: Array) -> bool:
    return close(advantages, oracle.grpo(REWARDS, ddof=1, epsilon=1e-4))


# -- 8: a mean over the padded length in place of the sum over tokens (QwenAudio/CosyVoice #1449) ---------------------

TOKENS = np.log(np.random.default_rng(0).uniform(0.1, 0.9, (4, 3, 6)))  # chosen, rejected, and both of the reference
LENGTHS = [[6, 4, 2], [3, 6, 5]]
MASKS = np.arange(6) < np.array(LENGTHS)[..., None]


def dpo(sequence: Callable[[Array, Array], Array]) -> float:
    chosen, rejected, ref_chosen, ref_rejected = (
        sequence(tokens, mask) for tokens, mask in zip(TOKENS, [*MASKS, *MASKS], strict=True)
    )
    margin = 0.1 * ((chosen - ref_chosen) - (rejected - ref_rejected))
    return float(np.log1p(np.exp(-margin)).mean())


def whole(tokens: Array, lengths: list[int]) -> list[float]:
    """Log-probabilities of sequences: sums over the tokens that were sampled."""
    return [float(row[:length].sum()) for row, length in zip(tokens, lengths, strict=True)]


def is_dpo(loss: float) -> bool:
    chosen, rejected = LENGTHS
    expected = oracle.dpo_loss(
        whole(TOKENS[0], chosen), whole(TOKENS[1], rejected), whole(TOKENS[2], chosen), whole(TOKENS[3], rejected)
    )
    return close(np.array(loss), np.array(expected))


# -- 9: the time limit ends the world (Toni-SM/skrl #449) -------------------------------------------------------------


def gae_masked_by(ends: Array) -> Array:
    return backwards(B.rewards + GAMMA * ~ends * B.next_values - B.values, GAMMA * LAM * ~CUT)


# -- 10: three-step returns reach over a truncation (tensorflow/agents #939) ------------------------------------------


def three_steps(stops_at: Array) -> Array:
    found = np.zeros_like(B.rewards)
    for t in range(len(found)):
        weight = np.ones(4)
        for k in range(t, min(t + 3, len(found))):
            found[t] += weight * B.rewards[k]
            is_last = stops_at[k] | (k == min(t + 3, len(found)) - 1)
            found[t] += weight * GAMMA * np.where(is_last & ~END[k], B.next_values[k], 0.0)
            weight = weight * GAMMA * ~is_last
    return found


def is_three_steps(returns: Array) -> bool:
    return close(returns, oracle.n_step_returns(B.rewards, B.next_values, END, B.truncated, GAMMA, 3))


# -- 11: only one of two terms of a lambda-return is masked (vwxyzjn/cleanrl #494) ------------------------------------


def lambda_returns(mask_of_the_rest: Array) -> Array:
    found = np.zeros_like(B.rewards)
    later = B.last_values
    for t in reversed(range(len(found))):
        one = (1 - LAM) * B.next_values[t] * ~CUT[t]
        found[t] = B.rewards[t] + GAMMA * (LAM * later * mask_of_the_rest[t] + one)
        later = found[t]
    return found


def is_lambda_return_of_ends(returns: Array) -> bool:
    none = np.zeros_like(CUT)
    return close(returns, oracle.lambda_returns(B.rewards, B.next_values, CUT, none, GAMMA, LAM))


# -- 12: the mean of log-probabilities times the sum of returns (Farama-Foundation/Gymnasium #1336) -------------------


def mean_first(episode: oracle.EnumeratedEpisode) -> Array:
    G = backwards(episode.rewards, np.ones(len(episode)))
    return np.asarray(episode.log_prob_gradients().mean(axis=0) * G.sum())


MISTAKES: dict[str, tuple[Callable[[Any], bool], Any, Any]] = {
    "bootstrapped twice at the edge": (is_gae, gae_boundary(B.last_values), gae_boundary(0.0)),
    "V-trace over a truncation": (is_vtrace, vtrace_advantages(False), vtrace_advantages(True)),
    "done flag shifted": (is_gae_of_ends, gae_from_starts(CUT, CUT[-1]), gae_from_starts(B.starts, CUT[-1])),
    "reward shifted": (is_gradient, stored_late, stored_with_its_action),
    "return instead of advantage": (is_advantage, returns_minus(0.0), returns_minus(B.values)),
    "discount in the wrong place": (is_return, discounted, discounted_and_summed),
    "deviation of the batch": (is_grpo, group_advantages(None), group_advantages(1)),
    "mean over the padded length": (
        is_dpo, dpo(lambda x, mask: (x * mask).mean(axis=-1)), dpo(lambda x, mask: (x * mask).sum(axis=-1)),
    ),
    "the time limit is an end": (is_gae, gae_masked_by(CUT), gae_masked_by(END)),
    "n steps over a truncation": (is_three_steps, three_steps(END), three_steps(CUT)),
    "mask forgotten": (is_lambda_return_of_ends, lambda_returns(np.ones_like(CUT)), lambda_returns(~CUT)),
    "mean of log-probabilities": (is_gradient, mean_first, stored_with_its_action),
}  # fmt: skip


@pytest.mark.parametrize(("judge", "wrong", "repaired"), MISTAKES.values(), ids=MISTAKES.keys())
def test_the_mistake_fails_and_its_repair_passes(judge: Callable[[Any], bool], wrong: Any, repaired: Any) -> None:
    assert not judge(wrong)
    assert judge(repaired)


# -- reported as wrong, and right -------------------------------------------------------------------------------------


def test_a_mask_that_is_in_the_next_values_already_is_acquitted() -> None:
    """thu-ml/tianshou #869: the TD error has no mask, as the values of ends are 0 before it is taken."""
    masked = B.next_values * ~END
    assert is_gae(backwards(B.rewards + GAMMA * masked - B.values, GAMMA * LAM * ~CUT))


def test_flags_of_observations_are_one_row_late_and_acquitted() -> None:
    """vwxyzjn/cleanrl #393: `dones[t + 1]` is right where `dones[t]` says that observation t is the first of an episode."""
    assert is_gae_of_ends(gae_from_starts(B.starts, CUT[-1]))
