"""Constants drawn per instance: lanes of several instances, and the values in Python, on pages and in figures."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import SpecError, load
from tests.conftest import needs_vectors

SHUFFLED = """\
taskspec: 1
name: Shuffled
parameters:
  N: {type: int, default: 4, low: 2, high: 50}
  instance_seed: {type: int, default: 0, low: 0}
constants:
  meaning: Permutation(N)
  odds: "Uniform(0, 1, shape=2)"
  half: N // 2
  walls: "Bernoulli(1/3, shape=(3, 4))"
state:
  s: {type: int, low: 0, high: 9}
action:
  a: {type: int, low: 0, high: N - 1}
horizon: 6
initial:
  s: UniformInt(0, 3)
dynamics:
  s': min(s + (meaning[a] == 0) * Bernoulli(3/4), 9)
reward: s' * odds[0] + walls[0, 0]
terminal: s' == 5
figure: {kind: grid, at: "(s % 4, s // 4)", map: walls}
"""
SEEDS = [3, 0, 3, 7, 1]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    found = tmp_path / "shuffled.yaml"
    found.write_text(SHUFFLED)
    return found


@needs_vectors()
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_every_lane_is_the_scalar_environment_of_its_instance(path: Path, mode: Any) -> None:
    lanes = taskspec.make_vec(path, instance_seed=SEEDS, autoreset_mode=mode)
    alone = [taskspec.make(path, instance_seed=seed) for seed in SEEDS]
    assert lanes.num_envs == 5
    observed = lanes.reset(seed=40)[0]
    np.testing.assert_array_equal(observed, [env.reset(seed=40 + i)[0] for i, env in enumerate(alone)])
    rng = np.random.default_rng(0)
    over = [False] * 5
    ends = 0
    for _ in range(25):
        actions = rng.integers(0, 4, 5)
        observed, rewards, terminated, truncated, infos = lanes.step(actions)
        for i, env in enumerate(alone):
            if over[i]:
                assert (observed[i], rewards[i]) == (env.reset()[0], 0)
                over[i] = False
                continue
            seen, reward, ended, cut, _ = env.step(actions[i])
            assert (rewards[i], terminated[i], truncated[i]) == (np.float64(reward), ended, cut)
            if (ended or cut) and mode == "SameStep":
                assert infos["_final_obs"][i] and infos["final_obs"][i] == seen
                seen = env.reset()[0]
            elif ended or cut:
                over[i] = True
            ends += ended or cut
            assert observed[i] == seen
    assert ends > 5
    for state, env in zip(lanes.get_attr("state"), alone, strict=True):
        assert dict(state) == env.state


@needs_vectors()
def test_instances_are_taken_in_turn_and_told(path: Path) -> None:
    lanes = taskspec.make_vec(path, instance_seed=[4, 9], num_envs=5)
    assert [task.values["instance_seed"] for task in lanes.get_attr("task")] == [4, 9, 4, 9, 4]
    assert lanes.observation_space.shape == (5,)
    lanes.reset(seed=[1, 2, 3, 4, 5])
    lanes.step(lanes.action_space.sample())
    assert lanes.get_attr("time") == (1, 1, 1, 1, 1)
    assert taskspec.make_vec(path, instance_seed=2, num_envs=3, backend="numpy").task.values["instance_seed"] == 2


@needs_vectors()
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"instance_seed": []}, "0 instances for 0 lanes"),
        ({"instance_seed": [1, 2, 3], "num_envs": 2}, "3 instances for 2 lanes"),
        ({"instance_seed": [1, -1]}, "instance_seed"),
        ({"instance_seed": [1, "x"]}, "instance_seed"),
    ],
)
def test_what_cannot_be_is_said(path: Path, options: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError, match=words):
        taskspec.make_vec(path, **options)


@needs_vectors()
def test_instances_have_one_space(tmp_path: Path) -> None:
    path = tmp_path / "wide.yaml"
    path.write_text(
        SHUFFLED.replace("N: {", "unused: {")
        .replace("(N)", "(4)")
        .replace("N // 2", "UniformInt(2, 9)")
        .replace("N - 1", "half")
    )
    with pytest.raises(SpecError, match=r"E713.*different spaces"):
        taskspec.make_vec(path, instance_seed=[0, 1, 2, 3, 4])


def test_constants_are_read_from_python(path: Path) -> None:
    task = load(path, instance_seed=3)
    assert sorted(task.constants) == ["half", "meaning", "odds", "walls"]
    assert task.constants["half"] == 2
    assert sorted(task.constants["meaning"].tolist()) == [0, 1, 2, 3]
    assert task.constants["walls"].shape == (3, 4) and task.constants["walls"].dtype == bool
    env = taskspec.make(task)
    goes_on = set()
    for seed, a in product(range(20), range(4)):
        env.reset(seed=seed, options={"state": {"s": 1}})
        if env.step(a)[0] == 2:
            goes_on.add(a)
    assert goes_on == {int(np.argmin(task.constants["meaning"]))}
    with pytest.raises(ValueError, match="read-only"):
        task.constants["meaning"][0] = 1
