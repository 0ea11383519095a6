"""The exam, through the command and the function: what a learner is given, what its policy scores, what fails alone."""

from __future__ import annotations

import json
from collections import defaultdict
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats

import taskspec
from taskspec.exam import BudgetSpent, Case, NotGranted, examine, read
from taskspec.learn.exam.card import card
from taskspec.learn.exam.case import ExamTerms
from taskspec.learn.exam.verdicts import mean_score
from taskspec.learn.statistics import differences, rate_interval, seeds_interval
from tests.learn.learners import counting
from tests.shared.commands import Done, spec

pytestmark = pytest.mark.usefixtures("warm")

LEARNERS = Path(counting.__file__)
FINITE = ["RiskyPath", "EarlyTermPos", "EarlyTermNeg", "Branching"]


def means(exam: Any, which: str = "deterministic") -> dict[tuple[str, str], float]:
    """Mean scores by task and "printed", "twins" or "negated"."""
    found = defaultdict(list)
    for score in exam["scores"]:
        side = score["peek"] or ("printed" if score["twin"] is None else "twins")
        found[score["task"].removeprefix("derail/").removesuffix("-v0"), side].append(score[which])
    return {key: float(np.mean(scores)) for key, scores in found.items()}


def case(task: str = "derail/RiskyPath", steps: int = 100, *sources: Any) -> Case:
    return Case(taskspec.load(task), [3], ExamTerms(steps, sources, 50))


def test_the_reward_is_withheld_from_those_who_are_not_entitled_to_it() -> None:
    for sources, paid in (((), 0.0), (("reward",), 1.0)):
        env = case("derail/EarlyTermPos", 100, *sources).env()
        env.reset()
        for _ in range(10):
            assert env.step(0)[1] == paid
        lanes = case("derail/EarlyTermPos", 100, *sources).make_vec(5)
        lanes.reset()
        assert (lanes.step(np.zeros(5, int))[1] == paid).all()
    assert not case("derail/RiskyPath", 9, "demonstrations").demonstrations.rews.any()
    assert case("derail/RiskyPath", 9, "demonstrations", "reward").demonstrations.rews.any()


def test_what_a_case_gives_pays_no_reward_and_has_no_expert_that_is_not_granted() -> None:
    task = taskspec.modify(taskspec.load("derail/EarlyTermPos"), "sticky=0.5")
    given = Case(task, [3], ExamTerms(100, (), 50))
    for each in (given.task, given.task.unmodified):
        assert not taskspec.data.tabular(each).R.any()
        assert each.annotations.expert is None and each.annotations.claims == () and each.annotations.examples == ()
    negated = Case(task, [3], ExamTerms(100, (), 50), negated=True)
    assert np.array_equal(taskspec.data.tabular(negated.task).R, -taskspec.data.tabular(task).R)
    assert len({task.content_hash, given.task.content_hash, negated.task.content_hash}) == 3


def test_demonstrations_say_nothing_of_rewards() -> None:
    shown = case("derail/RiskyPath", 9, "demonstrations").demonstrations
    assert (
        shown.task is not None
        and not taskspec.data.tabular(shown.task).R.any()
        and shown.task.annotations.expert is None
    )
    assert "return" not in shown.metadata


def test_what_is_not_granted_is_refused_with_how_to_get_it() -> None:
    for use in (lambda c: c.demonstrations, lambda c: c.prefer(None, None), lambda c: c.judge):
        with pytest.raises(NotGranted, match=r"learns from reward, and not from .*--learns-from"):
            use(case("derail/RiskyPath", 9, "reward"))


def test_steps_are_counted_up_to_the_budget_in_every_environment() -> None:
    given = case(steps=10)
    env = given.env()
    lanes = given.make_vec(4)
    env.reset(), lanes.reset()
    for _ in range(2):
        env.step(0), lanes.step(np.zeros(4, int))
    assert given.spent.steps == 10
    with pytest.raises(BudgetSpent, match="budget of 10 steps"):
        env.step(0)
    with pytest.raises(BudgetSpent):
        lanes.step(np.zeros(4, int))


