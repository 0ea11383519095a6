"""Values of a task's expressions at states: what figures show beside the transitions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.exact.model.space import Space
from taskspec.lang import batch
from taskspec.lang.evaluate import evaluate
from taskspec.lang.ir import Node, Role
from taskspec.lang.ir import draws as draws_of
from taskspec.lang.variates.sample import sampler
from taskspec.task.task import Task

Array = np.ndarray[Any, Any]
State = Mapping[str, Any]
Reads = dict[tuple[Role, str], Array]
STEPS = 200
"""Steps of an episode that are followed."""


def at_states(task: Task, node: Node, reads: Reads, count: int) -> Array:
    """Values (count, *shape) of a node at states given as arrays (*shape, count)."""
    given = {(Role.TIME, "t"): np.zeros(1, dtype=np.int64)} | reads
    (found,) = batch.evaluate([node], given)
    return np.moveaxis(np.broadcast_to(found, (*found.shape[:-1], count)), -1, 0)


def reads_of(task: Task, state: State) -> Reads:
    """One state, by component, as what expressions read."""
    found: Reads = {}
    for c in task.state:
        value = state[c.name]
        if c.domain is not None and isinstance(value, str):
            value = c.domain.labels.index(value)
        found[Role.STATE, c.name] = np.asarray(value, dtype=batch.DTYPES[c.type.kind]).reshape(*c.type.shape, 1)
    return found


def all_states(task: Task, limit: int = 20_000) -> tuple[Reads, int] | None:
    """Every declared state of a finite task, or None when there are too many."""
    if not task.is_finite:
        return None
    space = Space(task.state, Role.STATE)
    if space.size > limit:
        return None
    return dict(space.decode(np.arange(space.size))), space.size


def first_state(task: Task, seed: int = 0) -> dict[str, Any]:
    """A first state, as the environment's reset with this seed draws it."""
    layout = task.reset_words
    words = draws.words(seed, draws.RESET, 0, layout.count)
    flats = evaluate(task.initial, {}, sampler(layout, words))
    return {c.name: _shaped(flat, c.type.shape) for c, flat in zip(task.state, flats, strict=True)}


def _shaped(flat: tuple[Any, ...], shape: tuple[int, ...]) -> Any:
    return flat[0] if not shape else np.array([float(x) for x in flat]).reshape(shape)


def expert_path(task: Task, steps: int, seed: int = 0) -> list[dict[str, Any]]:
    """States of an episode of the expert, where its actions are expressions and nothing is drawn in a step."""
    task = task.remembering()
    states = [first_state(task, seed)]
    nodes = task.next
    if not isinstance(task.expert, tuple) or draws_of((*nodes, task.terminal, *task.expert)):
        return states
    for t in range(steps):
        reads = {**reads_of(task, states[-1]), (Role.TIME, "t"): np.array([t], dtype=np.int64)}
        actions = batch.evaluate(task.expert, reads)
        chosen = {(Role.ACTION, c.name): a for c, a in zip(task.action, actions, strict=True)}
        *found, ends = batch.evaluate((*nodes, task.terminal), reads | chosen)
        states.append({c.name: v[..., 0] for c, v in zip(task.state, found, strict=True)})
        if bool(np.all(ends)):
            break
    return states
