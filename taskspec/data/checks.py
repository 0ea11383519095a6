"""Checks of data that was read from a file: every array has its shape and type, and the rows make up episodes.

What is wrong is a `ValueError`, in words for people.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.data.transitions import Transitions

REAL = (np.dtype(np.float64),)
BOOL = (np.dtype(np.bool_),)
WHOLE = (np.dtype(np.int64),)
SPACE = (np.dtype(np.int64), np.dtype(np.float32))
"""The types of observations and of actions."""


def check_transitions(data: Transitions) -> None:
    """Check the arrays of transitions, and that each episode or segment is a run of steps of which only the last may end it.

    Raises:
        ValueError: for the first array that is not as it should be.
    """
    rows = len(data.rews) if np.ndim(data.rews) else 0
    if not rows:
        raise ValueError("it has no transitions")
    _check("rews", data.rews, REAL, (rows,))
    if not np.isfinite(data.rews).all():
        row = int(np.argmin(np.isfinite(data.rews)))
        raise ValueError(f"`rews` is {data.rews[row]} in row {row}")
    _check("terminated", data.terminated, BOOL, (rows,))
    _check("truncated", data.truncated, BOOL, (rows,))
    _check("episode", data.episode, WHOLE, (rows,))
    _check("time", data.time, WHOLE, (rows,))
    _check("acts", data.acts, SPACE, (rows, *np.shape(data.acts)[1:]))
    _check_seen(data, rows)
    _check_steps(data)


def _check_seen(data: Transitions, rows: int) -> None:
    """Check that observations before and after a step are of the same kind."""
    before = _parts("obs", data.obs)
    after = _parts("next_obs", data.next_obs)
    if [name.removeprefix("next_") for name in after] != list(before):
        raise ValueError(f"observations are {', '.join(before)} before a step and {', '.join(after)} after it")
    for (name, part), (next_name, next_part) in zip(before.items(), after.items(), strict=True):
        _check(name, part, SPACE, (rows, *np.shape(part)[1:]))
        _check(next_name, next_part, (part.dtype,), part.shape)


def _parts(name: str, seen: Any) -> dict[str, Array]:
    """The arrays of observations, by the names that they have in files."""
    if isinstance(seen, dict):
        return {f"{name}.{key}": seen[key] for key in sorted(seen)}
    return {name: seen}


def _check_steps(data: Transitions) -> None:
    """Check the order of steps and of episodes."""
    change = np.diff(data.episode)
    if data.episode[0] < 0 or (change < 0).any():
        raise ValueError("`episode` is negative somewhere, or falls from one row to the next")
    inside = change == 0
    wrong = inside & (np.diff(data.time) != 1)
    if data.time.min() < 0 or wrong.any():
        raise ValueError("`time` does not count the steps of an episode")
    if (data.dones[:-1] & inside).any():
        row = int(np.argmax(data.dones[:-1] & inside))
        raise ValueError(f"episode {data.episode[row]} ends in row {row}, and has more steps after it")


def check_whole(data: Transitions) -> None:
    """Check that the transitions are those of whole episodes.

    Raises:
        ValueError: for the first episode that begins late or has no end.
    """
    late = np.flatnonzero(data.time[data.starts] != 0)
    if len(late):
        raise ValueError(f"episode {data.episode[data.starts[late[0]]]} does not begin at time 0")
    last = data.starts + data.lengths - 1
    endless = np.flatnonzero(~data.dones[last])
    if len(endless):
        raise ValueError(
            f"episode {data.episode[last[endless[0]]]} is neither terminated nor truncated in its last row"
        )


def check_pairs(segments: Transitions, preferences: Array, returns: Array, queries: Array) -> None:
    """Check what is told of each pair of segments.

    Raises:
        ValueError: for the first array that is not as it should be.
    """
    pairs = len(preferences) if np.ndim(preferences) else 0
    if not np.array_equal(segments.episode[segments.starts], np.arange(2 * pairs)):
        raise ValueError(f"`episode` does not number the segments of {pairs} pairs from 0 to {2 * pairs - 1}")
    _check("preferences", preferences, REAL, (pairs,))
    _check("returns", returns, REAL, (pairs, 2))
    _check("queries", queries, WHOLE, (pairs,))
    if not ((preferences >= 0) & (preferences <= 1)).all():
        raise ValueError("`preferences` are not all between 0 and 1")
    if not np.isfinite(returns).all():
        raise ValueError("`returns` are not all finite")


def _check(name: str, value: Any, types: tuple[np.dtype[Any], ...], shape: tuple[int, ...]) -> None:
    """Check the type and the shape of an array."""
    if not isinstance(value, np.ndarray):
        raise ValueError(f"`{name}` is not one array")
    if value.dtype not in types:
        raise ValueError(f"`{name}` is {value.dtype}, not {' or '.join(map(str, types))}")
    if value.shape != shape:
        raise ValueError(f"`{name}` has the shape {value.shape}, not {shape}")