def test_environments_of_a_seed_are_repeatable_and_each_its_own() -> None:
    def walks() -> list[tuple[Any, ...]]:
        given = case(steps=1000)
        found = []
        for _ in range(20):
            env = given.env()
            env.reset()
            env.step(1)
            env.reset()
            found.append(tuple(env.step(1)[0] for _ in range(5)))
        return found

    first = walks()
    assert first == walks() and len(set(first)) > 1


def test_preferences_go_by_the_true_return_though_rewards_are_withheld() -> None:
    given = case("derail/NoisyObs", 1000, "preferences", "demonstrations")
    env = given.env()
    expert = given.demonstrations.trajectories[0]
    seen = [env.reset()[0]]
    done = []
    for _ in range(len(expert)):
        done.append(0)
        seen.append(env.step(0)[0])
    poor = taskspec.data.Trajectory(np.array(seen), np.array(done), np.zeros(len(done)), False, True)
    assert [given.prefer(expert, poor), given.prefer(poor, expert), given.prefer(poor, poor)] == [1.0, 0.0, 0.5]
    assert given.spent.comparisons == 3
    noisy = [given.prefer(expert, poor, temperature=100.0) for _ in range(200)]
    assert 0.3 < np.mean(noisy) < 0.7
    with pytest.raises(ValueError, match="have shown"):
        given.prefer(expert, taskspec.data.Trajectory(poor.obs + 1, poor.acts, poor.rews, False, True))


def test_a_policy_without_a_preference_is_random_and_not_action_0() -> None:
    found = examine(counting.indifferent, tasks=FINITE, seeds=1, twins=0)
    for which in ("deterministic", "stochastic"):
        assert list(means(found, which).values()) == pytest.approx([0] * 8)  # also where the reward is negated


def test_q_learning_masters_tasks_as_printed_and_their_twins() -> None:
    def best_actions(case: Case) -> np.ndarray:
        return counting.q_learning(case).argmax(axis=1)

    tasks = ["EarlyTermPos", "EarlyTermNeg", "InitShiftLearner"]
    found = means(examine(best_actions, tasks=tasks, seeds=1, steps=3000, twins=1, learns_from=["reward"]))
    assert list(found.values()) == pytest.approx([1] * 6)


def test_every_form_of_a_policy_scores_the_same() -> None:
    task = taskspec.load("derail/Branching")
    seen = case("derail/Branching", 9, "demonstrations").demonstrations
    table = np.zeros(21, int)
    table[seen.obs] = seen.acts

    class Predicts:
        def predict(self, observations: Any, deterministic: bool = True) -> Any:
            return table[observations], None

    class Tells:
        def probabilities(self, observations: Any) -> Any:
            return np.eye(2)[table[observations]]

    forms = [
        table, np.eye(2)[table], 5 * np.eye(2)[table], np.stack([table] * 10), lambda seen: int(table[seen]), Predicts(),
        Tells(), taskspec.exam.Learned(table),
    ]  # fmt: skip
    for form in forms:
        found = examine(lambda case, form=form: form, tasks=[task], seeds=1, twins=0, learns_from=["reward"])
        score = found["scores"][0]
        assert score["deterministic"] == score["stochastic"] == score["return"] == 1.0


def test_the_policy_that_draws_is_scored_beside_its_best_actions() -> None:
    pi = np.tile([0.6, 0.4], (4, 1))
    found = examine(lambda case: pi, tasks=["RiskyPath"], seeds=1, twins=0, learns_from=["reward"])
    score = found["scores"][0]
    exact = taskspec.exact.score("derail/RiskyPath", pi).normalised
    assert score["deterministic"] == 1.0 and score["stochastic"] == pytest.approx(exact)


@pytest.mark.parametrize("size", [0.01, 1, 1000])
@pytest.mark.parametrize(("behind", "is_tied"), [(0.9e-9, True), (1.1e-9, False)])
def test_actions_whose_values_differ_by_a_billionth_are_tied(size: float, behind: float, is_tied: bool) -> None:
    """A billionth of the size of the values, or of 1 where they are smaller: tied actions are taken as often."""
    top = size * np.ones((4, 1))
    values = np.hstack([top, top - behind * max(size, 1)])
    found = examine(lambda case: values, tasks=["RiskyPath"], seeds=1, twins=0, learns_from=["reward"])
    task = taskspec.load("derail/RiskyPath")
    pi = np.tile([0.5, 0.5] if is_tied else [1.0, 0.0], (4, 1))
    assert found["scores"][0]["deterministic"] == pytest.approx(taskspec.exact.score(task, pi).normalised)


