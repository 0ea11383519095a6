"""Learners to examine tasks with, and to be examined: PPO, cloning, GAIL, AIRL, comparisons, and maximum entropy."""

from __future__ import annotations

from taskspec.learners.case import CannotLearn as CannotLearn
from taskspec.learners.learner import BUILT_IN as BUILT_IN
from taskspec.learners.learner import FAMILIES as FAMILIES
from taskspec.learners.learner import BuiltIn as BuiltIn
from taskspec.learners.learner import Learner as Learner
from taskspec.learners.learner import learner as learner

__all__ = ["BUILT_IN", "FAMILIES", "BuiltIn", "CannotLearn", "Learner", "learner"]
