"""Demonstrations are episodes of the environment, the same whatever records them, and files hold what was recorded."""

from __future__ import annotations

import importlib.util
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.data import Demonstrations, demonstrations, preferences, read, write
from taskspec.exact import Expert, Results
from taskspec.exact.scores.returns import Return
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.exact.policies.test_memory import DRAWN, SEEN, TURNS, episode, listening
from tests.exact.solve.test_legal import CHOICES, GAMMA, is_legal, ring, value
from tests.shared.sections import build_text
from tests.shared.specs import spec_file

TASKS = [
    "RiskyPath",
    "NoisyObs",
    "Sort",
    "Parabola",
    "EarlyTermNeg",
    spec_file("key_door"),
    spec_file("permuted_actions"),
]


def same(a: Any, b: Any) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[name], b[name]) for name in a)
    return bool(np.array_equal(a, b)) and np.asarray(a).dtype == np.asarray(b).dtype


def is_seen(recorded: Any, i: int, seen: Any) -> bool:
    """Whether the environment shows what is recorded at a place."""
    if isinstance(recorded, dict):
        return same({name: part[i] for name, part in recorded.items()}, seen)
    return bool(np.all(recorded[i] == seen))


@pytest.mark.parametrize("task", TASKS, ids=lambda task: Path(task).stem)
def test_episodes_are_those_of_the_environment(task: Any) -> None:
    data = demonstrations(task, "random", episodes=7, seed=40)
    env = taskspec.make(task)
    assert len(data.trajectories) == 7 and len(data) == sum(map(len, data.trajectories))
    for i, found in enumerate(data.trajectories):
        seen, _ = env.reset(seed=40 + i)
        assert is_seen(found.obs, 0, seen)
        terminated = truncated = False
        for t in range(len(found)):
            assert not (terminated or truncated)
            seen, reward, terminated, truncated, _ = env.step(found.acts[t])
            assert reward == found.rews[t]
            assert env.observation_space.contains(seen)
            assert is_seen(found.obs, t + 1, seen)
        assert (terminated, truncated) == (found.terminated, found.truncated) != (False, False)


@pytest.mark.parametrize("policy", ["optimal", "soft(0.5)", "epsilon(0.3)", "random"])
def test_policies_earn_what_the_exact_model_says(policy: str) -> None:
    data = demonstrations("RiskyPath", policy, episodes=4000, seed=1)
    returns = data.returns()
    error = returns.std() / len(returns) ** 0.5
    assert abs(returns.mean() - data.metadata["return"]["value"]) <= 4 * error
    assert data.metadata["return"]["status"] == "exact"


def test_epsilon_lies_between_the_expert_and_random() -> None:
    expert = demonstrations("Sort", "expert", episodes=300)
    sure = demonstrations("Sort", "epsilon(0)", episodes=300)
    never = demonstrations("Sort", "epsilon(1)", episodes=300)
    half = demonstrations("Sort", "epsilon(0.5)", episodes=300)
    assert same(expert.acts, sure.acts)
    counts = np.unique(never.acts, axis=0, return_counts=True)[1]
    assert len(counts) == 16 and np.abs(counts / len(never) - 1 / 16).max() < 0.03
    obeys = (half.acts == list(map(task_expert, half.obs))).all(axis=1)
    assert abs(np.mean(obeys) - (0.5 + 0.5 / 16)) < 0.05


def task_expert(numbers: Any) -> tuple[int, int]:
    """Selection sort, written anew."""
    wrong = np.flatnonzero(numbers != np.sort(numbers))
    first = int(wrong[0]) if len(wrong) else 0
    return first, int(np.argsort(numbers, kind="stable")[first])


def test_demonstrations_come_from_the_experts_start_and_comparisons_from_the_learners() -> None:
    shown = demonstrations("InitShiftLearner", episodes=3)
    compared = preferences("InitShiftExpert", 3)
    assert shown.metadata["id"] == "derail/InitShiftExpert-v0" and set(shown.obs[shown.starts]) == {0}
    assert compared.metadata["id"] == "derail/InitShiftLearner-v0"
    assert set(compared.segments.obs[compared.segments.starts]) == {1}


COUNTING = """
taskspec: 1
name: Counting
state: {s: {type: int}}
action: {a: {type: bool}}
horizon: none
initial: {s: 0}
dynamics: {s': s + 1}
reward: 1
terminal: s' == LAST
"""


def counting(last: int) -> Task:
    return build(read_text(COUNTING.replace("LAST", str(last))))


def test_episodes_without_a_horizon_are_recorded_up_to_twenty_thousand_steps() -> None:
    with pytest.raises(SpecError, match="still running after 20,000 steps"):
        demonstrations(counting(20_001), "random", episodes=1)


def test_returns_of_episodes_without_a_horizon_are_estimated_up_to_two_thousand_steps() -> None:
    """Later than that some have to have ended, if all are to end within twenty thousand."""
    longer = counting(2_001)
    assert Results(counting(2_000), episodes=2).sample("random") == Return(2000, 0, 2)
    assert Results(longer, episodes=2).sample("random") is None
    assert Results(taskspec.modify(longer, "horizon=2001"), episodes=2).sample("random") == Return(2001, 0, 2)


