"""What scores of a task are measured by: random actions, the expert, the optimum; worked out once a process."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import pickle
from functools import lru_cache
from typing import Any

import numpy as np

import taskspec
from taskspec.base.limits import also
from taskspec.policies.values import policy_value
from taskspec.scores.returns import Results, Return, normalised
from taskspec.task.task import Task

# What is known of a task, worked out once for all that a process has to do with it.


def results_of(task: Task, episodes: int) -> Results:
    """Return the results of a task, with so many episodes for what has to be simulated."""
    return _results(pickle.dumps(task), episodes)


@lru_cache(maxsize=16)
def _results(task: bytes, episodes: int) -> Results:
    return Results(pickle.loads(task), episodes)


# What scores of a task are measured by: random actions, the expert, the optimum, and constant actions.

MOST = 64
"""Constant actions that are tried."""


def key(content_hash: str, episodes: int, limits: str) -> str:
    """Return what the yardsticks of a task are kept under."""
    told = ["yardsticks", content_hash, episodes, limits, taskspec.__version__]
    return hashlib.sha256(json.dumps(told).encode()).hexdigest()


def measured_within(task: Task, episodes: int, limits: str) -> dict[str, Any]:
    """Do `measured` within limits, as `taskspec.base.limits.also` takes them."""
    with also(limits):
        return measured(task, episodes)


def measured(task: Task, episodes: int) -> dict[str, Any]:
    """Return returns of random actions, the expert and the optimum, and the score of the best constant action, as JSON data."""
    results = results_of(task, episodes)
    found = {name: getattr(results, name) for name in ("random", "expert", "optimal", "worst")}
    top = found["expert"] or found["optimal"]
    ends = (None, None) if top is None or found["random"] is None else (found["random"].value, top.value)
    told = {name: None if value is None else value.value for name, value in found.items()}
    halves = {f"{name}_half": None if value is None else value.half for name, value in found.items()}
    return told | halves | {"expert": ends[1], "constant": score(_constant(results).value, *ends)}


def score(value: float, random: float | None, expert: float | None) -> float | None:
    """Return a return on the scale random 0, expert 1; None where the task has no such scale."""
    if random is None or expert is None:
        return None
    found = normalised(value, random, expert, floor=None)
    return found if math.isfinite(found) else None


def _constant(results: Results) -> Return:
    """Return the best return of those who always take the same action."""
    found = (policy_value(results, _Constant(action), True).value for action in _actions(results.task))
    return max(found, key=lambda value: value.value)


def _actions(task: Task) -> list[Any]:
    """Return actions as the environment takes them: all where they are few, otherwise some; of ranges the ends and the
    middle.
    """
    layout = task.action_layout
    if layout.form == "discrete":
        return list(range(layout.starts[0], layout.starts[0] + min(layout.counts[0], MOST)))
    if layout.form == "multi_discrete":
        return [np.array(a) for a in itertools.islice(itertools.product(*map(range, layout.counts)), MOST)]
    low, high = np.clip(np.array(layout.limits).T, -1e6, 1e6).reshape(2, *layout.shape)
    return [(low + share * (high - low)).astype(np.float32) for share in (0.0, 0.5, 1.0)]


class _Constant:
    """A policy that takes one action always."""

    def __init__(self, action: Any) -> None:
        self.action = action

    def predict(self, observations: Any) -> Any:
        lanes = len(next(iter(observations.values())) if isinstance(observations, dict) else observations)
        return np.array([self.action] * lanes)
