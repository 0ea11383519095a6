"""taskspec: declarative diagnostic reinforcement-learning tasks.

One YAML spec gives a Gymnasium environment, an exact model and the printed appendix.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from taskspec.base import __version__ as __version__
from taskspec.base.diagnostics import Diagnostic as Diagnostic
from taskspec.base.diagnostics import SpecError as SpecError
from taskspec.base.diagnostics import TaskspecError as TaskspecError
from taskspec.base.extras import on_demand
from taskspec.envs.making import make as make
from taskspec.envs.making import make_vec as make_vec
from taskspec.envs.making import register as register
from taskspec.language.registry import load as load
from taskspec.language.registry import task_ids as task_ids
from taskspec.language.task.task import Task as Task

if TYPE_CHECKING:
    from taskspec import data as data
    from taskspec import envs as envs
    from taskspec import exact as exact
    from taskspec import exam as exam
    from taskspec import experiments as experiments
    from taskspec import notebook as notebook
    from taskspec import oracle as oracle
    from taskspec.envs import Environment as Environment
    from taskspec.language.modifiers import modify as modify
    from taskspec.show.figures import drawing as drawing

_ON_DEMAND = {
    "Environment": "taskspec.envs.env",
    "data": "taskspec.data",
    "drawing": "taskspec.show.figures",
    "envs": "taskspec.envs",
    "exact": "taskspec.exact",
    "exam": "taskspec.exam",
    "experiments": "taskspec.experiments",
    "modify": "taskspec.language.modifiers",
    "notebook": "taskspec.notebook",
    "oracle": "taskspec.oracle",
}
__getattr__ = on_demand(__name__, _ON_DEMAND)
__all__ = [
    "Diagnostic",
    "Environment",
    "SpecError",
    "Task",
    "TaskspecError",
    "drawing",
    "load",
    "make",
    "make_vec",
    "modify",
    "register",
    "task_ids",
]


def __dir__() -> list[str]:
    return sorted({*globals(), *_ON_DEMAND})


with suppress(SpecError):  # a wrong TASKSPEC_LIMITS is reported by the call that needs the limits
    register()  # Gymnasium learns the ids of the shipped tasks