def test_functions_of_files_see_what_the_environment_shows(tmp_path: Path) -> None:
    text = "def act(observation, rng):\n    assert isinstance(observation, int)\n    return (observation + rng.integers(2)) % 2\n"
    (tmp_path / "m.py").write_text(text)
    data = demonstrations("RiskyPath", f"{tmp_path}/m.py:act", episodes=300, seed=5)
    again = demonstrations("RiskyPath", f"{tmp_path}/m.py:act", episodes=20, seed=105)
    late = data.episode >= 100
    assert same(data.acts[late & (data.episode < 120)], again.acts) and 0.4 < data.acts.mean() < 0.6


DATACLASS = """
from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Always:
    action: int

    def predict(self, observations):
        return [self.action] * len(observations)


act = Always(1)
"""


def test_files_may_define_dataclasses(tmp_path: Path) -> None:
    (tmp_path / "m.py").write_text(DATACLASS)
    assert demonstrations("RiskyPath", f"{tmp_path}/m.py:act", episodes=3).acts.all()


def test_objects_with_predict_are_asked_for_their_most_likely_actions() -> None:
    class Steps:
        def predict(self, seen: Any, state: Any = None, deterministic: bool = False) -> tuple[Any, Any]:
            count = np.zeros(len(seen), np.int64) if state is None else state + 1
            assert deterministic
            return count % 2, count

    data = demonstrations("RiskyPath", Steps(), episodes=3)
    assert data.acts.tolist() == [0, 1, 0, 1, 0] * 3


def test_what_cannot_be_sent_to_other_processes_is_refused() -> None:
    with pytest.raises(taskspec.SpecError, match="other processes") as caught:
        demonstrations("RiskyPath", lambda seen: 0, episodes=3, jobs=2)
    assert caught.value.diagnostics[0].code == "E713"


def test_as_many_whole_episodes_as_make_enough_transitions() -> None:
    data = demonstrations("EarlyTermNeg", "random", transitions=40, seed=9)
    more = demonstrations("EarlyTermNeg", "random", transitions=400, seed=9)
    assert len(data) >= 40 > len(data) - int(data.lengths[-1])
    assert same(data.rews, more.rews[: len(data)]) and data.dones[-1]


SUFFIXES = [".npz", *([".parquet"] if importlib.util.find_spec("pyarrow") else [])]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("task", TASKS, ids=lambda task: Path(task).stem)
def test_what_is_read_is_what_was_written(task: Any, suffix: str, tmp_path: Path) -> None:
    data = demonstrations(task, "random", episodes=4)
    write(data, tmp_path / f"x{suffix}")
    found = read(tmp_path / f"x{suffix}")
    assert isinstance(found, Demonstrations) and found.metadata == json.loads(json.dumps(data.metadata))
    for name in ("obs", "acts", "rews", "next_obs", "terminated", "truncated", "episode", "time"):
        assert same(getattr(found, name), getattr(data, name)), name


