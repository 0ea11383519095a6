"""The exam: what is wrong with a learner, told from its scores on a suite of tasks."""

from __future__ import annotations

from taskspec.exam.case import BudgetSpent as BudgetSpent
from taskspec.exam.case import Case as Case
from taskspec.exam.case import NotGranted as NotGranted
from taskspec.exam.case import learns_from as learns_from
from taskspec.exam.examining import Running as Running
from taskspec.exam.examining import examine as examine
from taskspec.exam.policies import Learned as Learned
from taskspec.exam.results import Exam as Exam
from taskspec.exam.results import read as read
from taskspec.exam.rewards import RewardDistance as RewardDistance
from taskspec.exam.rewards import reward_distance as reward_distance
from taskspec.learners import CannotLearn as CannotLearn

__all__ = [
    "BudgetSpent", "CannotLearn", "Case", "Exam", "Learned", "NotGranted", "RewardDistance", "Running", "examine", "learns_from",
    "read", "reward_distance",
]  # fmt: skip
