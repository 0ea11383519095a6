"""Data for learners: demonstrations, preferences, and exact models as arrays."""

from __future__ import annotations

from taskspec.envs.data.datasets import read as read
from taskspec.envs.data.datasets import write as write
from taskspec.envs.data.episodes import Demonstrations as Demonstrations
from taskspec.envs.data.episodes import Trajectory as Trajectory
from taskspec.envs.data.episodes import Transitions as Transitions
from taskspec.envs.data.episodes import demonstrations as demonstrations
from taskspec.envs.data.preferences import Preferences as Preferences
from taskspec.envs.data.preferences import Teacher as Teacher
from taskspec.envs.data.preferences import preferences as preferences
from taskspec.envs.data.tabular import Tabular as Tabular
from taskspec.envs.data.tabular import tabular as tabular

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
