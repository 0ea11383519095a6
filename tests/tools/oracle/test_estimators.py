"""Estimators on a batch: identities between them, in fractions, and the edges of episodes."""

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from taskspec import oracle
from taskspec.base.diagnostics import SpecError

BATCH = oracle.batch(exact=True)
GAMMA = Fraction(9, 10)
LAM = Fraction(3, 4)
ENDS = (BATCH.terminated, BATCH.truncated)
Array = np.ndarray[Any, Any]


def same(a: Array, b: Array) -> bool:
    """Whether arrays have equal fractions."""
    return a.dtype == b.dtype == object and np.array_equal(a, b)


def test_the_batch_has_every_kind_of_end_in_the_middle_and_in_the_last_row() -> None:
    kinds = BATCH.terminated.astype(int) + 2 * BATCH.truncated
    assert [set(lane) for lane in kinds[:-1].T] == [{0, 1, 2, 3}] * 4
    assert kinds[-1].tolist() == [0, 1, 2, 3]
    going = ~BATCH.dones[:-1]
    assert (BATCH.next_values[:-1][going] == BATCH.values[1:][going]).all()
    assert (BATCH.starts[1:] == BATCH.dones[:-1]).all() and BATCH.starts[0].all()


def test_a_small_case_by_hand() -> None:
    given = ([1, 1], [0, 2], [2, 4], [False, False], [False, True])
    half = Fraction(1, 2)
    assert oracle.td_errors(given[0], given[1], given[2], given[3], half).tolist() == [2, 1]
    assert oracle.gae(*given, half, half).tolist() == [Fraction(9, 4), 1]
    assert oracle.monte_carlo(given[0], given[3], given[4], half).tolist() == [Fraction(3, 2), 1]
    assert oracle.monte_carlo(given[0], given[3], given[4], half, given[2]).tolist() == [Fraction(5, 2), 3]
    v, A = oracle.vtrace(*given, [Fraction(1, 2), 3], half)
    assert v.tolist() == [Fraction(5, 4), 3]  # 0 + 1/2 * 2 + 1/2 * 1/2 * 1 * 1; 2 + 1 * 1
    assert A.tolist() == [Fraction(5, 4), 1]  # 1/2 * (1 + 3/2 - 0); 1 + 2 - 2


def test_gae_is_between_td_errors_and_monte_carlo() -> None:
    def advantages(lam: Any) -> Array:
        return oracle.gae(BATCH.rewards, BATCH.values, BATCH.next_values, *ENDS, GAMMA, lam)

    delta = oracle.td_errors(BATCH.rewards, BATCH.values, BATCH.next_values, BATCH.terminated, GAMMA)
    G = oracle.monte_carlo(BATCH.rewards, *ENDS, GAMMA, BATCH.next_values)
    assert same(advantages(0), delta)
    assert same(advantages(1), G - BATCH.values)
    returns = oracle.lambda_returns(BATCH.rewards, BATCH.next_values, *ENDS, GAMMA, LAM)
    assert same(advantages(LAM) + BATCH.values, returns)


def test_lambda_returns_are_means_of_n_step_returns() -> None:
    """Equation (12.3) of Sutton and Barto, on one episode."""
    rewards = BATCH.rewards[:4]
    after = BATCH.next_values[:4]
    terminated = np.zeros((4, 4), np.bool_)
    truncated = np.zeros((4, 4), np.bool_)
    truncated[-1] = True
    found = oracle.lambda_returns(rewards, after, terminated, truncated, GAMMA, LAM)
    n_step = [oracle.n_step_returns(rewards, after, terminated, truncated, GAMMA, n)[0] for n in (1, 2, 3, 4)]
    mean = (1 - LAM) * (n_step[0] + LAM * n_step[1] + LAM**2 * n_step[2]) + LAM**3 * n_step[3]
    assert same(found[0], mean)


def test_v_trace_on_policy_is_the_return_and_off_policy_weighs_it() -> None:
    ones = np.ones(BATCH.rewards.shape, np.int64)
    given = (BATCH.rewards, BATCH.values, BATCH.next_values, *ENDS)
    G = oracle.n_step_returns(BATCH.rewards, BATCH.next_values, *ENDS, GAMMA, len(ones))
    v, A = oracle.vtrace(*given, ones, GAMMA)
    assert same(v, G)
    after = np.where(BATCH.dones[:-1], BATCH.next_values[:-1], G[1:])
    after = np.concatenate([after, BATCH.next_values[-1:]])
    after = np.where(BATCH.terminated, 0, after)
    assert same(A, BATCH.rewards + GAMMA * after - BATCH.values)
    assert same(oracle.vtrace(*given, ones, GAMMA, lam=LAM)[0], oracle.gae(*given, GAMMA, LAM) + BATCH.values)
    no_trace, _ = oracle.vtrace(*given, BATCH.ratios, GAMMA, c_bar=0)
    rho = np.minimum(BATCH.ratios, 1)
    delta = oracle.td_errors(BATCH.rewards, BATCH.values, BATCH.next_values, BATCH.terminated, GAMMA)
    assert same(no_trace, BATCH.values + rho * delta)


