"""What comes of whole trainings: learners of nets learn, and a task is found that tells a wrong learner from a right one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from taskspec import load
from taskspec.exact import score
from taskspec.exact.model.extract import extract
from taskspec.learn.learners import learner
from tests.shared.cases import Granted
from tests.shared.commands import Done
from tests.shared.sparse import sparse
from tests.tools.separation.test_separate import FAMILY, LEARNERS


@pytest.mark.parametrize(
    ("name", "task"), sparse([("grpo", "RiskyPath"), ("rloo", "RiskyPath"), ("dpo", "EarlyTermNeg")], 3)
)
def test_they_learn(name: str, task: str) -> None:
    granted = Granted(task, 60_000, seeds=1)
    for policy in learner(name)(granted):
        assert score(granted.task, policy).normalised > 0.9
    assert granted.counted > 50_000 and len(granted.curve) >= 9
    assert (granted.compared > 0) == (name == "dpo")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "q.py").write_text(LEARNERS)
    (tmp_path / "few.yaml").write_text(FAMILY.replace("SEEDS", "4"))
    return tmp_path


COMMAND = ("separate", "q.py:past_the_end", "q.py:right", "--in", "few.yaml", "--steps", "1000", "-j", "2")


@pytest.mark.usefixtures("warm")
def test_a_bootstrap_past_the_end_is_separated_by_a_task_of_two_states_at_most(folder: Path) -> None:
    done = Done(*COMMAND, "-o", "found.yaml", columns=80)
    assert done.status == 0
    assert done.out.startswith("q.py:past_the_end is worse than q.py:right: ")
    assert max(map(len, done.out.splitlines())) <= 80
    assert len(extract(load("found.yaml")).codes) <= 2
    assert "Exact permutation test" in " ".join((folder / "found.yaml").read_text().split())
    assert Done("check", "found.yaml").status == 0


@pytest.mark.slow
def test_the_same_seed_finds_the_same_task(folder: Path) -> None:
    first = Done(*COMMAND, "--json").data
    assert first == Done(*COMMAND, "--json").data
    assert first["p_value"] <= 0.01
    assert np.mean(first["scores"][1]) - np.mean(first["scores"][0]) >= 0.3
