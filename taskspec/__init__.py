"""taskspec: declarative diagnostic reinforcement-learning tasks.

One YAML spec gives a Gymnasium environment, an exact model and the printed appendix.
"""

from __future__ import annotations

import sys

TYPE_CHECKING = False  # as in `typing`, which need not be imported
if TYPE_CHECKING:
    from taskspec import envs as envs
    from taskspec import exact as exact
    from taskspec import exam as exam
    from taskspec import experiments as experiments
    from taskspec.base import __version__ as __version__
    from taskspec.base.diagnostics import Diagnostic as Diagnostic
    from taskspec.base.diagnostics import SpecError as SpecError
    from taskspec.base.diagnostics import TaskspecError as TaskspecError
    from taskspec.envs import Environment as Environment
    from taskspec.envs import data as data
    from taskspec.envs.making import make as make
    from taskspec.envs.making import make_vec as make_vec
    from taskspec.envs.making import register as register
    from taskspec.language.modifiers import modify as modify
    from taskspec.language.registry import load as load
    from taskspec.language.registry import task_ids as task_ids
    from taskspec.language.task.task import Task as Task
    from taskspec.show.figures import drawing as drawing
    from taskspec.tools import notebook as notebook

_PUBLIC = {
    "__version__": "taskspec.base",
    "Diagnostic": "taskspec.base.diagnostics",
    "Environment": "taskspec.envs",
    "SpecError": "taskspec.base.diagnostics",
    "TaskspecError": "taskspec.base.diagnostics",
    "Task": "taskspec.language.task.task",
    "drawing": "taskspec.show.figures",
    "load": "taskspec.language.registry",
    "make": "taskspec.envs.making",
    "make_vec": "taskspec.envs.making",
    "modify": "taskspec.language.modifiers",
    "register": "taskspec.envs.making",
    "task_ids": "taskspec.language.registry",
}
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
_ROOMS = ("data", "envs", "exact", "exam", "experiments", "notebook")
"""Packages whose names are public, too: `taskspec.envs.data.episodes`."""


def __getattr__(name: str) -> object:
    """Import a public name on first use."""
    from importlib import import_module

    if name in _ROOMS:
        return import_module(f"taskspec.{name}")
    if name not in _PUBLIC:
        raise AttributeError(f"module 'taskspec' has no attribute {name!r}")
    value: object = getattr(import_module(_PUBLIC[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC, *_ROOMS})


def _is_command() -> bool:
    """Return whether this process is the command line or works for it, and starts sooner without Gymnasium."""
    program = sys.argv[0].replace("\\", "/") if sys.argv else ""
    if program == "-m":  # the package is imported before its `__main__` is found
        return "-m taskspec" in " ".join(sys.orig_argv)
    return program.endswith(("/taskspec", "/taskspec.exe", "/taskspec/__main__.py"))


if not _is_command():
    # Gymnasium learns the ids of the shipped tasks. By name: an import would put the package above its layers.
    __import__("taskspec.envs.making").envs.making.register()
