"""Places of mistakes, told by the actions of training, and by errors of learned values at ends and before them."""

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from taskspec.exam import Case, Exam, Learned, examine, learns_from
from taskspec.learn.exam.card import card
from taskspec.learn.exam.findings import diagnose
from taskspec.learn.exam.learned import compare_with_extended
from taskspec.learn.exam.report import page
from tests.shared.exams import column, entry

Array = np.ndarray[Any, Any]
GAMMA = 0.9
TASKS = ("SecondThought", "CoinToss", "Sizes", "Patience")
RIGHT = {
    "SecondThought": [[1 / 4, GAMMA], [0, 0], [1, -1]],
    "CoinToss": [[0.3 * GAMMA, GAMMA], [0.3, 0.3], [2, 2], [0, 0]],
    "Sizes": [[1 + GAMMA, 3 * GAMMA], [1, 1], [3, 3]],
    "Patience": [[1, 2 * GAMMA**4], *([2 * GAMMA**k] * 2 for k in (3, 2, 1, 0))],
}
"""Right Q-values (O, A), by hand."""


def at_random(rng: np.random.Generator) -> int:
    return int(rng.integers(2))


def learner(
    learned: Callable[[Array, Case], Any], actions: Callable[[np.random.Generator], int] = at_random, share: float = 1.0
) -> Callable[[Case], Any]:
    """Return a learner that takes a share of its steps, and returns what is made of right values."""

    @learns_from("reward")
    def train(case: Case) -> Any:
        env = case.env()
        rng = np.random.default_rng(case.seed)
        env.reset()
        for _ in range(int(share * case.steps)):
            *_, terminated, truncated, _ = env.step(actions(rng))
            if terminated or truncated:
                env.reset()
        return learned(np.array(RIGHT[case.task.name], float), case)

    return train


def examined(train: Callable[[Case], Any], steps: int = 2000) -> Exam:
    return examine(train, suite="probes", tasks=TASKS, seeds=3, steps=steps, twins=0)


def numbers(exam: Exam, name: str) -> dict[str, list[Any]]:
    """Return a number of each seed, by task."""
    by_task = defaultdict[str, list[Any]](list)
    for score in exam["scores"]:
        if score["peek"] is None:
            task = score["task"].removeprefix("probes/").removesuffix("-v0")
            by_task[task].append(score.get(name))
    return by_task


def told(exam: Exam) -> list[str]:
    return column(exam["diagnoses"], "name")


def q_values(change: Callable[[Array, Case], Array]) -> Callable[[Array, Case], Learned]:
    return lambda right, case: Learned(change(right, case), discount=GAMMA)


def test_right_values_have_no_errors_at_ends_and_before_them() -> None:
    exam = examined(learner(q_values(lambda right, _: right)))
    for name in ("at_ends", "before_ends"):
        for errors in numbers(exam, name).values():
            np.testing.assert_allclose(errors, 0, atol=1e-12)
    assert numbers(exam, "tried") == dict.fromkeys(TASKS, [1.0] * 3)
    assert told(exam) == []


def test_values_that_are_wrong_before_ends_are_told() -> None:
    """A target that adds the rewards of the next step, not its value."""

    def sees_two_steps(right: Array, case: Case) -> Array:
        if case.task.name == "Patience":
            right[:3] = 0
            right[0, 0] = 1
        return right

    exam = examined(learner(q_values(sees_two_steps)))
    assert numbers(exam, "at_ends")["Patience"] == [0.0] * 3
    assert min(numbers(exam, "before_ends")["Patience"]) > 0.3
    assert told(exam) == ["what_follows"]
    assert "Where to look: its values are right where an episode ends, wrong before it" in page(card(exam))


def noisy(right: Array, case: Case) -> Array:
    """Add what no operator does."""
    return right + np.random.default_rng(len(right)).permutation(len(right))[:, None] * 0.4


def test_values_that_stay_wrong_at_ends_are_told() -> None:
    exam = examined(learner(q_values(noisy)))
    left = numbers(exam, "left")
    step = "Patience, seed 0: the value of a = take in s = "
    assert step in " ".join(exam["diagnoses"][0]["evidence"])
    assert left["Patience"] == pytest.approx([1.0] * 3)
    assert told(exam) == ["wrong_at_ends"]


def test_values_that_are_not_finished_are_told_nothing() -> None:
    """The error is halved in 2000 steps."""

    def on_the_way(right: Array, case: Case) -> Array:
        share = 1 - 0.5 ** (case.steps / 2000)
        return share * right + (1 - share) * right.mean()

    exam = examined(learner(q_values(on_the_way)))
    assert min(numbers(exam, "at_ends")["Patience"]) > 0.2
    assert numbers(exam, "left")["Patience"] == pytest.approx([0.125] * 3)
    assert told(exam) == []


def test_errors_are_compared_where_both_runs_have_them() -> None:
    """A policy may never take the steps that go on, in one of two runs."""
    before = entry("Sizes", 0, 0.0, at_ends=2.0, before_ends=None)
    later = entry("Sizes", 0, 0.0, at_ends=1.0, before_ends=9.0, peek="extended") | {"steps": 200_000}
    scores: Any = [before, later]
    compare_with_extended(scores)
    assert before["left"] == 0.5


