"""Scores, policies, experts as objects, abstractions, reports, compiled sweeps, and the benchmark on a small grid."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import exact
from taskspec.base.diagnostics import SpecError, TaskspecError
from taskspec.exact.rollout.rollout import at_random
from taskspec.exact.scores.returns import Results, Return
from taskspec.language import source
from taskspec.language.task.build import build
from tests.shared.diagnostics import statuses
from tests.shared.specs import spec_file
from tests.shared.tasks import shipped

ROOT = Path(__file__).parents[3]


# -- scores ---------------------------------------------------------------------------------------


def test_scores_of_a_finite_task_are_exact() -> None:
    found = exact.scores(shipped("risky_path"))
    assert (found.optimal, found.worst) == (Return(4.0), Return(-247.5)) and found.optimal.error == 0
    assert found.gap == 0
    assert found.normalise(4.0) == 1
    assert found.normalise(-122.21875) == 0
    assert found.normalise(-247.5) == pytest.approx(-125.28125 / 126.21875)


def test_scores_by_simulation_have_an_interval() -> None:
    found = exact.scores(shipped("largest_sum"))
    assert found.optimal is None
    assert found.gap is None
    assert found.why_not_exact is not None
    assert found.random is not None
    assert not found.random.exact
    low, high = found.random.interval()
    assert low < 0.5 < high
    assert high - low < 0.07
    assert Results(shipped("largest_sum")).random == Results(shipped("largest_sum"), seed=0).random


def test_scores_below_the_floor_are_cut() -> None:
    found = exact.scores(shipped("early_term", "EarlyTermNeg"))
    assert found.normalise(-10) == -1
    assert found.normalise(-10, floor=None) == pytest.approx(-6.125 / 1.875)
    assert found.normalise(-2) == 1


def test_scores_are_kept_and_refused_when_stale(tmp_path: Path) -> None:
    task = shipped("branching")
    found = exact.scores(task)
    path = tmp_path / "scores.json"
    found.save(path)
    assert exact.Scores.load(path, task) == found
    assert json.loads(path.read_text())["gap"] == 0
    with pytest.raises(exact.StaleScores, match="E714"):
        exact.Scores.load(path, shipped("branching", L=5))


DAMAGED = ["", "null", "[]", "3", "NaN", "{}", "[" * 100_000, '{"id": ' + "9" * 5000 + "}", "\udcff"]


@pytest.mark.parametrize("text", DAMAGED, ids=range(len(DAMAGED)))
def test_what_holds_no_scores_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "scores.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(SpecError, match=r"E713.*contains no scores"):
        exact.Scores.load(path, shipped("branching"))


def test_damaged_scores_are_refused(tmp_path: Path) -> None:
    """Each part in turn is left out, or is what it cannot be."""
    task = shipped("branching")
    path = tmp_path / "scores.json"
    exact.scores(task).save(path)
    whole = json.loads(path.read_text())
    parts: list[tuple[str, ...]] = [(name,) for name in whole if name != "gap"]
    parts += [("optimal", name) for name in whole["optimal"] if name != "status"]
    for part in parts:
        for wrong in ({}, "x", [[1]], True, None, -0.5, ...):
            data = json.loads(json.dumps(whole))
            holder = data if len(part) == 1 else data[part[0]]
            if wrong is ...:
                del holder[part[-1]]
            else:
                holder[part[-1]] = wrong
            if taken(part[-1], wrong):
                continue
            path.write_text(json.dumps(data))
            with pytest.raises(TaskspecError, match=r"E71[34]"):
                exact.Scores.load(path, task)
    for place in (tmp_path / "none.json", tmp_path, "a\0"):
        with pytest.raises(SpecError, match=r"E71[013]"):
            exact.Scores.load(place, task)


def taken(name: str, value: object) -> bool:
    """Whether this is a value that the part may have; what is left out has its default."""
    if value is ...:
        return name in ("error", "bound", "episodes", "measures")
    may = {
        "parameters": [{}],
        "measures": [{}],
        "why_not_exact": ["x", None],
        "value": [-0.5],
        "error": [-0.5],
        "bound": [-0.5],
    }
    return value in may.get(name, [None] if name not in ("id", "content_hash", "episodes") else [])


def test_an_expert_no_better_than_random_has_no_score() -> None:
    assert math.isnan(exact.normalised(1.0, 2.0, 2.0))


# -- policies -------------------------------------------------------------------------------------


def test_a_table_a_function_and_returns_are_scored() -> None:
    task = shipped("risky_path")
    assert exact.score(task, np.zeros(4, np.int64)).normalised == 1
    assert exact.score(task, np.full((4, 2), 0.5)).normalised == pytest.approx(0)
    assert exact.score(task, np.full((5, 4, 2), 0.5)).normalised == pytest.approx(0)
    assert exact.score(task, lambda state, t: {"a": 0 * state["s"]}).value == Return(4.0)
    found = exact.score(task, returns=[4.0, 4.0, -300.0])
    assert found.value.episodes == 3
    assert found.asked == "returns"
    assert exact.score(task, np.ma.masked_array(np.full((4, 2), 0.5, np.float32))).normalised == pytest.approx(0)
    for wrong, message in (
        (np.full((4, 2), 0.4), "sum to 1"),
        (np.full((4, 2), np.nan), "no finite number"),
        (np.full(4, 7), "not in 0 to 1"),
        (np.full(4, -1), "not in 0 to 1"),
        (np.full((4, 3), 1 / 3), r"\(4, 2\) for their .* not \(4, 3\)"),
        (np.full((2, 4), 0.5), "actions are the last axis"),
        (np.full((5, 2, 4), 0.5), "actions are the last axis"),
    ):
        with pytest.raises(SpecError, match=f"(?s)E713.*{message}"):
            exact.score(task, wrong)
    with pytest.raises(SpecError, match="E706"):
        exact.score(task, lambda state, t: {"a": state["s"]})
    for function, message in (
        (lambda observation: 1, "takes the states and the time"),
        (lambda state, t: 1, "gives the action by component, a"),
        (lambda state, t: {"b": 1}, "gives the action by component, a"),
    ):
        with pytest.raises(SpecError, match=f"E713 .*{message}"):
            exact.score(task, function)


class Predicts:
    """What a model of Stable-Baselines3 looks like from outside."""

    def __init__(self, function: Any) -> None:
        self.function = function

    def predict(self, observation: Any, deterministic: bool = False) -> tuple[Any, None]:
        return self.function(observation), None


def test_an_object_with_predict_is_asked_about_observations() -> None:
    safe = Predicts(lambda o: np.zeros(len(o), int))
    assert exact.score(shipped("risky_path"), safe, deterministic=True).value == Return(4.0)
    seen: list[Any] = []

    def grid(o: Any) -> Any:
        seen.append(o.shape)
        x = o[:, 0]
        y = o[:, 1]
        return np.select([x < 2, y > 2, x > 2, y < 2], [3, 0, 2, 1], 4)

    found = exact.score(shipped("noisy_obs"), Predicts(grid), episodes=50)
    assert seen[0] == (50, 22)
    assert found.value.value == 12
    assert found.value.episodes == 50


EXPERTS = [
    ("risky_path", None), ("branching", None), ("noisy_obs", None), ("parabola", None), ("largest_sum", None),
    ("proc_goal", None), ("sort", None), ("early_term", "EarlyTermNeg"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "variant"), EXPERTS)
def test_experts_as_policy_objects_walk_through_the_environment(name: str, variant: str | None) -> None:
    task = shipped(name, variant)
    expert = exact.Expert(task)
    env = taskspec.make(task)
    returns = []
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        state = None
        start = np.array([True])
        total = 0.0
        over = False
        while not over:
            action, state = expert.predict(observation, state, start, deterministic=True)
            observation, reward, terminated, truncated, _ = env.step(action)
            total = total + float(reward)
            start = np.array([False])
            over = terminated or truncated
        returns.append(total)
    best = Results(task).optimal
    if best is not None and name != "sort":
        assert returns == [pytest.approx(best.value)] * 5
    assert expert.gap in (None, pytest.approx(0))


def test_planned_experts_count_their_steps() -> None:
    task = build(source.read_file(spec_file("frozen_lake")), None, {"slippery": False})
    expert = exact.Expert(task)
    env = taskspec.make(task)
    observation, _ = env.reset(seed=0)
    state = None
    total = 0.0
    over = False
    while not over:
        action, state = expert.predict(observation, state)
        observation, reward, terminated, truncated, _ = env.step(action)
        total = total + float(reward)
        over = terminated or truncated
    assert total == 1
    batch, counts = expert.predict(np.array([0, 4, 8]), (np.array([0, 1, 2]),), np.array([False, True, False]))
    assert batch.shape == (3,)
    assert counts[0].tolist() == [1, 1, 3]


def test_simulation_walks_the_trajectories_of_the_environment() -> None:
    """Lane i of a rollout is the environment of seed + i, to the bit of its start and the digits of its rewards."""
    from taskspec.exact.rollout.rollout import Rollout

    for task in (shipped("noisy_obs"), shipped("proc_goal"), shipped("sort"), shipped("risky_path")):
        rollout = Rollout(task, 4, seed=11)
        env = taskspec.make(task)
        rng = np.random.default_rng(0)

        actions = at_random(task)
        state = rollout.start()
        rewards = []
        chosen = []
        for t in range(3):
            action = actions(state, t, rng)
            moved = rollout.step(state, action, t)
            chosen.append(action)
            rewards.append(moved.reward)
            state = moved.state
        for lane in range(4):
            env.reset(seed=11 + lane)
            for action, reward in zip(chosen, rewards, strict=True):
                packed = [np.asarray(action[c.name])[..., lane] for c in task.action]
                value = packed[0].item() if len(packed) == 1 else np.array(packed)
                assert env.step(value)[1] == pytest.approx(reward[lane], abs=1e-12)


# -- reports --------------------------------------------------------------------------------------


def test_a_report_says_everything() -> None:
    found = exact.check(shipped("branching"))
    assert found.diagnostics == ()
    assert found.method.exact
    assert len(found.coverage.cases) == 4
    assert set(statuses(found.verdicts)) == {"proved"}
    coverage = found.coverage
    assert (coverage.untried, coverage.untried_cases, coverage.untried_claims) == ((), 0, 0)


# -- compiled sweeps and the benchmark ------------------------------------------------------------
