"""Right learners are accused of nothing, wrong ones are what they say."""

from __future__ import annotations

from pathlib import Path

import pytest

from taskspec.learn.documents.rule_books import EXAM, file_of, read_exam
from taskspec.learn.exam.mistakes import MISTAKES
from tests.shared.sparse import sparse
from tests.verification.calibration import exams
from tests.verification.calibration.exams import Asked, run
from tests.verification.calibration.learners import RIGHT
from tests.verification.calibration.wrong import Mistake, mistakes, program

RULES = file_of("probes", EXAM)
assert RULES is not None
DIAGNOSES = {rule.name for rule in read_exam(RULES).rules}


@pytest.fixture(autouse=True)
def own_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Let exams be held anew."""
    monkeypatch.setattr(exams, "BUILD", tmp_path)


@pytest.mark.parametrize(
    "mistake",
    [*mistakes("wrong"), *mistakes("unseen")],
    ids=lambda each: f"{each.learner}-{each.name}",
)
def test_every_mistake_is_a_program_that_differs(mistake: Mistake) -> None:
    if mistake.learner.startswith("torch_"):
        pytest.importorskip("torch")
    right, _ = program(mistake.learner)
    assert mistake.source() != right
    assert callable(mistake.train())
    assert set(mistake.causes) <= {*MISTAKES, *DIAGNOSES} and bool(mistake.causes) != bool(mistake.why)


@pytest.mark.parametrize("learner", sparse(RIGHT, 14))
def test_a_right_learner_that_is_stopped_early_is_accused_of_nothing(learner: str) -> None:
    (told,) = run(Asked(learner, 0.05, (700_000,), 5))
    assert told.names == told.flags == ()
    assert set(told.diagnoses) <= {"still_explores"}  # which is so


NAMED = ("q_learning-end_at_limit", "q_learning-early_flag", "dyna_q-first_only", "actor_critic-untrained_critic")


@pytest.mark.slow
@pytest.mark.parametrize("mistake", [each for each in mistakes() if f"{each.learner}-{each.name}" in NAMED])
def test_a_mistake_is_named(mistake: Mistake) -> None:
    (told,) = run(Asked(mistake.learner, 1.0, (710_000,), 5, mistake))
    assert set(told.names) & set(mistake.causes)
