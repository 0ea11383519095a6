"""The memory tasks beside the package `popgym` 1.0, with the cards or the board that it dealt."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.verification.originals.beside import STEPS, Case, Gymnasium, State, among_outcomes, cases, side_by_side

pytest.importorskip("popgym")
from popgym.envs.autoencode import Autoencode
from popgym.envs.battleship import Battleship
from popgym.envs.concentration import Concentration
from popgym.envs.higher_lower import HigherLower
from popgym.envs.minesweeper import MineSweeper
from popgym.envs.repeat_first import RepeatFirst
from popgym.envs.repeat_previous import RepeatPrevious

DECK = {"suits": 4, "ranks": 13}


def suits(env: Any) -> State:
    """The suits of the deck, in the order in which it is dealt: from its end."""
    return {"cards": env.deck.suits_idx[env.deck.idx[::-1]]}


def counts(env: Any) -> State:
    return {"left": 4 - env.state.astype(int), "shown": env.deck.show("player", ["ranks_idx"]).item()}


def board(env: Any) -> State:
    """The one ship of two cells: beside each other are counted first, then one below the other."""
    n = env.board_size
    first, second = np.flatnonzero(env.board.ravel())
    ship = first // n * (n - 1) + first % n if second == first + 1 else n * (n - 1) + first
    return {"ship": int(ship), "hits": env.guesses.ravel()[[first, second]].astype(bool), "hit": bool(env.last_obs)}


def mines(env: Any) -> State:
    hidden = env.hidden_grid.ravel()
    return {"mine": hidden == 1, "open": hidden == 2}


def table(env: Any) -> State:
    up = np.zeros(52, bool)
    up[env.deck["face_up_idx"]] = True
    return {"card": env.deck.ranks_idx[env.deck.idx], "up": up, "first": (env.deck["in_play_idx"] or [-1])[0]}


def pairs(rng: np.random.Generator, state: State, space: Any) -> int:
    """Often the partner of the card that was turned, and seldom a card that lies open."""
    first = state["first"]
    up = np.asarray(state["up"])
    if first >= 0 and rng.random() < 0.7:
        partners = np.flatnonzero((state["card"] == state["card"][first]) & ~up & (np.arange(52) != first))
        if len(partners):
            return int(partners[0])
    closed = np.flatnonzero(~up)
    return int(rng.choice(closed) if rng.random() < 0.9 else rng.integers(52))


CASES = [
    Case("memory/Autoencode", lambda: Gymnasium(Autoencode(), suits), DECK),
    Case("memory/RepeatFirst", lambda: Gymnasium(RepeatFirst(), suits), DECK),
    Case("memory/RepeatPrevious", lambda: Gymnasium(RepeatPrevious(k=4), suits), {**DECK, "k": 3}),
    Case(
        "memory/RepeatPrevious", lambda: Gymnasium(RepeatPrevious(2, k=32), suits), {"suits": 4, "ranks": 26, "k": 31}
    ),
    Case("memory/Battleship", lambda: Gymnasium(Battleship(3, [2]), board)),
    Case("memory/Battleship", lambda: Gymnasium(Battleship(6, [2]), board), {"n": 6}),
    Case("memory/Minesweeper", lambda: Gymnasium(MineSweeper(), mines), {"n": 4, "k": 2}),
    Case("memory/Minesweeper", lambda: Gymnasium(MineSweeper("medium"), mines), {"n": 6, "k": 6}),
    Case("memory/Concentration", lambda: Gymnasium(Concentration(), table), DECK, act=pairs),
]
HIGHER = Case("memory/HigherLower", lambda: Gymnasium(HigherLower(), counts), DECK)
MORE = [HIGHER]


@STEPS
@cases(CASES)
def test_steps(case: Case, steps: int) -> None:
    assert side_by_side(case.make(), case.original(), steps, act=case.act, tolerance=1e-6) > 0


@STEPS
def test_higher_lower(steps: int) -> None:
    """The next card, too, as its distribution."""
    assert among_outcomes(HIGHER.make().task, HIGHER.original(), steps) > 0


def test_the_original_counts_from_one_card_later_than_it_says() -> None:
    """Its `k = 1` is not the card before, but the one that is seen."""
    env = RepeatPrevious(k=1)
    seen, _ = env.reset(seed=0)
    assert all(env.step(action)[1] > 0 for action in [seen])
