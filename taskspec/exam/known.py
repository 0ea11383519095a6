"""What is known of a task, worked out once for all that a process has to do with it."""

from __future__ import annotations

import pickle
from functools import lru_cache

from taskspec.exact.scoring.returns import Results
from taskspec.task.task import Task


def results_of(task: Task, episodes: int) -> Results:
    """The results of a task, with so many episodes for what has to be simulated."""
    return _results(pickle.dumps(task), episodes)


@lru_cache(maxsize=16)
def _results(task: bytes, episodes: int) -> Results:
    return Results(pickle.loads(task), episodes)