def test_tasks_without_a_model_are_scored_in_episodes() -> None:
    found = examine(lambda case: lambda seen: 0, tasks=["LargestSum"], seeds=1, learns_from=["reward"])
    for score in found["scores"]:
        assert 0 < score["half"] < 0.1 and abs(score["deterministic"]) < 2 * score["half"]


def test_a_block_of_seeds_that_trains_together_is_scored_seed_by_seed() -> None:
    def block(case: Case) -> list[np.ndarray]:
        case.count(10)
        case.each[1].count(5)
        case.show(*[np.zeros((3, 2))] * len(case.seeds))
        return [np.full(3, seed % 2) for seed in case.seeds]

    block.together = True
    block.learns_from = ("reward",)
    even, odd = examine(block, tasks=["EarlyTermNeg"], seeds=[4, 5], twins=0)["scores"]
    assert (even["seed"], even["steps"], odd["seed"], odd["steps"]) == (4, 10, 5, 15)
    assert even["deterministic"] != 1 and odd["deterministic"] == 1
    assert even["curve"] == odd["curve"] == [[10, pytest.approx(0)]]
    wrong = examine(lambda case: 3, tasks=["EarlyTermNeg"], seeds=1, twins=0, learns_from=["reward"])["scores"][0]
    assert "int is not a policy" in wrong["error"]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (np.full((4, 2), np.nan), "no finite number"), (np.full((4, 2), -np.inf), "no finite number"),
        (np.full((2, 4), 0.5), "actions are the last axis"), (np.full((4, 3), 0.5), "not (4, 3)"),
    ],
)  # fmt: skip
def test_a_table_that_is_no_policy_is_told_what_is_wrong_with_it(table: np.ndarray, message: str) -> None:
    found = examine(lambda case: table, tasks=["RiskyPath"], seeds=1, twins=0, learns_from=["reward"])
    assert message in found["scores"][0]["error"]


COINS = """
taskspec: 1
name: Coins
state: {coin: {type: bool}}
action: {a: {type: choice, values: [skip, heads, tails]}}
horizon: 4
terminal: false
initial: {coin: false}
dynamics: {"coin'": Bernoulli(1/2)}
reward: "0 if a == skip else 1 if (a == heads) == coin' else -1/2"
expert: optimal
"""


class Foresees:
    """A policy that has seen the episodes on which it is scored."""

    def __init__(self, task: Any, episodes: int) -> None:
        self.coins = []
        self.asked = 0
        self.time = -1
        for seed in range(episodes):
            env = taskspec.make(task)
            env.reset(seed=seed)
            self.coins.append([env.step(0)[0] for _ in range(4)])

    def predict(self, observations: Any) -> Any:
        self.asked += 1
        if len(observations) < len(self.coins):
            return np.full(len(observations), self.asked % 2)  # never the same, so that it is scored in episodes
        self.time += 1
        return 2 - np.array(self.coins)[:, self.time].reshape(-1)


def test_scores_above_the_optimum_are_flagged_as_impossible(tmp_path: Path) -> None:
    task = taskspec.load(spec(tmp_path, COINS))
    terms = {"tasks": [task], "seeds": 2, "twins": 0, "learns_from": ["reward"], "suite": "derail"}
    found = examine(lambda case: Foresees(case.task, 1000), **terms)
    for score in found["scores"]:
        assert score["return"] == 4.0
    (flag,) = found["flags"]
    assert flag["kind"] == "impossible" and "is 4, and no policy has more than 1" in flag["message"]
    best = examine(lambda case: np.tile(np.float32([0, 0.7, 0.3]), (2, 1)), **terms)
    assert best["flags"] == [] and best["scores"][0]["return"] == pytest.approx(1)


