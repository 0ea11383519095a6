"""What an environment raises when it is misused. Each is also Gymnasium's own kind of error, so existing handlers catch it."""

from __future__ import annotations

import gymnasium.error

from taskspec.diagnostics import TaskspecError


class ActionError(TaskspecError, gymnasium.error.InvalidAction, ValueError):
    """An action outside the action space (E706)."""


class NotRunningError(TaskspecError, gymnasium.error.ResetNeeded):
    """A step before the first reset (E707) or after the end of the episode (E708)."""


class LaneError(TaskspecError, AttributeError):
    """An attribute that the lanes of a vector environment do not have, or do not let go of (E713)."""


class StateError(TaskspecError, ValueError):
    """A state that the task does not have (E709)."""
