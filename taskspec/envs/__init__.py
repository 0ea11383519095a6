"""Gymnasium environments of tasks."""

from __future__ import annotations

from taskspec.envs.env import Environment as Environment
from taskspec.envs.errors import ActionError as ActionError
from taskspec.envs.errors import LaneError as LaneError
from taskspec.envs.errors import NotRunningError as NotRunningError
from taskspec.envs.errors import StateError as StateError

__all__ = ["ActionError", "Environment", "LaneError", "NotRunningError", "StateError"]
