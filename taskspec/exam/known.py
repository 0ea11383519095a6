"""What is known of a task, worked out once for all that a process has to do with it."""

from __future__ import annotations

import pickle
from functools import lru_cache

from taskspec.exact.scoring.returns import Results
from taskspec.experiments.order import Sent


def results_of(about: Sent, episodes: int) -> Results:
    """The results of a task, with so many episodes for what has to be simulated."""
    return _results(pickle.dumps(about), episodes)


@lru_cache(maxsize=16)
def _results(about: bytes, episodes: int) -> Results:
    sent: Sent = pickle.loads(about)
    return Results(sent.task(), episodes)
