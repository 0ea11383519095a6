"""Gymnasium environments of tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taskspec.base.extras import on_demand

if TYPE_CHECKING:
    from taskspec.envs.env import Environment as Environment
    from taskspec.envs.options import ActionError as ActionError
    from taskspec.envs.options import LaneError as LaneError
    from taskspec.envs.options import NotRunningError as NotRunningError
    from taskspec.envs.options import StateError as StateError

__getattr__ = on_demand(__name__, {
    "Environment": "taskspec.envs.env",
    "ActionError": "taskspec.envs.options",
    "LaneError": "taskspec.envs.options",
    "NotRunningError": "taskspec.envs.options",
    "StateError": "taskspec.envs.options",
})  # fmt: skip

__all__ = ["ActionError", "Environment", "LaneError", "NotRunningError", "StateError"]
