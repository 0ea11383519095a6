"""What an agent sees of the states of a model: which look alike, and whether that hides anything."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Role, draws, reads
from taskspec.model.model import Model, refuse


def looks(model: Model) -> Array:
    """A number (T, S) for what is seen of each state at each time, T being 1 where the time is not seen; equal ones look alike.

    Noise that does not depend on the state tells nothing, and is left out.

    Raises:
        SpecError: (E712) where noise on the state decides what is seen.
    """
    nodes = []
    for node in model.task.observation.nodes:
        if not draws([node]):
            nodes.append(node)
        elif reads([node]):
            refuse(
                "the observation of a state is partly random", "draw it in `dynamics`, as an observed part of the state"
            )
    timed = (Role.TIME, "t") in reads(nodes)
    times = range((model.horizon or 0) + 1 if timed else 1)
    seen = np.concatenate([_seen(model, nodes, t) for t in times])
    _, numbers = np.unique(seen, axis=0, return_inverse=True)
    return np.asarray(numbers).reshape(len(times), model.n_states)


def _seen(model: Model, nodes: list[Any], t: int) -> Array:
    """Everything that is seen at a time, one row (S, elements) for each state."""
    n, rows = model.n_states, [np.zeros((1, model.n_states))]
    for value in evaluate(nodes, model.reads(t)):
        rows.append(np.broadcast_to(value, (*value.shape[:-1], n)).reshape(-1, n).astype(np.float64))
    return np.concatenate(rows).T


def at(seen: Array, t: int) -> Array:
    """What is seen of each state (S,) at a time."""
    return np.asarray(seen[t if len(seen) > 1 else 0])


def hides(model: Model, seen: Array) -> bool:
    """Whether two states in which episodes act at the same time look alike."""
    return any(len(np.unique(at(seen, t)[level])) < np.count_nonzero(level) for t, level in model.levels())
