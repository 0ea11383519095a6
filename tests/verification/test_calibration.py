"""Learners over tables: right ones are accused of nothing, wrong ones are what they say."""

from __future__ import annotations

import pytest

from taskspec.learn.exam.mistakes import MISTAKES
from tests.shared.sparse import sparse
from tests.verification.calibration.__main__ import Asked, run
from tests.verification.calibration.right import RIGHT
from tests.verification.calibration.wrong import HERE, Mistake, mistakes


@pytest.mark.parametrize("mistake", mistakes(), ids=lambda each: f"{each.learner}-{each.name}")
def test_every_mistake_is_a_program_that_differs(mistake: Mistake) -> None:
    assert mistake.source() != (HERE / "right.py").read_text(encoding="utf-8")
    assert callable(mistake.train())
    assert set(mistake.causes) <= set(MISTAKES) and bool(mistake.causes) != bool(mistake.why)


@pytest.mark.parametrize("learner", sparse(RIGHT, 7))
def test_a_right_learner_that_is_stopped_early_is_accused_of_nothing(learner: str) -> None:
    (told,) = run(Asked(learner, 0.05, (700_000,), 5))
    assert told.names == told.diagnoses == told.flags == ()


NAMED = ("q_learning-end_at_limit", "q_learning-early_flag", "dyna_q-first_only", "actor_critic-untrained_critic")


@pytest.mark.slow
@pytest.mark.parametrize("mistake", [each for each in mistakes() if f"{each.learner}-{each.name}" in NAMED])
def test_a_mistake_is_named(mistake: Mistake) -> None:
    (told,) = run(Asked(mistake.learner, 1.0, (710_000,), 5, mistake))
    assert set(told.names) & set(mistake.causes)
