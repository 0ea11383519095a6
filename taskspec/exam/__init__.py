"""The exam: verdicts, flags and diagnoses of a learner from its scores on a suite of tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taskspec.base.extras import on_demand

if TYPE_CHECKING:
    from taskspec.exam.case import BudgetSpent as BudgetSpent
    from taskspec.exam.case import Case as Case
    from taskspec.exam.case import NotGranted as NotGranted
    from taskspec.exam.case import learns_from as learns_from
    from taskspec.exam.examining import examine as examine
    from taskspec.exam.laws import obeys as obeys
    from taskspec.exam.learned import Learned as Learned
    from taskspec.exam.results import Exam as Exam
    from taskspec.exam.results import read as read
    from taskspec.exam.starc import RewardDistance as RewardDistance
    from taskspec.exam.starc import reward_distance as reward_distance
    from taskspec.jobs.running import Running as Running
    from taskspec.learners import CannotLearn as CannotLearn

__getattr__ = on_demand(__name__, {
    "BudgetSpent": "taskspec.exam.case",
    "Case": "taskspec.exam.case",
    "NotGranted": "taskspec.exam.case",
    "learns_from": "taskspec.exam.case",
    "Running": "taskspec.jobs.running",
    "examine": "taskspec.exam.examining",
    "Learned": "taskspec.exam.learned",
    "obeys": "taskspec.exam.laws",
    "Exam": "taskspec.exam.results",
    "read": "taskspec.exam.results",
    "RewardDistance": "taskspec.exam.starc",
    "reward_distance": "taskspec.exam.starc",
    "CannotLearn": "taskspec.learners",
})  # fmt: skip

__all__ = [
    "BudgetSpent", "CannotLearn", "Case", "Exam", "Learned", "NotGranted", "RewardDistance", "Running", "examine", "learns_from",
    "obeys", "read", "reward_distance",
]  # fmt: skip
