"""Tasks written with the language reference alone at hand, against a few lines of NumPy."""

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import convolve
from scipy.stats import poisson

import taskspec
from taskspec.exact import scores
from tests.shared.specs import spec_file


def make(name: str, **parameters: Any) -> Any:
    return taskspec.make(taskspec.load(str(spec_file(name)), **parameters))


def test_catch() -> None:
    env = make("catch")
    observation, _ = env.reset(seed=1)
    for action in np.random.default_rng(0).integers(3, size=300):
        row, column = np.argwhere(observation == 1)[0]  # of the ball, which is above the paddle
        paddle = int(np.flatnonzero(observation[-1])[-1])
        observation, reward, terminated, _, _ = env.step(action)
        paddle = int(np.clip(paddle + action - 1, 0, 4))
        assert observation[-1, paddle] == 1
        assert terminated == (row == 8)
        if terminated:
            assert reward == (1 if paddle == column else -1)
            observation, _ = env.reset()
        else:
            assert reward == 0


def test_game_of_life() -> None:
    env = make("life", n=8)
    alive = env.reset(seed=2)[0].astype(int)
    for cell in np.random.default_rng(1).integers(-1, 64, size=30):
        if cell >= 0:
            alive[divmod(cell, 8)] ^= 1
        around = convolve(alive, np.ones((3, 3), int), mode="wrap") - alive
        alive = ((around == 3) | ((around == 2) & (alive == 1))).astype(int)
        observation, reward, *_ = env.step(cell)
        np.testing.assert_array_equal(observation, alive)
        assert reward == alive.sum() / 64


def test_lights_out() -> None:
    env = make("lights_out", n=4)
    lit = env.reset(seed=2)[0].astype(int)
    for i, j in np.random.default_rng(1).integers(0, 4, size=(15, 2)):
        for r, c in ((i, j), (i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if 0 <= r < 4 and 0 <= c < 4:
                lit[r, c] ^= 1
        observation, reward, terminated, *_ = env.step(np.array([i, j]))
        np.testing.assert_array_equal(observation, lit)
        assert (reward, terminated) == (-float(lit.any()), not lit.any())


def test_queens() -> None:
    env = make("n_queens", n=6)
    env.reset(seed=0)
    for column in (1, 3, 5, 0, 2, 4):
        assert env.step(column)[1] == 0
    rng = np.random.default_rng(0)
    for _ in range(20):
        env.reset()
        columns = rng.integers(6, size=6)
        for t, column in enumerate(columns):
            distances = np.abs(columns[:t] - column)
            attacks = (distances == 0) | (distances == np.arange(t, 0, -1))
            assert env.step(column)[1] == -attacks.sum()


def won(board: Any, who: int) -> bool:
    square = np.asarray(board).reshape(3, 3)
    lines = np.array([*square, *square.T, np.diag(square), np.diag(np.fliplr(square))])
    return bool((lines == who).all(axis=1).any())


def test_tic_tac_toe() -> None:
    env = make("tic_tac_toe")
    rng = np.random.default_rng(0)
    outcomes = set()
    board, _ = env.reset(seed=0)
    for _ in range(2000):
        cell = int(rng.integers(9))
        after, reward, terminated, _, _ = env.step(cell)
        mine = board.copy()
        mine[cell] = 1
        if board[cell] != 0:
            assert (reward, terminated, after.tolist()) == (-1, True, board.tolist())
        elif won(mine, 1) or (mine != 0).all():
            assert (reward, terminated, after.tolist()) == (float(won(mine, 1)), True, mine.tolist())
        else:
            (reply,) = np.flatnonzero(after != mine)
            assert mine[reply] == 0
            assert after[reply] == -1
            assert terminated == (won(after, -1) or not (after == 0).any())
            assert reward == -float(won(after, -1))
        outcomes.add((reward, terminated))
        board = after
        if terminated:
            board, _ = env.reset()
    assert outcomes == {(-1, True), (1, True), (0, False)} | (outcomes & {(0, True)})


def test_memory_is_asked_for_at_the_end() -> None:
    env = make("memory_len", length=4, bits=3)
    for seed in range(8):
        observation, _ = env.reset(seed=seed)
        context = observation[2:] > 0
        assert (np.abs(observation[2:]) == 1).all()
        for step in range(4):
            observation, reward, terminated, _, _ = env.step(1)
            assert (reward, terminated) == (0, False)
            assert np.abs(observation[2:]).any() == (step == 0)
        query = env.state["query"]
        guess = int(context[query])
        is_wrong = seed % 2 == 0
        _, reward, terminated, _, _ = env.step(abs(guess - is_wrong))
        assert (reward, terminated) == (1 - 2 * is_wrong, True)


def test_choices_of_several_components_and_labels_that_are_no_names() -> None:
    env = make("tiger")
    env.reset(seed=0, options={"state": {"tiger": "left"}})
    assert env.step(1)[1] == -100
    assert env.step(0)[1] == -1
    cook = make("multi_choice")
    cook.reset(seed=0)
    np.testing.assert_array_equal(cook.step(np.array([2, 0, 1]))[0], [1, 0])
    assert cook.state == {"heat": "low", "done": 0}


def test_variants_of_variants() -> None:
    offset = taskspec.load(str(spec_file("two_goals")), "TwoGoalsOffset")
    assert (offset.annotations.expert, offset.annotations.claims, offset.values) == (None, (), {"L": 5})
    env = taskspec.make(offset)
    starts = {int(env.reset(seed=s)[0]) for s in range(200)}
    assert starts == {*range(-5, 0), *range(1, 6)}


def test_cars_are_moved_as_value_iteration_does() -> None:
    """Over all numbers of customers and cars brought back, with a Poisson tail that weighs nothing."""
    task = taskspec.load(str(spec_file("car_rental")))
    most = task.values["N"]
    moves = task.values["M"]

    def day(asked: int, back: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        """Where the cars of a place are in the evening, by how many are there in the morning; and what they earn."""
        ways = np.zeros((most + 1, most + 1))
        paid = np.zeros(most + 1)
        for cars, (wanted, p) in itertools.product(range(most + 1), enumerate(poisson.pmf(range(60), asked))):
            paid[cars] += 10 * min(cars, wanted) * p
            for returned, q in enumerate(poisson.pmf(range(60), back)):
                ways[cars, min(max(cars - wanted, 0) + returned, most)] += p * q
        return ways, paid

    (first, earned) = day(3, 3)
    (second, more) = day(4, 2)
    value = np.zeros((most + 1, most + 1))
    for _ in range(300):
        morning = earned[:, None] + more + 0.9 * first @ value @ second.T
        value = np.full((most + 1, most + 1), -np.inf)
        for i, j, m in itertools.product(range(most + 1), range(most + 1), range(-moves, moves + 1)):
            if -j <= m <= i:
                moved = morning[min(i - m, most), min(j + m, most)] - 2 * abs(m)
                value[i, j] = max(value[i, j], moved)
    assert scores(task).optimal.value == pytest.approx(value[most // 2, most // 2], rel=1e-9)