def held(tmp_path: Path, name: str, *options: str) -> tuple[int, Any]:
    done = Done("exam", f"{LEARNERS}:{name}", "--out", str(tmp_path), "--json", "-j", "1", *options)
    assert done.status in (0, 1), done.err
    return done.status, json.loads(done.out)


def test_the_command_finds_what_the_function_finds_and_keeps_it(tmp_path: Path) -> None:
    _, found = held(tmp_path, "clone", "-t", "RiskyPath,EarlyTermNeg", "--seeds", "2", "--steps", "1k")
    here = examine(counting.clone, tasks=["RiskyPath", "EarlyTermNeg"], seeds=2, steps=1000)
    for score, same in zip(found["scores"], here["scores"], strict=True):
        assert score == same | {"seconds": score["seconds"]}
    assert found["tasks"] == here["tasks"] and read(tmp_path) == found
    again = held(tmp_path, "clone", "-t", "RiskyPath,EarlyTermNeg", "--seeds", "2", "--steps", "1k")[1]
    assert again["scores"] == found["scores"]  # their seconds as well: nothing was done anew


def test_a_learner_that_raises_is_told_with_its_own_words_and_place_and_the_others_go_on(tmp_path: Path) -> None:
    _, found = held(tmp_path, "fails_on_seed_1", "-t", "RiskyPath", "--seeds", "3", "--twins", "0")
    first, second, third = (score for score in found["scores"] if score["peek"] is None)
    assert (first["deterministic"], second["deterministic"], third["deterministic"]) == (1.0, None, 1.0)
    line = LEARNERS.read_text(encoding="utf-8").splitlines().index('        raise KeyError("no such thing")') + 1
    assert second["error"] == f"KeyError: 'no such thing'\n  at {LEARNERS}:{line}, in fails_on_seed_1"