def test_files_that_hold_no_data_are_refused(tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_text("what")
    np.savez(tmp_path / "y.npz", a=np.zeros(3))
    for name, message in (("x.npz", "E711.*no npz file"), ("y.npz", "E711.*no `metadata`"), ("z.npz", "E710")):
        with pytest.raises(taskspec.SpecError, match=message):
            read(tmp_path / name)


DAMAGE: dict[str, tuple[dict[str, Any], str]] = {
    "unequal lengths": (
        {"acts": np.zeros(4, np.int64)},
        "`acts` is not an array of int64 or float32 with the shape (10,)",
    ),
    "a reward of nan": ({"rews": np.array([0, 1, np.nan, *[1] * 7])}, "`rews` cannot be nan in row 2"),
    "an endless reward": ({"rews": np.array([np.inf, *[1.0] * 9])}, "`rews` cannot be inf in row 0"),
    "rewards in single precision": ({"rews": np.ones(10, np.float32)}, "`rews` is not an array of float64"),
    "actions in double precision": ({"acts": np.ones(10)}, "`acts` is not an array of int64 or float32"),
    "ends as numbers": ({"truncated": np.zeros(10, np.int64)}, "`truncated` is not an array of bool"),
    "observations of another kind": ({"next_obs": np.zeros(10, np.float32)}, "`next_obs` is not an array of int64"),
    "observations of another shape": (
        {"next_obs": np.zeros((10, 2), np.int64)},
        "`next_obs` is not an array of int64",
    ),
    "a dict after a step": (
        {"next_obs": None, "next_obs.x": np.zeros(10, np.int64)},
        "before a step and next_obs.x after",
    ),
    "no observations": ({"obs": None}, "it has no `obs`"),
    "episodes out of order": ({"episode": np.array([1] * 5 + [0] * 5)}, "`episode` cannot be 0 in row 5"),
    "a step left out": ({"time": np.array([0, 1, 2, 4, 5] * 2)}, "`time` cannot be 4 in row 3"),
    "a late start": ({"time": np.array([0, 1, 2, 3, 4, 1, 2, 3, 4, 5])}, "`time` cannot be 1 in row 5"),
    "an early end": ({"terminated": np.arange(10) == 7}, "`dones` cannot be True in row 7"),
    "no end": ({"truncated": np.arange(10) == 4}, "`dones` cannot be False in row 9"),
    "no transitions": (
        dict.fromkeys(("obs", "acts", "rews", "next_obs", "terminated", "truncated", "episode", "time"), np.zeros(0)),
        "it has no transitions",
    ),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_arrays_that_are_no_episodes_are_refused(damage: str, tmp_path: Path) -> None:
    changes, words = DAMAGE[damage]
    write(demonstrations("RiskyPath", episodes=2), tmp_path / "x.npz")
    with np.load(tmp_path / "x.npz") as held:
        arrays = {**held, **changes}
    np.savez(tmp_path / "x.npz", **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(taskspec.SpecError, match=re.escape(words)) as caught:
        read(tmp_path / "x.npz")
    assert caught.value.diagnostics[0].code == "E711"


PAIR_DAMAGE = {
    "labels": ({"preferences": np.array([1.0, 2.0])}, "`preferences` are not all between 0 and 1"),
    "returns": ({"returns": np.ones((2, 3))}, "`returns` is not an array of float64 with the shape (2, 2)"),
    "nan": ({"returns": np.full((2, 2), np.nan)}, "`returns` not all finite"),
    "numbers": ({"queries": np.array([0.0, 1.0])}, "`queries` is not an array of int64"),
    "pairs": ({"preferences": np.ones(3)}, "does not number the segments of 3 pairs from 0 to 5"),
}


@pytest.mark.parametrize("damage", PAIR_DAMAGE)
def test_pairs_that_are_none_are_refused(damage: str, tmp_path: Path) -> None:
    changes, words = PAIR_DAMAGE[damage]
    write(preferences("RiskyPath", 2), tmp_path / "x.npz")
    with np.load(tmp_path / "x.npz") as held:
        arrays = {**held, **changes}
    np.savez(tmp_path / "x.npz", **arrays)
    with pytest.raises(taskspec.SpecError, match=re.escape(words)):
        read(tmp_path / "x.npz")


@pytest.mark.parametrize("kept", [0, 20, 800])
def test_files_that_are_cut_short_are_refused(kept: int, tmp_path: Path) -> None:
    write(demonstrations("RiskyPath", episodes=2), tmp_path / "x.npz")
    whole = (tmp_path / "x.npz").read_bytes()
    assert len(whole) > 800
    (tmp_path / "x.npz").write_bytes(whole[:kept])
    with pytest.raises(taskspec.SpecError, match="E711"):
        read(tmp_path / "x.npz")


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    from taskspec.base.files import whole_folder

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("x")
    with pytest.raises(taskspec.SpecError, match="already exists"), whole_folder(tmp_path / "mine", "mark"):
        pass
    for text in ("first", "second"):
        with whole_folder(tmp_path / "data", "mark") as folder:
            (folder / "mark").write_text(text)
    with pytest.raises(RuntimeError), whole_folder(tmp_path / "data", "mark") as folder:
        raise RuntimeError
    assert (tmp_path / "data" / "mark").read_text() == "second"
    assert sorted(tmp_path.iterdir()) == [tmp_path / "data", tmp_path / "mine"]


@pytest.mark.parametrize("observation", [SEEN, DRAWN])
def test_demonstrations_of_an_expert_that_remembers(observation: str) -> None:
    task = listening(observation, True)
    expert = Expert(task)
    env = taskspec.make(task)
    own = [episode(env, expert, seed) for seed in range(60)]
    assert demonstrations(task, episodes=60).returns().tolist() == own


def test_demonstrations_on_a_twin_of_an_expert_that_remembers() -> None:
    task = build_text(TURNS)
    for modifiers in (
        ["permuted_actions=1", "relabelled=3"],
        ["symmetry=turned"],
        ["delay=2", "hidden=w", "time_observed"],
    ):
        twin = taskspec.modify(task, *modifiers)
        assert demonstrations(twin, episodes=5).returns().tolist() == [4] * 5


def test_named_policies_are_legal_and_return_what_is_computed() -> None:
    task = ring(4, 50)
    for policy, which in (("random", "random"), ("expert", "expert"), ("optimal", "optimal"), ("epsilon(0.5)", None)):
        shown = demonstrations(task, policy, episodes=4000, seed=1)
        assert all(map(is_legal, shown.obs.tolist(), shown.acts.tolist()))
        if which is None:
            continue
        times = np.arange(len(shown)) - np.repeat(shown.starts, shown.lengths)
        weights = GAMMA**times
        returns = np.add.reduceat(weights * shown.rews, shown.starts)
        error = 5 * returns.std() / math.sqrt(len(returns))
        assert returns.mean() == pytest.approx(value(4, 50, CHOICES[which]), abs=error + 1e-9)
