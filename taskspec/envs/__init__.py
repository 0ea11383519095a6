"""Gymnasium environments of tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taskspec.lazily import on_demand

if TYPE_CHECKING:
    from taskspec.envs.env import Environment as Environment
    from taskspec.envs.errors import ActionError as ActionError
    from taskspec.envs.errors import LaneError as LaneError
    from taskspec.envs.errors import NotRunningError as NotRunningError
    from taskspec.envs.errors import StateError as StateError

__getattr__ = on_demand(__name__, {
    "Environment": "taskspec.envs.env",
    "ActionError": "taskspec.envs.errors",
    "LaneError": "taskspec.envs.errors",
    "NotRunningError": "taskspec.envs.errors",
    "StateError": "taskspec.envs.errors",
})  # fmt: skip

__all__ = ["ActionError", "Environment", "LaneError", "NotRunningError", "StateError"]
