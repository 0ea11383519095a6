"""Data for learners: demonstrations, preferences, and exact models as arrays."""

from __future__ import annotations

from taskspec.data.datasets import read as read
from taskspec.data.datasets import write as write
from taskspec.data.episodes import Demonstrations as Demonstrations
from taskspec.data.episodes import Trajectory as Trajectory
from taskspec.data.episodes import Transitions as Transitions
from taskspec.data.episodes import demonstrations as demonstrations
from taskspec.data.preferences import Preferences as Preferences
from taskspec.data.preferences import Teacher as Teacher
from taskspec.data.preferences import preferences as preferences
from taskspec.data.tabular import Tabular as Tabular
from taskspec.data.tabular import tabular as tabular

__all__ = [
    "Demonstrations", "Preferences", "Tabular", "Teacher", "Trajectory", "Transitions",
    "demonstrations", "preferences", "read", "tabular", "write",
]  # fmt: skip
