"""The table `P` of environments, as Gymnasium's toy_text has it."""

import copy
from collections import defaultdict
from typing import Any

import gymnasium
import numpy as np
import pytest

import taskspec


def summed(outcomes: Any) -> dict[tuple[int, float, bool], float]:
    """Probabilities by next state, reward and end: Gymnasium lists some outcomes twice."""
    found: dict[tuple[int, float, bool], float] = defaultdict(float)
    for probability, state, reward, terminated in outcomes:
        found[int(state), float(reward), bool(terminated)] += float(probability)
    return found


def test_it_is_gymnasium_s_own_table_where_all_states_are_visited() -> None:
    env = taskspec.make("FrozenLake")
    original: Any = gymnasium.make("FrozenLake-v1").unwrapped
    holes = [s for s, rows in original.P.items() if rows[0][0][1] == s and rows[0][0][3]]
    assert list(env.P) == list(original.P) and len(holes) == 5
    assert np.allclose(env.initial_state_distrib, original.initial_state_distrib)
    for s in set(env.P) - set(holes):  # in which nobody acts
        for a in env.P[s]:
            assert summed(env.P[s][a]) == pytest.approx(summed(original.P[s][a]))


def test_it_is_there_where_the_task_is_finite() -> None:
    env = taskspec.make("CoinToss")
    assert env.P[0][1] == [(0.5, 2, 0.0, False), (0.5, 3, 0.0, False)]
    assert copy.deepcopy(env).P == env.P
    assert not hasattr(taskspec.make("Pendulum"), "P")
