"""Training runs of an exam, in other processes: each begins anew, is kept as long as it counts, and fails alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from taskspec.base import limits
from taskspec.base.limits import progress_listener
from taskspec.exam import Running, examine
from taskspec.learn.exam.plan import PRINTED
from tests.learn.learners import counting
from tests.shared.commands import Done
from tests.shared.exams import column, flags

warm = pytest.mark.usefixtures("warm")

LEARNERS = Path(counting.__file__)


def held(tmp_path: Path, learner: str, *options: str) -> tuple[int, Any]:
    done = Done("exam", learner, "--out", tmp_path, "--json", *options)
    assert done.status in (0, 1), done.err
    return done.status, json.loads(done.out)


FORGETFUL = """
import numpy as np

from notes import seen

STARTED = []


def train(case):
    '''Masters the task in the second of the runs that share its module, or what it imports.'''
    STARTED.append(case.seed)
    seen.SEEDS.append(case.seed)
    case.count(len(STARTED) + len(seen.SEEDS))
    table = np.zeros((case.observation_space.n, case.action_space.n))
    table[:, 0] = len(STARTED) > 1 or len(seen.SEEDS) > 1
    return table
"""


@pytest.mark.parametrize(("form", "jobs"), [("{folder}/keeping.py:train", 2), ("keeping:train", 1)])
def test_what_a_run_leaves_in_modules_does_not_reach_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str, jobs: int
) -> None:
    (tmp_path / "keeping.py").write_text(FORGETFUL, encoding="utf-8")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "seen.py").write_text("SEEDS = []\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])
    options = ("-t", "EarlyTermPos", "--seeds", "4", "--twins", "0", "--no-peeks", "-j", str(jobs))
    _, found = held(tmp_path / "out", form.format(folder=tmp_path), *options)
    for module in ("keeping", "notes", "notes.seen"):
        sys.modules.pop(module, None)
    assert len(found["scores"]) == 4
    for score in found["scores"]:
        assert (score["error"], score["steps"], score["deterministic"]) == (None, 2, pytest.approx(0))


@warm
def test_settings_of_a_learner_in_a_file_mean_the_same_from_the_folder_that_it_is_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.yaml").write_text("learner: mce\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    options = ("-t", "EarlyTermPos", "--seeds", "1", "--twins", "0", "--no-peeks", "-j", "1")
    _, found = held(tmp_path / "out", "mine.yaml", *options)
    (score,) = found["scores"]
    assert (score["error"], score["deterministic"]) == (None, pytest.approx(1))


TASK = """
taskspec: 1
name: Tiny
parameters: {n: {type: int, default: 2, low: 1, high: 5}}
state: {s: {type: int, low: 0, high: 5}}
action: {a: {type: choice, values: [stay, go]}}
horizon: 3
terminal: false
initial: {s: 0}
dynamics: {"s'": "min(n, s + 1) if a == go else s"}
reward: "1 if s == n else 0"
"""
LEARNER = """
import numpy as np
import helper


def train(case):
    return np.zeros((case.observation_space.n, case.action_space.n))


other = train
"""


class Asked(Exception):
    """All that is wanted of a run is how many results it has already."""


def anew(folder: Path, **terms: Any) -> int:
    """How many of an exam's training runs are done anew."""
    told: list[str] = []

    def stop(what: str, share: float | None) -> None:
        if share is not None and "baselines" not in what:
            told.append(what)
            raise Asked

    wanted = {"learner": f"{folder}/mine.py:train", "tasks": [f"{folder}/tiny.yaml"], "seeds": (0, 1)} | terms
    learner = wanted.pop("learner")
    with pytest.raises(Asked), progress_listener(stop):
        examine(learner, **FIXED | wanted, out=folder / "out", running=Running(workers=1))  # type: ignore[arg-type]
    over, total = told[0].rpartition(" ")[2].split("/")
    return int(total) - int(over)


FIXED: dict[str, Any] = {"steps": 9, "transitions": 9, "twins": 0, "peeks": False}


