"""Spaces, and values as elements of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.verification.oracle.reference.components import Component
from tests.verification.oracle.reference.task import State
from tests.verification.oracle.reference.values import Value, as_float

Seen = Sequence[tuple[str, Value]]


@dataclass(frozen=True)
class Range:
    """The values of one finite place: `n` of them from `start`."""

    start: int
    n: int


def numbers(value: Value) -> list[Any]:
    """The elements as an agent sees them: a choice by the number of its label, a condition as 0 or 1."""
    return [int(x) if isinstance(x, bool) else x for x in value.data]


def flat(seen: Seen) -> np.ndarray:
    """All values side by side, in float32."""
    with np.errstate(over="ignore"):
        return np.array([as_float(x) for _, v in seen for x in numbers(v)], np.float32)


def boxed(seen: Seen) -> np.ndarray:
    """An element of one `Box`: of the shape of the value where there is one, else flat."""
    return flat(seen).reshape(seen[0][1].shape) if len(seen) == 1 else flat(seen)


def one_hot(seen: Seen, ranges: Sequence[Range]) -> np.ndarray:
    """A block for each place, with a 1 at the value; an empty block where the value is outside its range."""
    places = [x for _, v in seen for x in numbers(v)]
    blocks = [[float(r.start + i == x) for i in range(r.n)] for x, r in zip(places, ranges, strict=True)]
    return np.array([x for block in blocks for x in block], np.float32)


def counted(seen: Seen, ranges: Sequence[Range]) -> np.ndarray:
    """An element of `MultiDiscrete`, where the lowest value of each place is 0."""
    places = [x for _, v in seen for x in numbers(v)]
    return np.array([int(x) - r.start for x, r in zip(places, ranges, strict=True)])


# ------------------------------------------------------------------------------ actions


def is_discrete(action: Sequence[Component]) -> bool:
    return len(action) == 1 and action[0].finite and action[0].shape == ()


def is_counted(action: Sequence[Component]) -> bool:
    return not is_discrete(action) and all(c.finite for c in action)


def encoded(action: Sequence[Component], chosen: State) -> Any:
    """Chosen values as an element of the action space."""
    seen = [(c.name, chosen[c.name]) for c in action]
    if is_discrete(action):
        return numbers(seen[0][1])[0]
    if is_counted(action):
        ranges = [Range(int(c.ends(i)[0]), 0) for c in action for i in range(c.size)]
        return counted(seen, ranges)
    (one, *others) = action
    chosen = boxed(seen)
    return chosen if others or one.shape or one.has_no_axis else chosen.reshape(1)
