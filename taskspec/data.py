"""Data for learners: demonstrations, preferences, and exact models as arrays."""

from __future__ import annotations

from taskspec.learn.data.datasets import read as read
from taskspec.learn.data.datasets import write as write
from taskspec.learn.data.episodes import Demonstrations as Demonstrations
from taskspec.learn.data.episodes import Trajectory as Trajectory
from taskspec.learn.data.episodes import Transitions as Transitions
from taskspec.learn.data.episodes import demonstrations as demonstrations
from taskspec.learn.data.preferences import Preferences as Preferences
from taskspec.learn.data.preferences import Teacher as Teacher
from taskspec.learn.data.preferences import preferences as preferences
from taskspec.learn.data.tabular import Tabular as Tabular
from taskspec.learn.data.tabular import tabular as tabular

__all__ = [
    "Demonstrations",
    "Preferences",
    "Tabular",
    "Teacher",
    "Trajectory",
    "Transitions",
    "demonstrations",
    "preferences",
    "read",
    "tabular",
    "write",
]
