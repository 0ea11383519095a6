"""Learners that come with the package: PPO, cloning, GAIL, AIRL, preferences and maximum entropy."""

from __future__ import annotations

from taskspec.learn.learners.built_in import BUILT_IN as BUILT_IN
from taskspec.learn.learners.built_in import FAMILIES as FAMILIES
from taskspec.learn.learners.built_in import Learner as Learner
from taskspec.learn.learners.built_in import learner as learner
from taskspec.learn.learners.interface import CannotLearn as CannotLearn

__all__ = ["BUILT_IN", "FAMILIES", "CannotLearn", "Learner", "learner"]
