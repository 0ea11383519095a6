"""Labels of pairs beside B-Pref's teacher (Lee et al. 2021, algorithm 1), written anew, pair by pair, from the paper."""

import math
from typing import Any

import numpy as np
import pytest

from taskspec.data import Teacher, preferences
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.learn.data.episodes import Trajectory

RANGE = {"RiskyPath": (-247.5, 4.0), "NoisyObs": (0.0, 12.0)}


def worth(trajectory: Trajectory, discount: float = 1, myopic: float = 1) -> float:
    """The sum of rewards, less for each step that was later, and for each that a teacher saw longer ago."""
    total = 0.0
    last = len(trajectory) - 1
    for k, reward in enumerate(trajectory.rews):
        total += discount**k * myopic ** (last - k) * reward
    return total


def preferred(ahead: Any) -> np.ndarray:
    """Labels of pairs by how much better the first is."""
    return np.heaviside(ahead, 0.5)


def expected(
    first: Trajectory, second: Trajectory, myopic: float = 1, skip: float = -math.inf, equal: float = 0
) -> float:
    """The label of a teacher without chance: not a number where it skips."""
    if max(worth(first), worth(second)) <= skip:
        return math.nan
    if abs(worth(first) - worth(second)) < equal:
        return 0.5
    return float(preferred(worth(first, myopic=myopic) - worth(second, myopic=myopic)))


@pytest.mark.parametrize("task", RANGE)
@pytest.mark.parametrize("length", [None, 1, 4])
def test_labels_follow_the_true_returns(task: str, length: int | None) -> None:
    low, high = RANGE[task]
    horizon = {"RiskyPath": 5, "NoisyObs": 15}[task]
    share = 1 if length is None else length / horizon
    cases = {
        "noiseless": {}, "myopic(0.5)": {"myopic": 0.5},
        "equal(0.3)": {"equal": 0.3 * share * (high - low)},
        "skipping(0.4)": {"skip": share * (low + 0.4 * (high - low))},
    }  # fmt: skip
    shown = preferences(task, 300, policy="epsilon(0.5)", length=length)
    for teacher, given in cases.items():
        data = preferences(task, 300, policy="epsilon(0.5)", length=length, teacher=teacher)
        labels = np.array([expected(first, second, **given) for first, second in shown.pairs])
        (kept,) = np.nonzero(~np.isnan(labels))
        assert data.queries.tolist() == kept.tolist()
        assert data.preferences.tolist() == labels[kept].tolist(), teacher
        assert data.metadata["shown"] - data.metadata["skipped"] == len(data)
        first, second = data.pairs[-1]
        assert data.returns[-1].tolist() == [first.rews.sum(), second.rews.sum()]
        assert length is None or set(map(len, data.trajectories)) == {length}


TWICE = """
taskspec: 1
name: Twice
state: {s: {type: int, low: 0, high: 2}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 2
discount: 1/4
initial: {s: 0}
dynamics: {s': s + 1}
reward: a * (s + 1)
"""


def test_labels_are_of_discounted_returns() -> None:
    """One reward now is preferred to two in the second step, where later ones count a quarter."""
    task = build(read_text(TWICE))
    data = preferences(task, 100)
    differ = 0
    for (first, second), label, returns in zip(data.pairs, data.preferences, data.returns, strict=True):
        assert returns.tolist() == [worth(first, 0.25), worth(second, 0.25)]
        ahead = worth(first, 0.25) - worth(second, 0.25)
        assert label == preferred(ahead)
        differ += np.sign(worth(first) - worth(second)) != np.sign(ahead)
    assert differ > 5
    unsure = preferences(task, 100, teacher="equal(0.3)")  # of the range from 0 to 1.5
    apart = unsure.returns[:, 0] - unsure.returns[:, 1]
    assert unsure.preferences.tolist() == np.where(np.abs(apart) < 0.45, 0.5, apart > 0).tolist()
    assert len(set(np.abs(apart).tolist())) == 4
    skipping = preferences(task, 100, teacher="skipping(0.5)")
    assert set(skipping.returns.max(axis=1).tolist()) == {1.0, 1.5}
    myopic = preferences(task, 100, teacher="myopic(0.5)")
    for (first, second), label in zip(myopic.pairs, myopic.preferences, strict=True):
        assert label == preferred(worth(first, 0.25, 0.5) - worth(second, 0.25, 0.5))


def test_a_stochastic_teacher_prefers_as_bradley_and_terry_have_it() -> None:
    data = preferences("NoisyObs", 4000, policy="epsilon(0.5)", teacher="boltzmann(0.2)", seed=2)
    ahead = (data.returns[:, 0] - data.returns[:, 1]) / (0.2 * 12)
    assert data.metadata["range"] == list(RANGE["NoisyObs"])
    for low, high in ((-4, -1), (-1, 0), (0, 1), (1, 4)):
        here = (ahead >= low) & (ahead < high)
        chances = 1 / (1 + np.exp(-ahead[here]))
        error = math.sqrt((chances * (1 - chances)).sum()) / here.sum()
        assert here.sum() > 200 and abs(data.preferences[here].mean() - chances.mean()) < 4 * error


def test_mistakes_turn_answers_round() -> None:
    plain = preferences("NoisyObs", 3000, policy="epsilon(0.5)", teacher="noiseless")
    wrong = preferences("NoisyObs", 3000, policy="epsilon(0.5)", teacher="mistaken(0.25)")
    decided = plain.preferences != 0.5
    turned = wrong.preferences != plain.preferences
    assert not turned[~decided].any() and abs(turned[decided].mean() - 0.25) < 0.04
    assert np.array_equal(wrong.returns, plain.returns)


def test_irrationalities_add_up() -> None:
    both = preferences("NoisyObs", 200, policy="epsilon(0.5)", teacher="myopic(0.5) + mistaken(1)")
    myopic = preferences("NoisyObs", 200, policy="epsilon(0.5)", teacher=Teacher(myopic=0.5))
    assert both.metadata["teacher"] == "myopic(0.5) + mistaken(1)"
    assert np.array_equal(both.preferences, 1 - myopic.preferences)


def test_labels_do_not_depend_on_how_many_pairs_there_are() -> None:
    few = preferences("RiskyPath", 50, length=2, teacher="boltzmann(0.1) + mistaken(0.3)", seed=8)
    many = preferences("RiskyPath", 500, length=2, teacher="boltzmann(0.1) + mistaken(0.3)", seed=8)
    assert np.array_equal(few.preferences, many.preferences[:50]) and np.array_equal(few.returns, many.returns[:50])
    assert len(set(many.segments.time[many.segments.starts].tolist())) == 4  # where segments of two of five steps begin
