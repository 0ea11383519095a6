"""Random words and variates: known answers, one result in Python and in NumPy, and distributions.

Every statistical test looks at fixed words, so it passes or fails for good. ALPHA is the chance
that one of them, picked blindly, would have failed with ideal randomness: some 80 of them at 1e-4
each make under 1 % together. A wrong distribution gives p-values far below it.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import chain, product
from operator import truediv

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskspec.language import draws
from taskspec.language.draws import threefry
from taskspec.language.expressions.variates.choices import bernoulli_threshold
from tests.shared.words import (
    EDGES,
    TOP,
    column,
    counters,
    lists_of,
    phases,
    positive,
    probabilities,
    seeds,
    stream,
    word,
)

KNOWN_ANSWERS = [  # Random123, kat_vectors: key, counter, result
    ((0, 0), (0, 0), (0x6B200159, 0x99BA4EFE)),
    ((TOP, TOP), (TOP, TOP), (0x1CB996FC, 0xBB002BE7)),
    ((0x13198A2E, 0x03707344), (0x243F6A88, 0x85A308D3), (0xC4923A9C, 0x483DF7A0)),
]

# ------------------------------------------------------------------------------ words


@pytest.mark.parametrize(("key", "counter", "result"), KNOWN_ANSWERS)
def test_known_answers(key: tuple[int, int], counter: tuple[int, int], result: tuple[int, int]) -> None:
    assert threefry.threefry(key, counter) == result
    seeds = np.array([key[0] | key[1] << 32], np.uint64)
    phase = counter[1] & ~1023
    slot = counter[1] & 1023
    words = threefry.lanes_block(seeds, phase, counter[0], 2 * slot + 2)
    assert tuple(words[-2:, 0].tolist()) == result


def test_known_answers_side_by_side() -> None:
    shifts = np.array([1, 2**64, 2**128], object)
    key, counter, result = np.tensordot(shifts, np.array(KNOWN_ANSWERS, object), axes=1).tolist()
    assert threefry.threefry(tuple(key), tuple(counter), lanes=3) == tuple(result)


def test_a_word_is_a_half_of_a_slot() -> None:
    seed = 7 << 32 | 5
    n = 11
    for phase, top in ((draws.STEP, 0), (draws.RESET, 1 << 31)):
        halves = [threefry.threefry((5, 7), (n, top | slot)) for slot in range(3)]
        assert draws.words(seed, phase, n, 5) == tuple(chain(*halves))[:5]


@given(seeds, phases, counters, st.integers(0, 5), st.integers(0, 5))
def test_blocks_agree(seed: int, phase: int, first_n: int, how_many: int, count: int) -> None:
    expected = [draws.words(seed, phase, first_n + i, count) for i in range(how_many)]
    assert draws.rows(seed, phase, first_n, how_many, count) == expected
    for limit in (0, 192):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(threefry, "PACKED_BLOCKS", limit)
            block = draws.block(seed, phase, first_n, how_many, count)
        assert block.dtype == np.uint32
        assert block.shape == (how_many, count)
        assert list(map(tuple, block.tolist())) == expected


@given(seeds, phases, st.lists(counters, max_size=5), st.integers(0, 5))
def test_lanes_agree(seed: int, phase: int, n: list[int], count: int) -> None:
    lane_seeds = draws.lane_seeds(seed, len(n))
    expected = [draws.words(int(s), phase, m, count) for s, m in zip(lane_seeds, n, strict=True)]
    for limit in (0, 192):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(threefry, "PACKED_BLOCKS", limit)
            block = draws.lanes_block(lane_seeds, phase, np.array(n, np.int64), count)
        assert block.shape == (count, len(n))
        assert list(map(tuple, block.T.tolist())) == expected


@pytest.mark.parametrize("first", [[5] * 70, [*range(70)], [*[TOP - 1] * 69, 0]])
@pytest.mark.parametrize("lanes", [1, 70])
def test_steps_ahead_are_those_of_each_lane(lanes: int, first: list[int]) -> None:
    """Whether lanes are at one step or not, and few or many."""
    lane_seeds = draws.lane_seeds(7, lanes)
    n = np.array(first[:lanes], np.uint32)
    found = threefry.lanes_ahead(lane_seeds, n, 3, 5)
    for d, i in product(range(3), range(lanes)):
        step = (first[i] + d) % (TOP + 1)
        assert tuple(found[:, d * lanes + i].tolist()) == draws.words(int(lane_seeds[i]), draws.STEP, step, 5)


@pytest.mark.parametrize(("lanes", "count"), [(40_000, 3), (1000, 41), (3, 70_001)])
def test_chunks_meet_without_seams(lanes: int, count: int) -> None:
    seed = 2**40 + TOP - 2
    n = np.arange(lanes)
    lane_seeds = draws.lane_seeds(seed, lanes)
    out = np.empty((count, lanes), np.uint32)
    assert draws.lanes_block(lane_seeds, draws.STEP, n, count, out) is out
    blocks = draws.block(seed, draws.STEP, TOP - 1, lanes, count)
    for i in {0, 1, lanes // 2, lanes - 1}:
        assert tuple(out[:, i].tolist()) == draws.words(int(lane_seeds[i]), draws.STEP, i, count)
        assert tuple(blocks[i].tolist()) == draws.words(seed, draws.STEP, TOP - 1 + i, count)


@given(seeds, st.integers(0, 2**33))
def test_lane_seeds(seed: int, first: int) -> None:
    for i, lane_seed in enumerate(draws.lane_seeds(seed, 3, first).tolist()):
        assert lane_seed == (seed + first + i) % 2**64


def test_threads_do_not_share_scratch() -> None:
    def job(seed: int) -> bytes:
        return draws.block(seed, draws.STEP, 0, 3000, 4).tobytes()

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(job, range(24))) == [job(seed) for seed in range(24)]


# ------------------------------------------------------------------------------ float32 functions

MANY = stream(1, 300_000)[0]


def test_logarithm_and_exponential_are_close() -> None:
    x = np.exp(np.linspace(-80, 80, 200_001)).astype(np.float32)
    reference = np.log(x.astype(np.float64))
    assert (np.abs(draws.log(x) - reference) <= 1.2e-7 * (1 + np.abs(reference))).all()
    near = np.linspace(0.7, 1.4, 200_001).astype(np.float32)
    assert np.abs(draws.log(near) - np.log(near.astype(np.float64))).max() < 7e-8
    y = np.linspace(-87, 88, 200_001).astype(np.float32)
    reference = np.exp(y.astype(np.float64))
    assert (np.abs(draws.exp(y) - reference) <= 1e-7 * reference).all()
    ends = np.array([-np.inf, -88, 0], np.float32)
    assert draws.exp(ends).tolist() == [0, 0, 1]
    beyond = draws.exp(np.array([88, 88.5, 89, 1e30, np.inf], np.float32))
    assert (beyond == beyond[0]).all()


def test_exponential_of_words_is_close_and_reaches_its_tail() -> None:
    w = np.concatenate([MANY, np.array(EDGES, np.uint32)])
    u = ((~w >> 1).astype(np.float64) + 0.5) * 2**-31
    value = draws.exponentials(w)
    assert value.dtype == np.float32
    assert (np.abs(value + np.log(u)) <= 1.3e-7 * (1 - np.log(u))).all()
    ends = draws.exponentials(np.array([0, TOP], np.uint32))
    assert ends[0] == 0
    assert ends[1] == pytest.approx(32 * math.log(2))
    ordered = draws.exponentials(np.sort(w))
    assert (np.diff(ordered) >= -2e-7 * (1 + ordered[1:])).all()


def test_direction_is_close() -> None:
    w = np.concatenate([MANY, np.array(EDGES, np.uint32)])
    angle = (w << np.uint32(1)).view(np.int32) * (math.pi / 2**32)
    cosine, sine = draws.direction(w)
    assert cosine.dtype == sine.dtype == np.float32
    assert np.abs(sine - np.sin(angle)).max() < 3e-7
    assert np.abs(cosine - np.where(w >> 31, -1, 1) * np.cos(angle)).max() < 3e-7


def test_normals_reach_their_tail() -> None:
    values = draws.normals(np.array([(TOP, 0), (TOP, 2**30), (0, 5)], np.uint32).T, 2).T
    assert values[0] == pytest.approx((math.sqrt(64 * math.log(2)), 0))
    assert values[1, 1] == pytest.approx(-math.sqrt(64 * math.log(2)))
    assert values[2].tolist() == [0, 0]


# ------------------------------------------------------------------------------ one result


@given(word, st.floats(0, 1))
def test_single_words_give_one_result(w: int, p: float) -> None:
    array = np.array([w], np.uint32)
    assert draws.uniforms(array)[0] == draws.uniform(w) == (w // 256) / 2**24
    assert draws.bernoullis(array, p)[0] == draws.bernoulli(w, p)


@given(word, st.integers(1, 2**31 - 1))
def test_index(w: int, n: int) -> None:
    assert draws.indices(np.array([w], np.uint32), n).tolist() == [draws.index(w, n)]
    assert 0 <= draws.index(w, n) < n


@given(word, st.integers(1, 2**16))
def test_index_in_32_bits(w: int, n: int) -> None:
    low = (w & 0xFFFF) * n
    parts = ((w >> 16) * n, (w >> 16) * n + (low >> 16), low)
    assert max(parts) <= TOP
    assert parts[1] >> 16 == draws.index(w, n)


@given(st.lists(st.tuples(word, word), min_size=1, max_size=9), st.booleans())
def test_normals_give_one_result(pairs: list[tuple[int, int]], odd: bool) -> None:
    words = list(chain(*pairs))
    n = len(words) - odd
    assert draws.normal_words(n) == len(words)
    expected = tuple(draws.normals(np.array(words, np.uint32), n).tolist())
    assert len(expected) == n
    lanes = np.repeat(column(words), 3, axis=1)
    for block in (lanes, lanes.T.copy().T):
        assert list(map(tuple, draws.normals(block, n).T.tolist())) == [expected] * 3


def test_normals_of_a_large_block_meet_without_seams() -> None:
    words = stream(6, 9000)
    whole = draws.normals(words, 5)
    assert whole.shape == (5, 9000)
    assert (whole[:, 8990:] == draws.normals(words[:, 8990:], 5)).all()


@given(lists_of(3 * draws.GAMMA_WORDS), st.lists(positive, min_size=3, max_size=3))
def test_dirichlet_gives_one_result(words: list[int], alphas: list[float]) -> None:
    lanes = np.repeat(column(words), 2, axis=1)
    shares = draws.dirichlets(np.array(words, np.uint32), alphas)
    assert draws.dirichlets(lanes, alphas).T.tolist() == [shares.tolist()] * 2
    assert sum(shares) == pytest.approx(1, abs=1e-6)
    assert min(shares) >= 0


@given(probabilities, word)
def test_categorical_gives_one_result(weights: list[int], w: int) -> None:
    total = sum(weights)
    table = draws.thresholds([Fraction(p, total) for p in weights])
    assert table == tuple(round(Fraction(2**32 * sum(weights[: i + 1]), total)) for i in range(len(weights) - 1))
    outcome = draws.categorical(w, table)
    array = np.array([w], np.uint32)
    assert draws.categoricals(array, table).tolist() == [outcome]
    rows, last = draws.threshold_table([weights, weights[::-1]])
    assert draws.row_categoricals(array, np.array([0]), rows, last).tolist() == [outcome]


@given(st.lists(st.floats(0, 1e6, width=32), min_size=1, max_size=9).filter(any), word)
def test_weighted_gives_one_result(weights: list[float], w: int) -> None:
    outcome = draws.weighted_categorical(w, weights)
    two = draws.weighted_categoricals(np.array([w, w], np.uint32), np.array([weights] * 2).T)
    assert two.tolist() == [outcome] * 2


@given(st.lists(st.integers(0, 3) | word, min_size=1, max_size=8))
def test_permutation_gives_one_result(words: list[int]) -> None:
    order = draws.permutation(words)
    assert draws.permutations(column(words))[:, 0].tolist() == list(order)
    assert order == tuple(np.argsort(words, kind="stable").tolist())


@given(lists_of(2), st.floats(0, 120))
def test_poisson_gives_one_result(words: list[int], rate: float) -> None:
    lanes = np.repeat(column(words), 2, axis=1)
    count = draws.poissons(np.array(words, np.uint32), rate, 100)
    assert draws.poissons(lanes, rate, 100).tolist() == [count] * 2
    assert 0 <= count <= 2 * draws.poisson_terms(100)


# ------------------------------------------------------------------------------ impossible outcomes


@given(probabilities, st.booleans())
def test_outcomes_of_probability_zero_are_never_drawn(weights: list[int], exact: bool) -> None:
    total = sum(weights)
    divide = Fraction if exact else truediv
    chances = [divide(p, total) for p in weights]
    table = draws.thresholds(chances)
    rows, last = draws.threshold_table([chances])
    ends = np.array(table, np.int64)
    near = np.concatenate([ends - 1, ends, ends + 1]) % 2**32
    for w in {*near.tolist(), *EDGES}:
        assert weights[draws.categorical(w, table)] > 0
        assert weights[draws.row_categoricals(np.array([w], np.uint32), np.array([0]), rows, last)[0]] > 0
        assert weights[draws.weighted_categorical(w, weights)] > 0


@pytest.mark.parametrize("w", [0, TOP])
def test_certain_events_at_the_extreme_words(w: int) -> None:
    assert draws.categorical(w, draws.thresholds([0, 0.0, 1, Fraction(0)])) == 2
    assert draws.bernoulli(w, 1)
    assert not draws.bernoulli(w, 0)
    assert draws.poissons(np.array([[w, w]], np.uint32), [0, math.nan], 10).tolist() == [0, 0]
    assert draws.poisson_table(0) == (0, ())


@pytest.mark.parametrize("w", [2**8, 2**31, TOP])
@pytest.mark.parametrize("weights", [[0, 0], [0, 0, 0], [-1, 2], [2, -1, 2], [math.nan, 1], [1, math.nan], [math.inf, 1],
                                     [1, math.inf, 1], [1e308, 1e308, 1e308], [-1, -1], [math.nan]])  # fmt: skip
def test_what_is_no_distribution_means_the_same_as_a_constant_and_at_run_time(weights: list[float], w: int) -> None:
    with np.errstate(over="ignore"):
        at_run_time = draws.weighted_categorical(w, weights)
    assert draws.categorical(w, draws.thresholds(weights)) == at_run_time


@pytest.mark.parametrize("w", [0, 2**31, TOP])
@pytest.mark.parametrize("p", [-1, -math.inf, math.nan, 1.5, math.inf, 10**400, Fraction(3, 2)])
def test_what_is_no_probability_means_the_same_as_a_constant_and_at_run_time(p: float, w: int) -> None:
    assert (w < bernoulli_threshold(p)) == draws.bernoulli(w, math.inf if p == 10**400 else float(p))


@pytest.mark.parametrize(("rate", "limited"), [(-1, 0), (math.nan, 0), (100_001, 100_000), (math.inf, 100_000)])
def test_rates_are_limited(rate: float, limited: float) -> None:
    assert draws.poisson_table(rate) == draws.poisson_table(limited)