def test_values_that_hardly_move_are_told() -> None:
    """Each update takes the ones before it away, as `0.1 * target - q` has no parentheses."""

    @learns_from("reward")
    def forgetful(case: Case) -> Learned:
        env = case.env()
        rng = np.random.default_rng(case.seed)
        q = np.zeros((case.observation_space.n, 2))
        s, _ = env.reset(seed=case.seed)
        for _ in range(case.steps):
            a = at_random(rng)
            s_next, reward, terminated, truncated, _ = env.step(a)
            target = reward + GAMMA * (not terminated) * q[s_next].max()
            q[s, a] += 0.1 * target - q[s, a]
            s = env.reset()[0] if terminated or truncated else s_next
        return Learned(q, discount=GAMMA)

    tasks = (*TASKS, "EndInPlace", "Hazard", "ValueLeft")
    exam = examine(forgetful, suite="probes", tasks=tasks, seeds=3, steps=2000, twins=0)
    assert max(numbers(exam, "moved")["Patience"]) < 0.2
    assert told(exam) == ["unmoved"]


def test_values_of_steps_that_were_hardly_taken_are_not_compared() -> None:
    exam = examined(learner(q_values(noisy)), steps=50)
    assert numbers(exam, "at_ends") == dict.fromkeys(TASKS, [None] * 3)


def first_action(right: Array, case: Case) -> Array:
    return np.tile([1.0, 0.0], (len(right), 1))


def test_actions_that_are_never_tried_are_told() -> None:
    exam = examined(learner(first_action, lambda rng: 0))
    assert numbers(exam, "tried") == dict.fromkeys(TASKS, [0.5] * 3)
    assert told(exam) == ["untried"]


def test_a_policy_that_is_not_the_one_that_plays_is_told() -> None:
    exam = examined(learner(first_action, lambda rng: int(rng.random() < 0.9)))
    assert numbers(exam, "agrees") == dict.fromkeys(TASKS, [0.0] * 3)
    assert told(exam) == ["plays_otherwise"]
    agreeing = examined(learner(first_action, lambda rng: int(rng.random() < 0.1)))
    assert numbers(agreeing, "agrees") == dict.fromkeys(TASKS, [1.0] * 3)
    assert told(agreeing) == []


def test_a_clone_of_rows_that_nobody_demonstrated_is_told() -> None:
    """Padding: the first action in the first observation, as often as all else."""

    @learns_from("demonstrations")
    def padded(case: Case) -> Array:
        shown = case.demonstrations
        counts = np.full((case.observation_space.n, 2), 1e-9)
        np.add.at(counts, (shown.obs, shown.acts), 1.0)
        counts[0, 0] += len(shown.obs)
        return counts / counts.sum(axis=1, keepdims=True)

    exam = examined(padded)
    (diagnosis,) = exam["diagnoses"]
    assert diagnosis["name"] == "not_cloned"
    assert "in observation 0 it takes action 0 with a probability of" in diagnosis["evidence"][-1]


def test_a_learner_that_stops_early_is_told() -> None:
    exam = examined(learner(first_action, share=0.4))
    assert numbers(exam, "spent") == dict.fromkeys(TASKS, [0.4] * 3)
    assert told(exam) == ["stops_early"]
    assert told(examined(learner(first_action, share=0.6))) == []


@pytest.mark.parametrize(
    ("regrets", "score", "expected"),
    [
        ((1.0, 1.0), 1.0, ["reward_wrong"]),
        ((0.0, 0.0), 0.0, ["reward_alone"]),
        ((1.0, 0.0), 1.0, []),
        ((0.0, 0.0), 1.0, []),
    ],
)
def test_a_wrong_reward_and_one_that_is_not_followed_are_told(
    regrets: tuple[float, float], score: float, expected: list[str]
) -> None:
    """Two tasks have regrets of their own, the others none."""
    records = []
    for task in (*TASKS, "EndInPlace", "Hazard", "ValueLeft", "Echo"):
        regret = {"EndInPlace": regrets[0], "Sizes": regrets[1]}.get(task, 0.0)
        records += [entry(task, seed, score, reward_regret=regret) | {"task": f"probes/{task}-v0"} for seed in range(5)]
    exam = {
        "tasks": {record["task"]: {"constant": 0.0} for record in records},
        "scores": records,
        "learns_from": ["preferences"],
    }
    assert column(diagnose(exam, "probes"), "name") == expected


@pytest.mark.parametrize(("longer", "expected"), [(0.0, ["reward_blind"]), (1.0, [])])
def test_a_learner_without_rewards_that_stays_at_random_is_told(longer: float, expected: list[str]) -> None:
    records = []
    for task in ("ValueLeft", "SecondThought", "CoinToss", "Sizes", "Echo"):
        for seed in range(6):
            record = entry(task, seed, 0.4 * (-1) ** seed) | {"task": f"probes/{task}-v0"}
            records += [record, record | {"peek": "extended", "stochastic": longer}]
    exam = {
        "tasks": {record["task"]: {"constant": 0.0} for record in records},
        "scores": records,
        "learns_from": ["demonstrations"],
    }
    assert column(diagnose(exam, "probes"), "name") == expected
