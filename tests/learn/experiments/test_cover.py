"""The smallest set of tasks that separates each mistake of a zoo from its right version."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from taskspec import load
from taskspec.base.jobs.store import Store
from taskspec.learn.experiments.cover import smallest_cover
from tests.shared.commands import Done

ZOO = """
zoo: 1
learners:
  - right: learners.py:right
    mistakes: [learners.py:past_the_end, learners.py:least, learners.py:clipped, learners.py:immediate]
  - right: learners.py:also_right
    mistakes: [learners.py:same_state]
"""
LEARNERS = """
import numpy as np
from taskspec.exam import learns_from

def learn(case, mistake):
    env, rng = case.env(), np.random.default_rng(case.seed)
    q = np.zeros((int(case.observation_space.n), int(case.action_space.n)))
    obs, _ = env.reset()
    for _ in range(case.steps):
        action = int(q[obs].argmax()) if rng.random() > 0.3 else int(rng.integers(len(q[obs])))
        after, reward, terminated, truncated, _ = env.step(action)
        later = {"least": q[after].min(), "immediate": 0.0, "same_state": q[obs].max()}.get(mistake, q[after].max())
        if terminated and mistake != "past_the_end":
            later = 0.0
        if mistake == "clipped":
            reward = np.clip(reward, -1, 1)
        q[obs, action] += 0.2 * (reward + 0.95 * later - q[obs, action])
        obs = env.reset()[0] if terminated or truncated else after
    return q

def made(mistake):
    return learns_from("reward")(lambda case: learn(case, mistake))

right, also_right = made(""), made("none")
past_the_end, least, clipped, immediate, same_state = map(
    made, ("past_the_end", "least", "clipped", "immediate", "same_state")
)
"""
FAMILY = """
experiment: 1
name: some
tasks:
  - task: probes/Aim
  - task: probes/EndInPlace
  - task: probes/SecondThought
  - task: probes/Sizes
  - task: probes/Slip
"""
COMMAND = ("separate", "--cover", "zoo.yaml", "--in", "some.yaml", "--steps", "1000", "-j", "2", "-o", "cover")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "learners.py").write_text(LEARNERS)
    (tmp_path / "zoo.yaml").write_text(ZOO)
    (tmp_path / "some.yaml").write_text(FAMILY)
    return tmp_path


@pytest.mark.slow
def test_every_mistake_is_separated_by_the_fewest_tasks_also_after_kill(folder: Path) -> None:
    """Of these tasks a bootstrap past the end fails on EndInPlace alone, and clipped rewards on Sizes (see probes.md)."""
    process = subprocess.Popen([sys.executable, "-m", "taskspec", *COMMAND], start_new_session=True, env={**os.environ})
    stored = folder / "cover/races.sqlite"
    while process.poll() is None:
        time.sleep(0.2)
        if stored.exists() and count(stored) > 5:
            process.send_signal(signal.SIGKILL)
            process.wait()
    before = count(stored)
    assert before > 5
    found = Done(*COMMAND, "--json").data
    assert found["missing"] == []
    assert found["is_complete"]
    separated = {each["task"].split("-v")[0]: set(each["separates"]) for each in found["tasks"]}
    assert len(separated) == 3
    assert "learners.py:past_the_end" in separated["probes/EndInPlace"]
    assert "learners.py:clipped" in separated["probes/Sizes"]
    for each in found["tasks"]:
        for name in each["separates"]:
            right = "also_right" if "same_state" in name else "right"
            assert np.mean(each["scores"][f"learners.py:{right}"]) > np.mean(each["scores"][name]) + 0.3
    after = count(stored)
    assert after > before
    printed = Done(*COMMAND, columns=80)
    assert count(stored) == after
    assert printed.status == 0
    assert "✗ worse than the right version on fresh seeds; 5 tasks of some.yaml tried" in printed.out
    for number in (1, 2, 3):
        assert load(str(folder / f"cover/task_{number}.yaml")).name == f"Task{number}"
        assert Done("check", f"cover/task_{number}.yaml").status == 0


def count(stored: Path) -> int:
    with Store(stored) as store:
        return len(store.results())


def test_a_right_version_in_place_of_a_mistake_is_not_separated(folder: Path) -> None:
    (folder / "zoo.yaml").write_text(
        "zoo: 1\nlearners: [{right: learners.py:right, mistakes: [learners.py:also_right]}]"
    )
    assert Done(*COMMAND).out == "No mistake is separated by 5 tasks of some.yaml.\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("zoo: 1\nlearners: []", "zoo.yaml:2:"),
        ("zoo: 1\nlearners: [{right: learners.py:right, mistakes: [none.py:x]}]", "E710"),
        ("zoo: 1\nlearners: [{right: learners.py:right, mistakes: [bc, bc]}]", "E713"),
        ("- learners.py:right", "E201"),
    ],
)
def test_mistakes_in_a_zoo_are_reported_at_their_places(text: str, message: str, folder: Path) -> None:
    (folder / "zoo.yaml").write_text(text)
    done = Done(*COMMAND)
    assert done.status == 1
    assert message in done.err
    assert "zoo.yaml:" in done.err


def test_a_learner_that_always_fails_is_named(folder: Path) -> None:
    (folder / "learners.py").write_text(LEARNERS.replace("later = {", "later = 1 / 0 * {"))
    done = Done(*COMMAND)
    assert done.status == 1
    assert "learners.py:right fails on all of the first tasks: " in done.err


def test_a_learner_and_a_zoo_are_not_given_together(folder: Path) -> None:
    assert Done(*COMMAND, "learners.py:right").status == 2
    assert Done("separate").status == 2


def test_a_cover_is_the_smallest_of_all() -> None:
    """Compared with all combinations, on random sets."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        sets = [frozenset(f"m{j}" for j in np.flatnonzero(row)) for row in rng.random((9, 8)) < 0.35]
        everything = frozenset[str]().union(*sets)
        found = smallest_cover(sets)
        assert frozenset[str]().union(*(sets[i] for i in found)) == everything
        fewer = itertools.combinations(sets, max(0, len(found) - 1))
        assert not found or not any(frozenset[str]().union(*some) == everything for some in fewer)