ESTIMATORS: dict[str, Callable[[oracle.RolloutBatch], Array]] = {
    "td": lambda b: oracle.td_errors(b.rewards, b.values, b.next_values, b.terminated, GAMMA),
    "monte carlo": lambda b: oracle.monte_carlo(b.rewards, b.terminated, b.truncated, GAMMA, b.next_values),
    "3 steps": lambda b: oracle.n_step_returns(b.rewards, b.next_values, b.terminated, b.truncated, GAMMA, 3),
    "lambda": lambda b: oracle.lambda_returns(b.rewards, b.next_values, b.terminated, b.truncated, GAMMA, LAM),
    "gae": lambda b: oracle.gae(b.rewards, b.values, b.next_values, b.terminated, b.truncated, GAMMA, LAM),
    "v-trace": lambda b: np.stack(
        oracle.vtrace(b.rewards, b.values, b.next_values, b.terminated, b.truncated, b.ratios, GAMMA), axis=-1
    ),
}  # fmt: skip
each = pytest.mark.parametrize("estimate", ESTIMATORS.values(), ids=ESTIMATORS.keys())


def picked(batch: oracle.RolloutBatch, rows: Any) -> oracle.RolloutBatch:
    columns = (batch.rewards, batch.values, batch.next_values, batch.terminated, batch.truncated, batch.ratios)
    return oracle.RolloutBatch(*(column[rows] for column in columns))


@each
def test_episodes_of_a_batch_are_independent_of_each_other(estimate: Callable[[oracle.RolloutBatch], Array]) -> None:
    whole = estimate(BATCH)
    for lane in range(4):
        ends = np.flatnonzero(BATCH.dones[:, lane])
        bounds = sorted({0, *(ends + 1).tolist(), len(BATCH.rewards)})
        parts = [estimate(picked(BATCH, (slice(a, b), lane))) for a, b in pairwise(bounds)]
        assert same(np.concatenate(parts), whole[:, lane])


@each
def test_values_after_a_termination_are_not_looked_at(estimate: Callable[[oracle.RolloutBatch], Array]) -> None:
    floats = oracle.batch()
    lost = np.where(floats.terminated, np.nan, floats.next_values)
    changed = oracle.RolloutBatch(
        floats.rewards, floats.values, lost, floats.terminated, floats.truncated, floats.ratios
    )
    assert np.isfinite(estimate(changed)).all()
    assert np.array_equal(estimate(changed), estimate(floats))


@each
def test_a_row_that_only_resets_changes_no_other_row(estimate: Callable[[oracle.RolloutBatch], Array]) -> None:
    end = int(np.flatnonzero(BATCH.dones[:-1, 0])[0])
    lane = picked(BATCH, (slice(None), 0))
    reset = np.r_[0 : end + 1, end, end + 1 : len(BATCH.rewards)]  # as with AutoresetMode.NEXT_STEP
    repeated = picked(lane, reset)
    repeated.terminated[end + 1] = repeated.truncated[end + 1] = False
    found = estimate(repeated)
    assert same(np.delete(found, end + 1, axis=0), estimate(lane))


@each
def test_floats_and_fractions_agree(estimate: Callable[[oracle.RolloutBatch], Array]) -> None:
    found = estimate(oracle.batch())
    assert np.allclose(found.astype(np.float64), estimate(BATCH).astype(np.float64))


def test_next_values_of_a_buffer() -> None:
    found = oracle.next_values(BATCH.values, BATCH.last_values, *ENDS, BATCH.next_values)
    assert same(found, np.where(BATCH.terminated, 0, BATCH.next_values))
    with pytest.raises(SpecError, match="E713"):
        oracle.next_values(BATCH.values, BATCH.last_values, *ENDS)
    none = np.zeros_like(BATCH.truncated)
    assert oracle.next_values([1.0, 2.0], 3.0, [False, True], [False, False]).tolist() == [2.0, 0.0]
    assert same(oracle.next_values(BATCH.values, BATCH.last_values, none, none)[:-1], BATCH.values[1:])


def test_a_column_beside_a_row_is_refused() -> None:
    """NumPy would make a square of (T, 1) and (T,)."""
    b = oracle.batch()
    flat = [each[:, 0] for each in (b.rewards, b.values, b.next_values, b.terminated, b.truncated, b.ratios)]
    for i, name in enumerate(("values", "next_values", "terminated", "truncated", "ratios"), 1):
        given = [*flat[:i], flat[i][:, None], *flat[i + 1 :]]
        with pytest.raises(SpecError, match=rf"E713.*`{name}` has \(12, 1\)"):
            oracle.vtrace(*given, 0.9)
    rewards, values, next_values, terminated, truncated, _ = flat
    with pytest.raises(SpecError, match="`truncated` has"):
        oracle.gae(rewards, values, next_values, terminated, truncated[:, None], 0.9, 0.9)
    for estimate, last in ((oracle.n_step_returns, (3,)), (oracle.lambda_returns, (0.9,))):
        with pytest.raises(SpecError, match="`next_values` has"):
            estimate(rewards, next_values[:, None], terminated, truncated, 0.9, *last)


def test_too_few_steps_are_refused() -> None:
    b = oracle.batch(8)
    with pytest.raises(SpecError, match=r"E713.*at least 8 steps, not 7"):
        oracle.batch(7)
    with pytest.raises(SpecError, match=r"E713.*at least one reward, not 0"):
        oracle.n_step_returns(b.rewards, b.next_values, b.terminated, b.truncated, 0.9, 0)


def test_floats_anywhere_give_floats() -> None:
    assert oracle.monte_carlo([Fraction(1, 2), 1], [False, True], [False, False], 0.5).dtype == np.float64
    assert oracle.monte_carlo([1, 2], [False, True], [False, False], 1).tolist() == [3.0, 2.0]
