"""What is compared: two learners side by side, an exam with an earlier one; and how many seeds and steps an exam chooses."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats

from taskspec.base.diagnostics import SpecError
from taskspec.data import tabular
from taskspec.exam import Case, Learned, examine, learns_from
from taskspec.learn.exam.changes import almost, changes
from taskspec.learn.exam.comparison import LEVELS, _estimated, compare
from taskspec.learn.exam.findings import new_diagnoses
from tests.shared.commands import Done
from tests.shared.exams import column, diagnosed, exam, flags

pytestmark = pytest.mark.usefixtures("warm")

TASK = "EarlyTermPos"


def test_numbers_over_all_runs_are_those_of_scipy() -> None:
    rng = np.random.default_rng(1)
    first = {"Sort": rng.uniform(0, 1, 15).tolist(), "Parabola": rng.uniform(0.5, 1, 15).tolist()}
    second = {"Sort": rng.uniform(0, 0.8, 15).tolist(), "Parabola": rng.uniform(0.5, 1, 15).tolist()}
    exams: Any = {"a": exam(first, learner="a"), "b": exam(second, learner="b")}
    found = compare(exams)
    everything = np.concatenate([first["Sort"], first["Parabola"]])
    assert found["learners"][0]["iqm"]["value"] == pytest.approx(scipy.stats.trim_mean(everything, 0.25))
    assert found["learners"][0]["profile"][LEVELS.index(0.5)] == np.mean(everything > 0.5)
    (pair,) = found["pairs"]
    wins = scipy.stats.mannwhitneyu(list(first.values()), list(second.values()), axis=1).statistic
    assert pair["probability"]["value"] == pytest.approx(np.mean(wins / 15**2))
    assert pair["probability"]["low"] < pair["probability"]["value"] < pair["probability"]["high"]


def test_the_interval_of_a_mean_is_students() -> None:
    """A jackknife of the mean has the usual standard error; the interval of a probability ends at 1."""
    scores = np.array([0.1, 0.4, 0.45, 0.7, 0.9])
    found = _estimated(lambda runs: float(np.mean(runs[0])), [scores])
    expected = scipy.stats.t.interval(0.95, 4, scores.mean(), scipy.stats.sem(scores))
    assert (found["low"], found["high"]) == pytest.approx(expected)
    higher: Any = exam({"Sort": (scores + 0.5).tolist()}, seeds=5, learner="a")
    lower: Any = exam({"Sort": scores.tolist()}, seeds=5, learner="b")
    (pair,) = compare({"a": higher, "b": lower})["pairs"]
    assert 0.5 < pair["probability"]["low"] < pair["probability"]["high"] == 1.0


def test_the_command_examines_two_learners_side_by_side(tmp_path: Path) -> None:
    (tmp_path / "two.py").write_text(
        "import numpy as np\n"
        "def leaves(case): return np.ones(case.observation_space.n, int)\n"
        "def stays(case): return np.zeros(case.observation_space.n, int)\n"
    )
    options = ["-t", TASK, "--seeds", "2", "--steps", "1k", "--twins", "0", "--learns-from", "reward", "-j", "1"]
    two = tmp_path / "two.py"
    done = Done("exam", f"{two}:leaves", f"{two}:stays", *options, "--out", tmp_path / "out")
    assert "IQM" in done.out and "P(" in done.out
    assert (tmp_path / "out" / "two-stays" / "exam.json").exists()


def values_of_a_walk(factor: float) -> Any:
    """Return a learner that takes the best action from Q-values that are some multiple of the right ones."""

    @learns_from("reward")
    def train(case: Case) -> Learned:
        noise = np.random.default_rng(case.seed).normal(0, 0.01, (case.observation_space.n, 1))
        q = tabular(case.task).R[: case.observation_space.n] + noise
        return Learned(q, q=factor * q, discount=0.9)

    return train


BRANCHING = {"InitShiftLearner": 1.0, "Branching": 0.0}


@pytest.mark.parametrize(("before", "is_new"), [([1.0, 1.0, 0.0, 0.0, 0.0, 0.0], False), ([1.0] * 6, True)])
def test_a_diagnosis_is_new_where_the_scores_differ_by_more_than_chance(before: list[float], is_new: bool) -> None:
    """No seed finds the path: that is news where all of them did, and chance where two of six did."""
    now: Any = exam(BRANCHING, seeds=6, learns_from=["reward"])
    earlier: Any = exam(BRANCHING | {"Branching": before}, seeds=6, learns_from=["reward"])
    p_value = scipy.stats.fisher_exact([[0, 6], [sum(before), 6 - sum(before)]]).pvalue
    assert bool(p_value < 0.01) is is_new
    assert "never_finds" in diagnosed(now)
    assert ("never_finds" in column(new_diagnoses(now, earlier, "derail"), "name")) is is_new


def test_the_exam_flags_a_new_diagnosis(tmp_path: Path) -> None:
    def cloned(case: Case) -> Any:
        counts = np.zeros((case.observation_space.n, case.action_space.n))
        np.add.at(counts, (case.demonstrations.obs, case.demonstrations.acts), 1.0)
        return counts

    def lost(case: Case) -> Any:
        return cloned(case) * (case.task.name != "Branching")

    terms: dict[str, Any] = {"tasks": ["Branching", "EarlyTermPos", "RiskyPath"], "seeds": 6, "twins": 0}
    examine(cloned, **terms, out=tmp_path)
    found = examine(lost, **terms, against=tmp_path)
    (flag,) = flags(found, "diagnosis")
    assert flag["task"] == "derail/Branching-v0" and "Loses credit over ten steps" in flag["message"]


def test_a_policy_that_still_explores_is_flagged_although_its_best_actions_are_right(tmp_path: Path) -> None:
    """The policy of the baseline has no chance, so that its drawn actions are its best ones."""

    @learns_from("reward")
    def greedy(case: Case) -> Learned:
        best = tabular(case.task).R[: case.observation_space.n].argmax(axis=1)
        return Learned(np.eye(case.action_space.n)[best])

    @learns_from("reward")
    def exploring(case: Case) -> Learned:
        return Learned(0.5 * greedy(case).policy + 0.5 / case.action_space.n)

    terms: Any = {"tasks": [f"derail/{TASK}-v0"], "seeds": 5, "steps": 100, "twins": 0}
    examine(greedy, out=tmp_path, **terms)
    (flag,) = flags(examine(exploring, against=tmp_path, **terms), "changed")
    assert "the score of drawn actions is" in flag["message"]


def test_values_that_differ_are_flagged_although_scores_are_equal(tmp_path: Path) -> None:
    terms: dict[str, Any] = {"tasks": ["probes/EndInPlace"], "steps": 100, "twins": 0}
    examine(values_of_a_walk(1.0), **terms, seeds=range(6), out=tmp_path)
    same = examine(values_of_a_walk(1.0), **terms, seeds=range(10, 16), against=tmp_path)
    assert flags(same, "changed", "regression") == []
    other = examine(values_of_a_walk(3.0), **terms, seeds=range(10, 16), against=tmp_path)
    (flag,) = flags(other, "changed", "regression")
    assert flag["kind"] == "changed" and "value of the first states" in flag["message"]


def of_values(distances: Sequence[float], task: str = TASK, **others: Any) -> Any:
    """An exam in which values have a distance to the right ones for each seed, and every score is 1."""
    found = exam({task: 1.0}, seeds=len(distances), **others)
    for score, distance in zip(found["scores"], distances, strict=True):
        score["operators"] = {"right": distance}
    return found


@pytest.mark.parametrize(("now", "is_flagged"), [(0.3, True), (0.13, False)])
def test_values_that_are_farther_from_right_ones_are_flagged(now: float, is_flagged: bool) -> None:
    noise = np.array([0.0, 0.01, 0.02, 0.03, 0.04])
    other = of_values((now + noise).tolist())
    found = changes(other["tasks"], other["scores"], of_values((0.1 + noise).tolist()))
    assert len(found) == is_flagged
    for flag in found:
        assert "farther from the right ones" in flag["message"]


def test_the_largest_drop_that_is_no_flag_is_told_with_the_seeds_that_would_flag_it() -> None:
    now: Any = exam({"RiskyPath": [1.0, -1.0, 1.0, -1.0, -1.0], "Branching": 0.99}, seeds=5)
    before: Any = exam({"RiskyPath": 1.0, "Branching": 1.0}, seeds=5)
    assert changes(now["tasks"], now["scores"], before) == []
    (line,) = almost(now["tasks"], now["scores"], before)
    assert (
        line == "RiskyPath: the score is 1.20 below that of the baseline (p = 0.083); about 15 seeds of both would tell"
    )
    more = {"RiskyPath": [1.0, -1.0, 1.0, -1.0, -1.0] * 3, "Branching": 0.99}
    again: Any = exam(more, seeds=15)
    (flag,) = changes(again["tasks"], again["scores"], exam({"RiskyPath": 1.0, "Branching": 1.0}, seeds=15))  # type: ignore[arg-type]
    assert flag["kind"] == "regression"
    assert almost(before["tasks"], before["scores"], before) == []


@pytest.mark.parametrize("mode", ["alone", "SameStep", "NextStep"])
def test_training_episodes_are_a_learning_curve(mode: str) -> None:
    returns = []

    @learns_from("reward")
    def train(case: Case) -> Any:
        rng = np.random.default_rng(0)
        if mode == "alone":
            env: Any = case.env()
            lanes = 1
        else:
            lanes = 4
            env = case.make_vec(lanes, autoreset_mode=mode)
        env.reset()
        total = np.zeros(lanes)
        for _ in range(case.steps // lanes):
            action = rng.integers(2, size=lanes)
            _, reward, terminated, truncated, _ = env.step(int(action[0]) if mode == "alone" else action)
            total += reward
            over = np.broadcast_to(np.asarray(terminated) | truncated, lanes)
            returns.extend(total[over].tolist())
            total[over] = 0
            if mode == "alone" and over[0]:
                env.reset()
        return np.zeros(case.observation_space.n, int)

    found = examine(train, tasks=[TASK], seeds=1, steps=2_000, twins=0)
    (score,) = found["scores"]
    about = found["tasks"][score["task"]]
    random = about["random"]
    expert = about["expert"]
    assert random is not None and expert is not None and score["curve"] is not None
    _, means = np.transpose(score["curve"])
    assert len(means) == 20
    assert np.mean(means) == pytest.approx((np.mean(returns) - random) / (expert - random), abs=0.05)


def test_policies_are_scored_on_a_longer_horizon() -> None:
    @learns_from("reward")
    def work(case: Case) -> Any:
        return np.zeros(case.observation_space.n, int)

    found = examine(work, tasks=["probes/EndInPlace"], seeds=1, steps=10, twins=0)
    (score,) = found["scores"]
    assert score["longer"] is not None and score["longer"] == pytest.approx(score["deterministic"], abs=0.2)


@pytest.mark.parametrize(("action", "seeds", "verdict"), [(0, 17, "passes"), (1, 4, "fails")])
def test_seeds_are_added_until_it_is_sure(action: int, seeds: int, verdict: str) -> None:
    @learns_from("reward")
    def always(case: Case) -> Any:
        return np.full(case.observation_space.n, action)

    found = examine(always, tasks=["derail/InitShiftLearner"], until_sure=True, steps=10, twins=0)
    (each,) = found["verdicts"].values()
    assert (len(found["seeds"]), each["verdict"]) == (seeds, verdict)


def test_seeds_and_steps_are_chosen_within_a_time() -> None:
    @learns_from("reward")
    def walks(case: Case) -> Any:
        env = case.env()
        env.reset()
        for _ in range(case.steps):
            _, _, terminated, truncated, _ = env.step(0)
            if terminated or truncated:
                env.reset()
        return np.zeros(case.observation_space.n, int)

    found = examine(walks, tasks=[TASK], within=2.0, twins=0)
    assert 1 <= len(found["seeds"]) <= 15 and 1_000 <= found["steps"] <= 500_000
    with pytest.raises(SpecError, match="too short for one seed"):
        examine(walks, tasks=[TASK], within=1e-3, twins=0)