@pytest.fixture(scope="module")
def exam(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an exam that is done."""
    folder = tmp_path_factory.mktemp("exam")
    for name, text in {"tiny.yaml": TASK, "mine.py": LEARNER, "helper.py": "rate = 1\n", "beside.py": ""}.items():
        (folder / name).write_text(text, encoding="utf-8")
    found = examine(
        f"{folder}/mine.py:train", tasks=[f"{folder}/tiny.yaml"], seeds=(0, 1), out=folder / "out",
        running=Running(workers=1), **FIXED,
    )  # fmt: skip
    assert column(found["scores"], "error") == [None, None]
    return folder


@warm
@pytest.mark.parametrize(
    ("terms", "count"),
    [
        ({}, 0), ({"seeds": (1, 0)}, 0), ({"seeds": (1, 2)}, 1), ({"steps": 10}, 2), ({"transitions": 10}, 2),
        ({"learns_from": ["reward"]}, 2), ({"tasks": ["{folder}/tiny.yaml?n=3"]}, 2),
        ({"tasks": ["{folder}/tiny.yaml+sticky=0.5"]}, 2), ({"learner": "{folder}/mine.py:other"}, 2),
        ({"peeks": True}, 2), ({"twins": 1}, 2),
    ],
    ids=str,
)  # fmt: skip
def test_results_of_an_exam_with_other_terms_are_not_reused(exam: Path, terms: dict[str, Any], count: int) -> None:
    placed = json.loads(json.dumps(terms).replace("{folder}", str(exam)))
    assert anew(exam, **placed) == count


@warm
@pytest.mark.parametrize(
    ("name", "count"), [("tiny.yaml", 2), ("mine.py", 2), ("helper.py", 2), ("beside.py", 0)], ids=str
)
def test_results_of_other_files_are_not_reused(exam: Path, name: str, count: int) -> None:
    file = exam / name
    before = file.read_text(encoding="utf-8")
    change = "discount: 0.9\n" if name == "tiny.yaml" else "changed = True\n"
    file.write_text(before + change, encoding="utf-8")
    try:
        assert anew(exam) == count
    finally:
        file.write_text(before, encoding="utf-8")
        sys.modules.pop("helper", None)
    assert anew(exam) == 0


@warm
def test_results_of_other_versions_limits_and_episodes_are_not_reused(
    exam: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with limits.also("transitions=1e6"):
        assert anew(exam) == 2
    with monkeypatch.context() as changed:
        changed.setattr("taskspec.learn.exam.trial.__version__", "0.0.0")
        assert anew(exam) == 2
    with monkeypatch.context() as changed:
        changed.setattr("taskspec.learn.exam.plan.EPISODES", 7)
        assert anew(exam) == 2


TALKING = """
import numpy as np
from taskspec.exam import learns_from


@learns_from("reward")
def train(case):
    print("this is seed", case.seed)
    return np.zeros((case.observation_space.n, case.action_space.n))
"""


@warm
def test_an_exam_says_how_long_it_takes_and_keeps_what_is_printed(tmp_path: Path) -> None:
    (tmp_path / "talking.py").write_text(TALKING, encoding="utf-8")
    announced: list[str] = []
    found = examine(
        f"{tmp_path}/talking.py:train", tasks=["Aim", "Hazard"], seeds=2, out=tmp_path / "out",
        running=Running(workers=1), announce=announced.append, **FIXED,
    )  # fmt: skip
    assert len(announced) == 1 and announced[0].startswith("4 trials of at most 9 steps, 1 at a time: about ")
    printed = (tmp_path / "out" / PRINTED).read_text(encoding="utf-8")
    assert printed.count("this is seed 0") == printed.count("this is seed 1") == 2
    assert "-- probes/Hazard-v0, seed 1\nthis is seed 1\n" in printed
    assert found["tasks"]["probes/Aim-v0"]["cannot"] == "its action space is a Box, which has no `n`"
    assert column(found["scores"], "task") == ["probes/Hazard-v0"] * 2
    assert found["flags"] == []


@pytest.mark.skipif(os.name != "posix", reason="it forks")
def test_a_run_that_forks_gives_one_answer(tmp_path: Path) -> None:
    running = Running(workers=1, seconds=60.0)
    learner = f"{LEARNERS}:ends_badly"
    terms = FIXED | {"tasks": ["RiskyPath"], "learns_from": ["reward"], "seeds": [3, 6, 7]}
    found = examine(learner, **terms, out=tmp_path, running=running)
    assert column(found["scores"], "error") == [None] * 3
    assert column(found["scores"], "steps") == [3, 6, 7]


@pytest.mark.skipif(os.name != "posix", reason="processes are killed by signals")
def test_runs_that_end_badly_cost_one_seed_each(tmp_path: Path) -> None:
    options = ("-t", "RiskyPath", "--seeds", "4", "--twins", "0", "--no-peeks", "--time-limit", "2", "-j", "1")
    status, found = held(tmp_path, f"{LEARNERS}:ends_badly", *options, "--learns-from", "reward")
    errors = column(found["scores"], "error")
    assert status == 1 and errors[0] is errors[3] is None
    assert column(found["scores"], "steps") == [0, 0, 0, 3]
    for seed, words in ((1, "died: EXIT(3)"), (2, "longer than 2 s")):
        assert words in errors[seed]


@pytest.mark.slow
def test_an_exam_that_was_killed_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notes = tmp_path / "notes"
    monkeypatch.setenv("NOTES", str(notes))
    options = ("-t", "RiskyPath", "--seeds", "6", "--twins", "0", "--learns-from", "reward")
    command = ["exam", f"{LEARNERS}:takes_notes", "--out", str(tmp_path), "-j", "1", *options]
    first = subprocess.Popen([sys.executable, "-m", "taskspec", *command])
    wait_until(lambda: notes.exists() and len(notes.read_text().split()) >= 3)
    first.kill()
    first.wait()
    before = notes.read_text().split()
    _, found = held(tmp_path, f"{LEARNERS}:takes_notes", "-j", "2", *options)
    assert column(found["scores"], "error") == [None] * 6
    after = notes.read_text().split()[len(before) :]
    assert {*before, *after} == set("012345") and not set(before[:-2]) & set(after)


def wait_until(holds: Callable[[], bool]) -> None:
    for _ in range(600):
        if holds():
            return
        time.sleep(0.2)
    raise AssertionError("it never came true")


@pytest.mark.parametrize("options", [("--seeds", "5", "--steps", "100"), ("--within", "60s")])
def test_an_exam_ends_after_one_run_of_each_task_where_all_of_them_fail(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    (tmp_path / "wrong.py").write_text("def train(case):\n    raise RuntimeError('a bug')\n")
    status, found = held(tmp_path / "out", f"{tmp_path}/wrong.py:train", "--tasks", "RiskyPath,Slip", *options)
    assert status == 1
    assert column(found["scores"], "seed") == [0, 0]
    assert column(found["scores"], "twin") == [None, None]
    for flag in flags(found, "failed"):
        assert "a bug" in flag["message"]
