"""Twins of tasks with structure: what an exam says of solutions that are written down, and of learned rewards."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.data import demonstrations
from taskspec.exact import Results
from taskspec.exact.scores.difficulty import best_observing
from taskspec.exam import Case, Learned, examine, learns_from
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.learn.exam.asked_tasks import twins_of
from tests.exact.check.test_symmetries import SOLUTIONS, STRUCTURED, Written, walk
from tests.exact.policies.test_memory import tiger
from tests.learn.data.test_teachers import TWICE
from tests.shared.exams import column, flags

pytestmark = pytest.mark.usefixtures("warm")

Array = np.ndarray[Any, Any]


PRINTED = SOLUTIONS | {"NoisyObs": lambda o: walk(2 - o[0], 2 - o[1])}  # on a grid of five rows


def written_down(case: Case) -> Written:
    """What solves the task as its page prints it."""
    return Written(PRINTED[case.task.name])


class Plane:
    """The side of a plane that divides what the demonstrations show, by least squares."""

    def __init__(self, case: Case) -> None:
        shown = case.demonstrations
        self.weights = np.linalg.lstsq(shown.obs - 0.5, 2.0 * shown.acts - 1, rcond=None)[0]

    def predict(self, observations: Any) -> Array:
        return (np.asarray(observations - 0.5) @ self.weights > 0).astype(np.int64)


@pytest.mark.slow
def test_solutions_that_are_written_down_are_flagged_and_what_is_learned_is_not() -> None:
    found = examine(written_down, tasks=list(STRUCTURED), seeds=5, twins=1)
    assert {f"derail/{name}-v0" for name in STRUCTURED} == set(column(flags(found, "twin"), "task"))
    learned = examine(Plane, tasks=["LargestSum"], seeds=3, twins=1)
    assert learned["flags"] == []
    for score in learned["scores"]:
        assert score["deterministic"] == pytest.approx(1, abs=0.05)


def test_tasks_have_the_twins_that_suit_them() -> None:
    assert twins_of(taskspec.load("derail/ProcGoal"), 2) == (("symmetry=mirror",), ("symmetry=turned",))
    assert twins_of(taskspec.load("derail/Sort"), 2) == (("symmetry=downwards",),)
    assert twins_of(taskspec.load("derail/Sort"), 0) == ()
    for twin in twins_of(taskspec.load("derail/RiskyPath"), 2):
        assert "relabelled" in twin[1]


def test_twins_of_a_task_that_hides_its_state_pay_who_remembers_what_the_task_pays() -> None:
    """A permutation for each hidden state cannot be known, or tells of the state."""
    task = tiger()
    twins = twins_of(task, 2)
    assert len(set(twins)) == 2
    for each in twins:
        twin = Results(taskspec.modify(task, *each))
        assert best_observing(twin, "remembering") == best_observing(Results(task), "remembering")
        assert twin.enclosure("expert") == Results(task).enclosure("expert")
    assert "per_state=true" in twins_of(taskspec.load("derail/RiskyPath"), 1)[0][0]  # which shows its state


@pytest.mark.parametrize("name", ["RiskyPath", "InitShiftExpert"])
def test_seeds_of_twins_are_those_under_which_the_expert_acts_differently(name: str) -> None:
    """The first seed under which no action is always the expert's, then the one that differs most from those chosen before."""
    task = taskspec.load(f"derail/{name}")
    names = {}
    for seed in range(1, 17):
        twin = taskspec.modify(task, f"permuted_actions={seed},per_state=true")
        names[seed] = demonstrations(twin, "optimal" if twin.annotations.expert is None else "expert", episodes=8).acts
    seeds = np.array(list(names))
    acts = np.stack(list(names.values()))
    varied = np.ptp(acts, axis=1) > 0
    nearest = np.where(varied, np.inf, -1.0)  # how much a twin differs from the nearest that is chosen
    chosen = []
    for _ in range(3):
        best = int(nearest.argmax())
        chosen.append(int(seeds[best]))
        nearest = np.minimum(nearest, np.count_nonzero(acts != acts[best], axis=1))
        nearest[best] = -1
    assert len(set(chosen)) == 3
    for twin, seed in zip(twins_of(task, 3), chosen, strict=True):
        assert twin == (f"permuted_actions={seed},per_state=true", f"relabelled={seed}")


def test_a_learner_is_trained_on_each_twin_with_the_seeds_of_the_exam() -> None:
    trained = []

    def learner(case: Case) -> Any:
        trained.append((tuple(map(str, case.task.modifiers)), case.seed))
        return lambda observation: 0

    found = examine(learner, tasks=["RiskyPath"], seeds=[4, 7], twins=2, learns_from=["reward"])
    twins = twins_of(taskspec.load("derail/RiskyPath"), 2)
    assert sorted(trained) == sorted(product(((), *twins), (4, 7)))
    scored = [(score["twin"] or "", score["seed"]) for score in found["scores"]]
    assert sorted(scored) == sorted(("+".join(twin), seed) for twin, seed in trained)


@pytest.mark.parametrize(("sign", "starc", "lost"), [(3.0, 0.0, 0.0), (-1.0, 1.0, 8 / (10 - 3.875))])
def test_what_is_told_of_a_learned_reward_is_in_the_results(sign: float, starc: float, lost: float) -> None:
    """EarlyTermPos pays 1 a step; who wants the opposite ends it in the second step and gets 2 of 10; random gets 3.875."""

    def learner(case: Case) -> Learned:
        paid = taskspec.data.tabular(case.task).R[:, :, None] * np.ones(taskspec.data.tabular(case.task).n_states)
        return Learned(lambda observation: 0, sign * paid)

    found = examine(learner, tasks=["EarlyTermPos"], seeds=1, twins=1, learns_from=["reward"])
    printed, twin = (score for score in found["scores"] if score["peek"] is None)
    for each in (printed, twin):
        assert each["starc"] == pytest.approx(starc, abs=1e-9)
        assert each["reward_regret"] == pytest.approx(lost)


@learns_from("preferences")
def by_preferences(case: Case) -> Any:
    """The action of which whole episodes are preferred."""
    env = case.env()
    shown = []
    for action in (0, 1):
        seen = [env.reset()[0]]
        done = False
        while not done:
            after, _, terminated, truncated, _ = env.step(action)
            seen = [*seen, after]
            done = terminated or truncated
        shown.append(SimpleNamespace(obs=np.array(seen), acts=np.full(len(seen) - 1, action)))
    return lambda _: int(case.prefer(*shown) == 0)


def test_comparisons_are_of_discounted_returns() -> None:
    """Where later rewards count a quarter, 1 now is preferred to 2 in the second step; without a discount it is not."""
    answers = []

    @learns_from("preferences")
    def asking(case: Case) -> Any:
        env = case.env()
        shown = []
        for actions in ((1, 0), (0, 1)):
            seen = [env.reset()[0]]
            for action in actions:
                seen.append(env.step(action)[0])
            shown.append(SimpleNamespace(obs=np.array(seen), acts=np.array(actions)))
        answers.append(case.prefer(*shown))
        return lambda observation: 1

    for text in (TWICE, TWICE.replace("discount: 1/4", "discount: 1")):
        examine(asking, tasks=[build(read_text(text))], seeds=1, twins=0, peeks=False)
    assert answers == [1.0, 0.0]


def test_who_learns_from_preferences_does_not_peek() -> None:
    found = examine(by_preferences, tasks=["EarlyTermPos", "EarlyTermNeg"], seeds=2, twins=0)
    assert set(column(found["scores"], "deterministic")) == {1.0} and found["flags"] == []
