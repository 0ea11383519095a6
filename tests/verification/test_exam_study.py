"""The mutation study: its mistakes are where it says, and its stored exams tell right learners from wrong ones."""

from __future__ import annotations

from pathlib import Path

import pytest

import taskspec
from taskspec.exact.policies.python_files import function_of
from taskspec.exam import examine, read
from taskspec.learn.exam.findings import diagnose
from taskspec.learn.exam.learned import explanations
from tests.shared.commands import Done
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse
from tests.shared.specs import ROOT
from tests.verification.exam_study.bugs import LEARNERS, Bug, bugs
from tests.verification.exam_study.exams import PROBES, TERMS, TRANSITIONS


@pytest.mark.parametrize("bug", bugs(), ids=lambda bug: f"{bug.learner}-{bug.name}")
def test_every_mistake_is_a_program_that_differs(bug: Bug) -> None:
    source = bug.source()
    compile(source, bug.name, "exec")
    assert source != (LEARNERS / f"{bug.learner}.py").read_text(encoding="utf-8")


def test_a_mistake_whose_text_is_gone_is_no_mistake() -> None:
    with pytest.raises(ValueError, match="stands there 0 times"):
        Bug("bc", "gone", "", {"what stands nowhere": ""}).source()


@pytest.mark.parametrize("learner", [name for name, terms in TERMS.items() if terms.is_shipped])
def test_stored_exams_are_of_the_tasks_as_they_are(learner: str) -> None:
    stored = read(f"derail/{learner}")
    assert {task: about["content_hash"] for task, about in stored["tasks"].items()} == {
        task: taskspec.load(task).content_hash for task in stored["tasks"]
    }
    assert not any(score["error"] for score in stored["scores"])


@for_each("path", sorted(ROOT.glob("docs/results/**/exam.json.gz")))
def test_stored_exams_have_the_diagnoses_of_the_present_rules(path: Path) -> None:
    exam = read(path.parent)
    assert list(map(dict, exam["diagnoses"])) == list(map(dict, diagnose(exam, "derail")))


NAMED = (
    "mask_inverted", "first_step_only", "late_reward", "whole_batch", "wrong_sign", "late_done", "all_actions",
    "centred_rewards",
)  # fmt: skip
"""Mistakes in the learner with a replay buffer that one seed on the probes shows."""


@pytest.mark.parametrize("name", sparse(NAMED, 8))
def test_a_mistake_is_named_by_learned_values(name: str, tmp_path: Path) -> None:
    bug = next(each for each in bugs() if (each.learner, each.name) == ("replay", name))
    path = tmp_path / "replay.py"
    path.write_text(bug.source(), encoding="utf-8")
    train = function_of(f"{path}:train")
    tasks = [f"probes/{probe}" for probe in PROBES]
    exam = examine(train, suite="probes", tasks=tasks, seeds=range(4000, 4003), steps=TERMS["replay"].steps, twins=0)
    (found,) = explanations(exam["scores"])
    assert found.names == tuple(bug.causes)


@pytest.mark.slow
def test_the_command_tells_a_right_clone_from_a_wrong_one(tmp_path: Path) -> None:
    options = ["--against", "derail/bc", "--seeds", "4", "-t", "Branching,EarlyTermPos", "-j", "1", "--twins", "1"]
    options += ["--steps", str(TERMS["bc"].steps), "--transitions", str(TRANSITIONS), "--out", str(tmp_path)]
    right = Done("exam", f"{LEARNERS}/bc.py:train", *options)
    assert right.status == 0, right.out
    (tmp_path / "bc.py").write_text(next(b for b in bugs() if b.name == "off_by_one").source())
    wrong = Done("exam", f"{tmp_path}/bc.py:train", *options)
    assert wrong.status == 1 and "on twins" in wrong.out
    none = Done("exam", f"{LEARNERS}/bc.py:train", *options[2:], "--against", "derail/bcc")
    assert none.status == 1 and "derail/bc" in none.err