def test_a_budget_that_is_overdrawn_is_told(tmp_path: Path) -> None:
    _, found = held(tmp_path, "greedy_for_steps", "-t", "RiskyPath", "--seeds", "1", "--steps", "50", "--twins", "0")
    assert "the budget of 50 steps is spent" in found["scores"][0]["error"]
    assert "in greedy_for_steps" in found["scores"][0]["error"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("missing.py:train",), "E710"), ((f"{LEARNERS}:missing",), "def missing(case)"), (("nobody",), "there is no learner"),
        ((f"{LEARNERS}:clone", "--steps", "many"), "such as 500k"), ((f"{LEARNERS}:clone", "-t", "Riskypth"), "E701"),
        ((f"{LEARNERS}:clone", "--learns-from", "books"), "cannot learn from 'books'"),
        ((f"{LEARNERS}:clone", "--suite", "derial"), "derail"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_with_a_code(arguments: tuple[str, ...], told: str) -> None:
    done = Done("exam", *arguments)
    assert done.status in (1, 2) and told in done.err and "error[E7" in done.err


PAIRED = ("policy", "EarlyTermPos")
"""The flag of a cloner that pairs actions with other observations."""


def flagged(exam: Any) -> set[tuple[str, str]]:
    return {(flag["kind"], flag["task"].removeprefix("derail/").removesuffix("-v0")) for flag in exam["flags"]}


def test_a_learner_that_is_right_by_luck_is_flagged_and_the_right_one_is_not() -> None:
    right = examine(counting.clone, tasks=FINITE, seeds=13, twins=1)
    wrong = examine(counting.clone_off_by_one, tasks=FINITE, seeds=13, twins=1)
    for task in FINITE:
        assert means(right)[task, "printed"] == means(right)[task, "twins"] == pytest.approx(1)
        assert means(wrong)[task, "printed"] == pytest.approx(1) and means(wrong)[task, "twins"] < 0.5
    assert flagged(right) == set() and flagged(wrong) == {*(("twin", task) for task in FINITE), PAIRED}
    for capability in right["verdicts"]:
        assert right["verdicts"][capability]["verdict"] == "masters"
        assert wrong["verdicts"][capability]["verdict"] == "fails"
    early = wrong["verdicts"]["termination"]
    assert (early["mean"], early["seeds"], early["twins"]["verdict"]) == (1.0, 13, "fails")
    assert early["twins"]["high"] < 0


def test_what_a_fixed_action_does_is_no_mastery() -> None:
    """The action 0 scores 0.95 on Parabola and its twin; on RiskyPath one action is best as printed, and none on all twins."""

    def untrained(case: Case) -> Any:
        return lambda observation: np.zeros(1, np.float32)

    found = examine(untrained, tasks=["Parabola"], seeds=13, learns_from=["reward"])
    verdict = found["verdicts"]["control"]
    assert verdict["mean"] > 0.9 and verdict["passed"] == 13 and verdict["verdict"] == "passes"
    nearest = (
        "Nearest known mistake: ignores its observations: on every seed it scores what the best fixed action scores"
    )
    assert card(found).advice.startswith(nearest)
    for twins, grade in ((0, "passes"), (2, "masters")):
        found = examine(counting.clone, tasks=["RiskyPath"], seeds=13, twins=twins)
        assert found["verdicts"]["chance"]["verdict"] == grade


@pytest.mark.parametrize(
    ("passed", "seeds", "grade"),
    [
        (2, 2, "unsure"), (12, 12, "unsure"), (13, 13, "masters"), (14, 15, "unsure"), (19, 20, "masters"),
        (28, 30, "masters"), (27, 30, "unsure"), (0, 3, "fails"), (0, 2, "unsure"),
    ],
)  # fmt: skip
def test_verdicts_rest_on_the_share_of_seeds_that_pass(passed: int, seeds: int, grade: str) -> None:
    found = mean_score([1.0] * passed + [0.2] * (seeds - passed), None)
    assert (found["verdict"], found["passed"]) == (grade, passed)


@pytest.mark.parametrize("rate", [0.8, 0.9, 0.95, 0.99, 1.0])
@pytest.mark.parametrize("seeds", [3, 5, 10, 15, 30])
def test_intervals_of_rates_contain_the_rate_in_19_of_20_exams(rate: float, seeds: int) -> None:
    counts = np.arange(seeds + 1)
    low, high = np.transpose([rate_interval(int(count), seeds) for count in counts])
    chances = scipy.stats.binom.pmf(counts, seeds, rate)
    assert chances[(low <= rate) & (rate <= high)].sum() >= 0.95


def test_intervals_of_scores_with_two_values_are_those_of_the_share() -> None:
    low, high = rate_interval(12, 15)
    assert seeds_interval([0.1] * 3 + [0.9] * 12) == pytest.approx((0.1 + 0.8 * low, 0.1 + 0.8 * high))
    sample = np.random.default_rng(1).normal(size=9)
    theirs = scipy.stats.ttest_1samp(sample, 0).confidence_interval()
    assert seeds_interval(sample) == pytest.approx(tuple(theirs))


def test_five_broken_seeds_of_six_are_flagged_and_equal_scores_are_not() -> None:
    is_first = np.repeat([True, False], 6)
    broken = np.array([0.0] * 5 + [1.0] * 7)[:, None]
    (found,) = differences(broken, is_first, only_below=True)
    assert found.is_real and found.p_value == pytest.approx(7 / 924)  # 7 of 924 choices of six have five zeros
    first, *others = differences(np.hstack([broken, np.ones((12, 9))]), is_first, only_below=True)
    assert first.is_real
    for equal in (*others, *differences(np.ones((12, 3)), is_first)):
        assert not equal.is_real


def test_small_differences_on_all_tasks_are_flagged_together() -> None:
    scores = np.random.default_rng(0).normal(size=(12, 8))
    is_first = np.repeat([True, False], 6)
    assert not any(map(attrgetter("is_real"), differences(scores, is_first)))
    scores[:6] -= 0.9
    (real,) = filter(attrgetter("is_real"), differences(scores, is_first))
    assert real.is_together


def test_permutation_tests_are_those_of_scipy() -> None:
    rng = np.random.default_rng(4)
    now = rng.normal(size=5)
    then = rng.normal(size=6) + 1
    (found,) = differences(np.concatenate([now, then])[:, None], np.arange(11) < 5)
    theirs = scipy.stats.permutation_test((now, then), lambda a, b: abs(a.mean() - b.mean()), alternative="greater")
    assert found.p_value == pytest.approx(theirs.pvalue)
    ends = scipy.stats.ttest_ind(now, then, equal_var=False).confidence_interval()
    assert (found.low, found.high) == pytest.approx(tuple(ends))


def test_twins_that_differed_in_the_baseline_are_no_news(tmp_path: Path) -> None:
    asked: Any = {"tasks": ["EarlyTermPos", "Branching"], "seeds": 5}
    before = examine(counting.clone_off_by_one, out=tmp_path / "before", **asked)
    assert flagged(before) == {("twin", "EarlyTermPos"), ("twin", "Branching"), PAIRED}
    after = examine(counting.clone_off_by_one, out=tmp_path / "after", against=tmp_path / "before", **asked)
    assert flagged(after) == {PAIRED}


def test_a_learner_that_peeks_is_flagged() -> None:
    found = examine(counting.q_peeking, tasks=["EarlyTermPos", "EarlyTermNeg", "RiskyPath"], seeds=5, twins=0)
    assert set(dict(flagged(found))) == {"peeks"}


def test_one_seed_tells_nothing_of_others() -> None:
    found = examine(counting.clone_off_by_one, tasks=["EarlyTermPos"], seeds=1)
    assert flagged(found) == set() and found["verdicts"]["termination"]["verdict"] == "unsure"


def test_what_has_become_worse_is_flagged_against_an_earlier_exam(tmp_path: Path) -> None:
    options = ("-t", "EarlyTermPos", "--seeds", "5", "--steps", "3k", "--twins", "1")
    status, before = held(tmp_path / "before", "q_learning", *options)
    assert status == 0 and flagged(before) == set()
    status, same = held(tmp_path / "again", "q_learning", *options, "--against", str(tmp_path / "before"))
    assert status == 0 and flagged(same) == set()
    status, worse = held(tmp_path / "after", "q_wrong_sign", *options, "--against", str(tmp_path / "before"))
    assert status == 1 and flagged(worse) == {("regression", "EarlyTermPos"), ("changed", "EarlyTermPos")}
    other = Done("exam", f"{LEARNERS}:q_learning", "--steps", "4k", "--against", str(tmp_path / "before"))
    assert other.status == 1 and "had 3,000 steps, this one has 4,000" in other.err
    nothing = Done("exam", f"{LEARNERS}:q_learning", "--against", str(tmp_path))
    assert nothing.status == 1 and "E710" in nothing.err


def test_right_learners_are_not_flagged_on_fresh_seeds_though_their_scores_vary() -> None:
    """A learner whose scores are chance, the same on twins: few of many exams may flag it."""

    def noisy(case: Case) -> np.ndarray:
        rng = np.random.default_rng([case.seed, int(case.task.content_hash[:8], 16)])
        return rng.integers(case.action_space.n, size=case.observation_space.n)

    noisy.learns_from = ("reward",)
    n_flagged = 0
    for first in (0, 5, 10, 15):
        found = examine(noisy, tasks=["EarlyTermPos", "RiskyPath"], seeds=range(first, first + 5), twins=1)
        n_flagged += bool(found["flags"])
    assert n_flagged <= 1


def test_failures_are_flagged_with_what_was_said(tmp_path: Path) -> None:
    status, found = held(tmp_path, "fails_on_seed_1", "-t", "RiskyPath", "--seeds", "3", "--twins", "0")
    (flag,) = found["flags"]
    assert status == 1 and flag["kind"] == "failed" and "2 of 6 runs failed: KeyError" in flag["message"]


def test_who_does_not_say_that_it_learns_from_the_reward_is_told_so_and_nothing_else() -> None:
    def forgetful(case: Case) -> np.ndarray:
        return counting.q_learning(case)

    found = examine(forgetful, seeds=3, twins=1, tasks=["RiskyPath", "EarlyTermPos"], steps=300)
    (diagnosis,) = found["diagnoses"]
    assert diagnosis["name"] == "untouched"


def test_diagnoses_come_with_the_scores() -> None:
    found = examine(
        counting.q_wrong_sign, seeds=2, twins=0, tasks=["EarlyTermPos", "EarlyTermNeg", "RiskyPath"], steps=2000
    )
    assert "reversed" in {diagnosis["name"] for diagnosis in found["diagnoses"]}
