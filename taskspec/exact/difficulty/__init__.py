"""How hard a task is, in numbers that theory gives: one table of measures, worked out on the exact model."""

from __future__ import annotations

from taskspec.exact.difficulty.measures import MEASURES as MEASURES
from taskspec.exact.difficulty.measures import Measure as Measure
from taskspec.exact.difficulty.told import Difficulty as Difficulty
from taskspec.exact.difficulty.told import difficulty as difficulty

__all__ = ["MEASURES", "Difficulty", "Measure", "difficulty"]
