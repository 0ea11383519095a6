"""Observations that show too much or too little."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.diagnostics import Collector
from taskspec.exact import solve
from taskspec.exact.lint.case import Case
from taskspec.exact.model import Model
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Node, draws, reads

Array = np.ndarray[Any, Any]


def leak(case: Case, collector: Collector) -> None:
    """W508: the reward is written into the next observation."""
    task = case.task
    if task.observation.is_state:
        return
    reward = _bare(task.reward)
    if draws([reward]):
        return  # what chance paid can only be known by being shown
    for c, node in zip(task.observation.components, task.next_observation, strict=True):
        if _bare(node) is reward and reads([node]):
            place = task.surface.sections["observation"].get(c.name)
            collector.add("W508", place and place.place, f"'{c.name}' is the reward of the step before")


def _bare(node: Node) -> Node:
    while isinstance(node, Apply) and node.op in ("to_real", "to_int"):
        node = node.args[0]
    return node


def hidden_goal(case: Case, collector: Collector) -> None:
    """W509: first states that look the same and have no best action in common."""
    model, task = case.model, case.task
    if model is None or task.observation.is_state:
        return
    first = np.flatnonzero(model.start > 0)
    seen = _first_looks(model, first)
    if seen is None or len(np.unique(seen, axis=0)) == len(first):
        return
    if case.results.optimal is None:
        return
    good = solve.ties(solve.all_action_values(model)[0])[:, first]
    _, group = np.unique(seen, axis=0, return_inverse=True)
    group = group.reshape(-1)
    for number in range(int(group.max()) + 1):
        members = np.flatnonzero(group == number)
        if not good[:, members].all(axis=1).any():
            one, other = (model.state_name(int(first[m])) for m in _conflict(good, members))
            message = f"episodes begin in {one} and in {other}; the agent sees the same, and no action is best in both"
            collector.add("W509", case.merged.span(("observation",)), message)
            return


def _conflict(good: Array, members: Array) -> tuple[int, int]:
    """Two members without a best action in common, or else the first two."""
    for i, a in enumerate(members):
        for b in members[i + 1 :]:
            if not (good[:, a] & good[:, b]).any():
                return int(a), int(b)
    return int(members[0]), int(members[1])


def _first_looks(model: Model, first: Array) -> Array | None:
    """What is seen of the first states (N, elements); None where noise on the state hides it."""
    rows = []
    given = {k: v[..., first] if v.shape[-1] > 1 else v for k, v in model.reads(0).items()}
    for node in model.task.observation.nodes:
        if draws([node]):
            if reads([node]):
                return None
            continue  # noise alone tells nothing
        (value,) = evaluate([node], given)
        rows.append(np.broadcast_to(value, (*value.shape[:-1], len(first))).reshape(-1, len(first)))
    return np.concatenate(rows).T.astype(np.float64) if rows else np.zeros((len(first), 1))
