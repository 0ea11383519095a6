"""Exams of experiments: every learner on every instance, and what becomes of those that are not made for a task."""

import inspect
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec.exam import examine
from taskspec.experiments import expand, read
from taskspec.language import registry
from taskspec.learn.documents.document_models import Experiment
from taskspec.learn.exam.plan import STEPS
from taskspec.learn.exam.trial import SEEDS
from taskspec.learn.learners import BUILT_IN
from tests.learn.learners import counting
from tests.shared.commands import Done, spec

pytestmark = pytest.mark.usefixtures("warm")

LEARNERS = Path(counting.__file__)
SHIPPED = sorted((registry.tasks_root() / "derail" / "experiments").glob("*.yaml"))
TEXT = f"""
experiment: 1
name: paths
tasks:
  - task: derail/Branching
    parameters: {{L: [2, 4], B: 2}}
  - task: derail/RiskyPath
learners: ["{LEARNERS}:clone", "{LEARNERS}:indifferent"]
seeds: 2
steps: 100
transitions: 60
twins: 0
peeks: false
"""


def scores(path: Path) -> dict[str, float]:
    """The mean score on each task of an exam."""
    found: dict[str, list[float]] = {}
    for score in json.loads(path.read_text(encoding="utf-8"))["scores"]:
        found.setdefault(score["task"], []).append(score["deterministic"])
    return {task: float(np.mean(values)) for task, values in found.items()}


@pytest.mark.slow
def test_every_learner_is_examined_on_every_instance(tmp_path: Path) -> None:
    done = Done("exam", spec(tmp_path, TEXT), "-o", tmp_path / "out", "-j", 1)
    assert done.status == 0, done.out + done.err
    instances = ["derail/Branching-v0?L=2", "derail/Branching-v0?L=4", "derail/RiskyPath-v0"]
    cloned = scores(tmp_path / "out" / "counting-clone" / "exam.json")
    lost = scores(tmp_path / "out" / "counting-indifferent" / "exam.json")
    assert list(cloned) == list(lost) == instances
    assert list(cloned.values()) == [1.0, 1.0, 1.0]
    assert lost["derail/Branching-v0?L=2"] == pytest.approx(0.0, abs=1e-12)
    assert re.search(r"^ +Branching, L=2 +Branching, L=4 +RiskyPath$", done.out, re.MULTILINE)
    assert re.search(r"^counting-clone( +1\.00){3}$", done.out, re.MULTILINE)
    assert re.search(r"^counting-indifferent( +0\.00){3}$", done.out, re.MULTILINE)
    assert (tmp_path / "out" / "paths.svg").read_text(encoding="utf-8").startswith("<svg")


@pytest.mark.slow
def test_options_take_the_place_of_what_the_file_says(tmp_path: Path) -> None:
    path = spec(tmp_path, TEXT)
    Done("exam", path, "-o", tmp_path / "out", "-j", 1, "--seeds", 1, "--steps", "1k", "--peeks")
    found = json.loads((tmp_path / "out" / "counting-clone" / "exam.json").read_text(encoding="utf-8"))
    assert (found["seeds"], found["steps"]) == ([0], 1000)
    assert {score["peek"] for score in found["scores"]} == {None, "negated"}
    for option in (["--suite", "derail"], ["--tasks", "Sort"], ["--against", tmp_path], ["--learns-from", "reward"]):
        done = Done("exam", path, *option)
        assert done.status == 2
        assert re.search(f"{option[0]} is for (a single learner|learners, not for an experiment)", done.err)


def test_the_instances_of_an_experiment_may_be_the_tasks_of_any_learner(tmp_path: Path) -> None:
    path = spec(tmp_path, TEXT)
    terms = ("--seeds", 1, "--steps", 100, "--transitions", 60, "--twins", 0, "--no-peeks", "-j", 1)
    done = Done("exam", f"{LEARNERS}:clone", "--tasks", path, *terms, "-o", tmp_path / "out", "--json")
    assert [score["task"] for score in done.data["scores"]] == [
        "derail/Branching-v0?L=2", "derail/Branching-v0?L=4", "derail/RiskyPath-v0",
    ]  # fmt: skip


@pytest.mark.slow
def test_three_things_may_vary_and_one_of_them_in_a_modifier(tmp_path: Path) -> None:
    """A learner that needs to tell states apart leaves the instances out in which actions stick."""
    text = TEXT.replace("B: 2}}", "B: [2, 3]}}").replace("{L: [2, 4], B: 2}", "{L: [2, 4], B: [2, 3]}")
    text = text.replace("  - task: derail/RiskyPath", "    modifiers: [{sticky: [0, 0.25]}]")
    text = text.replace(f"{LEARNERS}:indifferent", "mce")
    done = Done("exam", spec(tmp_path, text), "-o", tmp_path / "out", "-j", 1)
    assert done.status == 0, done.out + done.err
    assert len(scores(tmp_path / "out" / "counting-clone" / "exam.json")) == 8
    assert (tmp_path / "out" / "paths.svg").exists()
    assert scores(tmp_path / "out" / "mce" / "exam.json") == {}
    assert re.search(r"^mce( +cannot){8}$", done.out, re.MULTILINE)


