"""Group advantages and losses: identities, cases by hand, and padding."""

import math
from fractions import Fraction

import numpy as np
import pytest

from taskspec import oracle
from taskspec.base.diagnostics import SpecError

GROUPS = np.array([[Fraction(1), Fraction(0), Fraction(1, 2)], [Fraction(2), Fraction(2), Fraction(2)]], dtype=object)


def test_leave_one_out_is_centred_times_k_by_k_less_1() -> None:
    centred = oracle.grpo(GROUPS, scale=False)
    assert (oracle.rloo(GROUPS) == Fraction(3, 2) * centred).all()
    assert oracle.rloo(GROUPS)[0].tolist() == [Fraction(3, 4), Fraction(-3, 4), 0]
    with pytest.raises(SpecError, match="E713"):
        oracle.rloo([1.0])


def test_grpo_divides_by_the_deviation_of_each_group() -> None:
    rewards = np.array([[0, 4], [1, 1]]).astype(object) * Fraction(1)
    assert oracle.grpo(rewards).tolist() == [[-1, 1], [0, 0]]
    found = oracle.grpo([[1.0, 0.0, 0.0], [5.0, 3.0, 1.0]], ddof=1, epsilon=1e-4)
    for row, scaled in zip(np.array([[1.0, 0.0, 0.0], [5.0, 3.0, 1.0]]), found, strict=True):
        assert np.allclose(scaled, (row - row.mean()) / (row.std(ddof=1) + 1e-4))
    with pytest.raises(SpecError, match="no fraction"):
        oracle.grpo(GROUPS)


def test_ppo_s_loss_in_its_four_cases() -> None:
    ratio = np.array([2.0, 2.0, 0.5, 0.5])
    advantage = np.array([1.0, -1.0, 1.0, -1.0])
    clipped = [-1.2, 2.0, -0.5, 0.8]  # it is the worse of both
    each = [oracle.ppo_loss([math.log(r)], [0.0], [a]) for r, a in zip(ratio, advantage, strict=True)]
    assert np.allclose(each, clipped)
    assert oracle.ppo_loss(np.log(ratio), np.zeros(4), advantage) == pytest.approx(np.mean(clipped))


def test_grpo_s_loss_averages_in_three_ways_and_ignores_padding() -> None:
    mask = np.array([[1, 1, 1, 1], [1, 0, 0, 0]], np.bool_)
    advantages = np.array([1.0, -2.0])
    zero = np.zeros((2, 4))
    means = {
        average: oracle.grpo_loss(zero, zero, advantages, mask, average=average) for average in ("sequence", "token", 4)
    }
    assert means == {"sequence": 0.5, "token": -0.4, 4: -0.25}
    padded = np.where(mask, zero, 9.0)
    assert oracle.grpo_loss(padded, zero, advantages, mask) == means["sequence"]
    with_kl = oracle.grpo_loss(zero, zero, advantages, mask, reference_log_probs=zero + math.log(2), beta=0.1)
    assert with_kl == pytest.approx(0.5 + 0.1 * (2 - math.log(2) - 1))
    with pytest.raises(SpecError, match="E713"):
        oracle.grpo_loss(zero, zero, advantages, mask, beta=0.1)


def test_losses_of_preferences() -> None:
    assert oracle.bradley_terry_loss([3.0], [1.0]) == pytest.approx(-math.log(1 / (1 + math.exp(-2))))
    assert oracle.bradley_terry_loss([3.0], [1.0], [0]) == oracle.bradley_terry_loss([1.0], [3.0])
    assert oracle.bradley_terry_loss([1000.0], [0.0], [0.5]) == 500.0
    assert oracle.dpo_loss([-1.0], [-2.0], [-1.0], [-2.0]) == pytest.approx(math.log(2))
    implicit = oracle.dpo_loss([-1.0], [-2.0], [-4.0], [-3.0], beta=0.5)
    assert implicit == oracle.bradley_terry_loss([0.5 * 3.0], [0.5 * 1.0])


def test_a_column_beside_a_row_is_refused() -> None:
    row = np.array([0.5, -1.0])
    with pytest.raises(SpecError, match=r"E713.*`advantages` has \(2, 1\)"):
        oracle.ppo_loss(row, row, row[:, None])
    with pytest.raises(SpecError, match=r"E713.*`rejected` has \(2, 1\)"):
        oracle.bradley_terry_loss(row, row[:, None])
