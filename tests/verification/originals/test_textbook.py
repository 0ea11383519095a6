"""The tasks of textbooks beside the numbers that the books print, and beside small programs that follow the books."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exact import Results
from taskspec.learn.data.tabular import tabular
from tests.verification.originals.beside import STEPS, Gymnasium, Result, State, side_by_side


class Wind:
    """The windy grid of the programs that accompany the book's second edition, in `chapter06`, on the path."""

    def __init__(self) -> None:
        self.code = pytest.importorskip("windy_grid_world")
        self.unwrapped = self

    def reset(self, seed: int) -> tuple[Any, dict[str, Any]]:
        self.place = self.code.START
        return None, {}

    def step(self, action: int) -> Result:
        theirs = ["ACTION_RIGHT", "ACTION_LEFT", "ACTION_UP", "ACTION_DOWN"][action]
        self.place = self.code.step(self.place, getattr(self.code, theirs))
        return Result(None, self.code.REWARD, self.place == self.code.GOAL, False)


@STEPS
def test_windy_grid(steps: int) -> None:
    def state(wind: Any) -> State:
        row, column = wind.place
        return {"x": column, "y": 6 - row}

    def act(rng: np.random.Generator, state: State, space: Any) -> int:
        """Mostly to the right, down at the end of the grid, and back."""
        right = 0
        left = 1
        down = 3
        wanted = right
        if state["x"] == 9:
            wanted = down
        elif state["x"] > 7 and state["y"] < 3:
            wanted = left
        return int(wanted if rng.random() < 0.7 else rng.integers(4))

    ours = taskspec.make("textbook/WindyGrid", N=10_000)
    assert side_by_side(ours, Gymnasium(Wind(), state), steps, act=act, seen=None) > 0


@pytest.mark.parametrize("start", range(1, 6))
def test_random_walk(start: int) -> None:
    """Example 6.2: the true values of A to E are 1/6 to 5/6."""
    found = tabular(taskspec.load("textbook/RandomWalk"))
    inside = ~found.absorbed
    P = found.P[inside, 0][:, inside]
    V = np.linalg.solve(np.eye(5) - P, found.R[inside, 0])
    assert V[start - 1] == pytest.approx(start / 6, abs=1e-12)


@pytest.mark.parametrize("start", [1, 12, 25, 37, 50, 63, 75, 88, 99])
def test_gambler(start: int) -> None:
    """Example 4.3, by value iteration as the book has it."""
    value = np.zeros(101)
    value[100] = 1
    for _ in range(100):
        for s in range(1, 100):
            value[s] = max(0.4 * value[s + a] + 0.6 * value[s - a] for a in range(1, min(s, 100 - s) + 1))
    task = taskspec.load("textbook/Gambler", start=start)
    assert Results(task).optimal.value == pytest.approx(value[start], abs=1e-9)


def test_semi_gradients_diverge_as_in_the_counterexample() -> None:
    """Section 11.2: the expected update, a linear map of the eight weights, makes some of them grow without bound."""
    task = taskspec.load("textbook/Baird")
    env = taskspec.make(task)
    features = np.array([env.reset(options={"state": {"s": s}})[0] for s in range(7)], dtype=float)
    update = features.T @ (task.discount * features[6] - features) / 7
    assert np.linalg.eigvals(update).real.max() > 0.1


@pytest.mark.parametrize(("stock", "printed"), [(0, 67), (1, 129), (2, 194), (3, 227)])
def test_inventory(stock: int, printed: int) -> None:
    """The expected profits of Puterman's section 4.6.1, in sixteenths."""
    found = tabular(taskspec.load("operations/Inventory"))
    V = np.zeros(found.n_states)
    for _ in range(3):
        V = np.max(found.R + found.P @ V, axis=1)
    index = next(i for i in range(found.n_states) if found.model.state(i)["s"] == stock)
    assert V[index] == pytest.approx(printed / 16)


@pytest.mark.parametrize(("n", "printed"), [(3, 0.5), (4, 0.4583), (5, 0.4333), (10, 0.3987), (50, 0.3743)])
def test_secretary(n: int, printed: float) -> None:
    """The probabilities of taking the best that Gilbert and Mosteller (1966) print in table 2."""
    task = taskspec.load("operations/Secretary", n=n)
    assert Results(task).optimal.value == pytest.approx(printed, abs=5e-5)
