"""Advantages within groups, and losses, each by its published definition.

A group is the last axis of an array of rewards: k samples for one prompt, (k,) or (G, k) for G prompts. Token arrays are (n, L):
n sequences, padded to the same length L; the mask is True for tokens that were sampled.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import misused
from taskspec.tools.oracle.estimators import check_shapes, flags, numbers


def rloo(rewards: Any) -> Array:
    """Return leave-one-out advantages, A_i = r_i - sum over j != i of r_j / (k - 1).

    Args:
        rewards: (k,) or (G, k), k of at least 2.

    Returns:
        The same shape, in the unit of the reward.

    Raises:
        SpecError: E713 for groups of one.

    Source: W. Kool, H. van Hoof and M. Welling, Buy 4 REINFORCE samples, get a baseline for free! (2019); A. Ahmadian et al.,
    Back to basics: revisiting REINFORCE style optimization for learning from human feedback in LLMs (2024).
    """
    (rewards,) = numbers(rewards)
    k = rewards.shape[-1]
    if k < 2:
        misused("a group of one has no others to leave it out of", "at least two samples")
    others = rewards.sum(axis=-1, keepdims=True) - rewards
    return np.asarray(rewards - others / (k - 1))


def grpo(rewards: Any, *, scale: bool = True, ddof: int = 0, epsilon: Any = 0) -> Array:
    """Return group-relative advantages, A_i = (r_i - mean(r)) / (std(r) + epsilon).

    A group whose rewards are all equal has advantages of 0.

    Args:
        rewards: (k,) or (G, k).
        scale: whether to divide by the standard deviation; False is Dr. GRPO, whose mean is (1 - 1/k) of the gradient.
        ddof: 0 divides by k under the root, 1 by k - 1, as `torch.std` does. The paper does not say which.
        epsilon: added to the standard deviation; 0 in the paper, 1e-4 in TRL.

    Returns:
        The same shape; without a unit if scaled.

    Raises:
        SpecError: E713 where rewards are fractions, and a standard deviation is none.

    Source: Z. Shao et al., DeepSeekMath (2024), section 4.1.2; Z. Liu et al., Understanding R1-Zero-like training (2025),
    section 3.2.
    """
    rewards, epsilon = numbers(rewards, epsilon)
    k = rewards.shape[-1]
    centred = rewards - rewards.sum(axis=-1, keepdims=True) / k
    if not scale:
        return np.asarray(centred)
    variance = (centred * centred).sum(axis=-1, keepdims=True) / (k - ddof)
    deviation = _root(variance) + epsilon
    return np.asarray(centred / np.where(variance == 0, 1, deviation))


def _root(values: Array) -> Array:
    if values.dtype != object:
        return np.sqrt(values)
    return np.asarray(np.vectorize(_fraction_root, otypes=[object])(values))


def _fraction_root(value: Any) -> Fraction:
    value = Fraction(value)
    root = Fraction(math.isqrt(value.numerator), math.isqrt(value.denominator))
    if root * root != value:
        misused(f"the standard deviation of these rewards is the root of {value}, which is no fraction", "give floats")
    return root


def ppo_loss(log_probs: Any, old_log_probs: Any, advantages: Any, clip: float = 0.2) -> float:
    """Return PPO's clipped loss, -mean(min(rho A, clip(rho, 1 - eps, 1 + eps) A)) with rho = pi(a | s) / pi_old(a | s).

    Args:
        log_probs, old_log_probs: (...), of the actions that were taken.
        advantages: (...).
        clip: eps.

    Returns:
        A number to be minimised, in the unit of the advantages.

    Source: J. Schulman, F. Wolski, P. Dhariwal, A. Radford and O. Klimov, Proximal policy optimization algorithms (2017),
    equation (7), negated.
    """
    new, old, A = numbers(log_probs, old_log_probs, advantages)
    check_shapes(log_probs=new, old_log_probs=old, advantages=A)
    return float(-_clipped(new, old, A, clip, clip).mean())


def _clipped(log_probs: Any, old_log_probs: Any, advantages: Any, low: float, high: float) -> Array:
    new, old, A = (np.asarray(each, np.float64) for each in numbers(log_probs, old_log_probs, advantages))
    rho = np.exp(new - old)
    return np.minimum(rho * A, np.clip(rho, 1 - low, 1 + high) * A)


def grpo_loss(
    log_probs: Any, old_log_probs: Any, advantages: Any, mask: Any, *, clip: float = 0.2, clip_high: float | None = None,
    average: Literal["sequence", "token"] | int = "sequence", reference_log_probs: Any = None, beta: float = 0.0,
) -> float:  # fmt: skip
    """Return GRPO's loss: PPO's clipped objective of each token minus beta times a KL term, averaged and negated.

        "sequence":  1/n sum over i of 1/|o_i| sum over tokens t of i,    as in DeepSeekMath;
        "token":     1/(sum over i of |o_i|) sum over i, t,               as in DAPO;
        a number L:  1/n sum over i of 1/L sum over t,                    as in Dr. GRPO.

    Padding counts neither in sums nor in lengths. The KL term is pi_ref/pi - log(pi_ref/pi) - 1.

    Args:
        log_probs, old_log_probs: (n, L), of the tokens.
        advantages: (n,), one of each sequence, or (n, L).
        mask: bool (n, L), the tokens that were sampled.
        clip: eps below 1, and above it unless `clip_high` is given.
        clip_high: eps above 1.
        average: how tokens are averaged.
        reference_log_probs: (n, L), of a reference policy.
        beta: the weight of the KL term.

    Returns:
        A number to be minimised.

    Raises:
        SpecError: E713 for another average, or a KL term without a reference.

    Source: Shao et al. (2024), equations (3) and (4); Q. Yu et al., DAPO (2025), equation (8); Liu et al. (2025), section 3.2.
    """
    log_probs, old_log_probs, advantages = numbers(log_probs, old_log_probs, advantages)
    (mask,) = flags(mask)
    if advantages.ndim == 1:
        advantages = advantages[:, None]
    if clip_high is None:
        clip_high = clip
    each = _clipped(log_probs, old_log_probs, advantages, clip, clip_high)
    if beta:
        if reference_log_probs is None:
            misused("the KL term needs a reference policy", "`reference_log_probs`, or beta=0")
        (reference,) = numbers(reference_log_probs)
        each = each - beta * (np.exp(reference - log_probs) - (reference - log_probs) - 1)
    total = np.where(mask, each, 0).sum(axis=1)
    match average:
        case "sequence":
            return float(-(total / mask.sum(axis=1)).mean())
        case "token":
            return float(-total.sum() / mask.sum())
        case int():
            return float(-(total / average).mean())
    misused(f"'{average}' is no average", '"sequence", "token" or a length')


# -- preferences ------------------------------------------------------------------------------------------------------


def bradley_terry_loss(chosen: Any, rejected: Any, labels: Any = 1) -> float:
    """Return the loss of a reward model, -mean(mu log P + (1 - mu) log(1 - P)) with P = 1 / (1 + exp(r_rejected - r_chosen)).

    Args:
        chosen, rejected: (n,), the rewards that the model gives, summed over segments where these are compared.
        labels: (n,), mu: 1 where the first is preferred, 0 where the second is, 1/2 where neither is.

    Returns:
        A number of at least 0 to be minimised, in nats.

    Source: P. Christiano et al., Deep reinforcement learning from human preferences (2017), section 2.2.3, equation (1).
    """
    chosen, rejected, labels = (each.astype(np.float64) for each in numbers(chosen, rejected, labels))
    check_shapes(chosen=chosen, rejected=rejected, labels=labels)
    margin = chosen - rejected
    return float(np.mean(labels * np.logaddexp(0, -margin) + (1 - labels) * np.logaddexp(0, margin)))


def dpo_loss(chosen: Any, rejected: Any, reference_chosen: Any, reference_rejected: Any, beta: float = 0.1) -> float:
    """Return DPO's loss, -mean(log sigma(beta ((log pi_w - log ref_w) - (log pi_l - log ref_l)))).

    Args:
        chosen, rejected: (n,), log-probabilities of whole sequences under the policy: sums over tokens, not means.
        reference_chosen, reference_rejected: (n,), the same under the reference policy.
        beta: the inverse temperature.

    Returns:
        A number of at least 0 to be minimised, in nats.

    Source: R. Rafailov et al., Direct preference optimization (2023), equation (7).
    """
    chosen, rejected, ref_chosen, ref_rejected = numbers(chosen, rejected, reference_chosen, reference_rejected)
    return bradley_terry_loss(beta * (chosen - ref_chosen), beta * (rejected - ref_rejected))