def test_an_experiment_without_learners_cannot_be_an_exam(tmp_path: Path) -> None:
    text = TEXT.replace("learners:", "policies: [random] #")
    done = Done("exam", spec(tmp_path, text), "-o", tmp_path / "out")
    assert done.status == 1 and "names no learners" in done.err


@pytest.mark.parametrize(("name", "words"), [
    ("gail", "there is no learner 'gail'"),
    ("missing.py:train", "there is no file"),
    ("released/bx", "there is no learner 'released/bx'"),
    (f"{LEARNERS}:clone", "would take the place of those of"),
    ("elsewhere/counting.py:clone", "are kept in a folder 'counting-clone'"),
])  # fmt: skip
def test_a_learner_that_is_none_is_found_by_a_check_at_its_place(tmp_path: Path, name: str, words: str) -> None:
    path = spec(tmp_path, TEXT.replace(f"{LEARNERS}:indifferent", name))
    done = Done("check", path)
    line = TEXT.partition("learners:")[0].count("\n") + 1
    assert done.status == 1 and words in done.err + done.out and f":{line}:" in done.err + done.out


@pytest.mark.parametrize("key", ["learners", "policies"])
def test_a_check_runs_no_code(tmp_path: Path, key: str) -> None:
    (tmp_path / "mine.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\ndef f(x): return 0\n", encoding="utf-8")
    text = f"experiment: 1\nname: x\ntasks: [{{task: derail/RiskyPath}}]\n{key}: ['{tmp_path / 'mine.py'}:f']\n"
    assert Done("check", spec(tmp_path, text)).status == 0
    assert not (tmp_path / "ran").exists()


def test_a_task_that_a_learner_is_not_made_for_is_left_out_and_not_failed(tmp_path: Path) -> None:
    path = tmp_path / "picky.py"
    path.write_text(
        "from taskspec.exam import CannotLearn\n"
        "def train(case):\n"
        "    if case.task.name == 'Branching':\n"
        "        raise CannotLearn('too many paths')\n"
        "    return 1\n"
        "def clumsy(case):\n"
        "    raise ValueError('too many paths')\n",
        encoding="utf-8",
    )
    terms = ("--tasks", "Branching,RiskyPath", "--seeds", 2, "--steps", 10, "--transitions", 20, "--twins", 1, "-j", 1)
    done = Done("exam", f"{path}:train", *terms, "-o", tmp_path / "out")
    found: dict[str, Any] = json.loads((tmp_path / "out" / "exam.json").read_text(encoding="utf-8"))
    assert {score["task"] for score in found["scores"]} == {"derail/RiskyPath-v0"}
    assert "exploration" not in found["verdicts"]
    for flag in found["flags"]:
        assert "Branching" not in flag["task"]
    assert "too many paths" in found["tasks"]["derail/Branching-v0"]["cannot"]
    assert found["tasks"]["derail/RiskyPath-v0"]["cannot"] is None
    assert "cannot learn Branching: too many paths" in " ".join(done.out.split())
    assert "too many paths" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    failed = Done("exam", f"{path}:clumsy", *terms, "-o", tmp_path / "other", "--json").data
    kinds = {(flag["task"], flag["kind"]) for flag in failed["flags"]}
    assert ("derail/Branching-v0", "failed") in kinds


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_the_experiments_that_come_with_derail_are_sound(path: Path) -> None:
    found = expand(read(path))
    found.raise_if_wrong()
    assert found.instances and not found.refused


def test_the_benchmark_of_the_paper_is_all_its_algorithms_on_all_its_tasks() -> None:
    for family in ("paper", "corrected"):
        written = read(f"derail/{family}").experiment
        names = [name.removeprefix(f"{family}/") for name in written.learners]
        later = {"drlhp_slow", "drlhp_eps", "drlhp_rnd", "rloo", "grpo", "dpo"}
        assert set(names) == BUILT_IN.keys() - later and len(names) == 12
        assert (len(written.tasks), written.seeds, written.steps) == (10, 15, 500_000)


def test_help_and_the_format_tell_the_defaults_of_an_exam() -> None:
    terms = inspect.signature(examine).parameters
    helped = Done("exam", "--help").out
    described = {n: f.description or "" for n, f in Experiment.model_fields.items()}
    for name in ("steps", "transitions", "twins", "seeds"):
        count = terms[name].default or {"steps": STEPS, "seeds": SEEDS}[name]
        assert f"{count:,} unless given" in described[name] or f"each learner trained ({count})" in described[name]
        line = re.search(rf"--{name}\b.*?(\S+)[\s│]+unless[\s│]+given", helped, re.DOTALL)
        assert line and line[1] in (str(count), f"{count // 1000}k")
