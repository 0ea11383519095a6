"""The exam: verdicts, flags and diagnoses of a learner from its scores on a suite of tasks."""

from __future__ import annotations

from taskspec.learn.exam.case import BudgetSpent as BudgetSpent
from taskspec.learn.exam.case import Case as Case
from taskspec.learn.exam.case import NotGranted as NotGranted
from taskspec.learn.exam.case import learns_from as learns_from
from taskspec.learn.exam.examining import examine as examine
from taskspec.learn.exam.laws import obeys as obeys
from taskspec.learn.exam.learned import Learned as Learned
from taskspec.learn.exam.results import Exam as Exam
from taskspec.learn.exam.results import read as read
from taskspec.learn.exam.starc import RewardDistance as RewardDistance
from taskspec.learn.exam.starc import reward_distance as reward_distance
from taskspec.learn.jobs.running import Running as Running
from taskspec.learn.learners import CannotLearn as CannotLearn

__all__ = [
    "BudgetSpent",
    "CannotLearn",
    "Case",
    "Exam",
    "Learned",
    "NotGranted",
    "RewardDistance",
    "Running",
    "examine",
    "learns_from",
    "obeys",
    "read",
    "reward_distance",
]
