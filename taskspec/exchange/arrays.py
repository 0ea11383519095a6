"""Tables of Python users: Gymnasium's `P` as JSON or from an environment, and arrays of NumPy."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from taskspec.base.diagnostics import spec_error
from taskspec.exchange.reading import MOST_BYTES, ForeignFile, Row, assembled
from taskspec.exchange.tables import FrozenOutcome, FrozenTask

COLUMNS = {
    "state": "<i8",
    "action": "<i8",
    "next_state": "<i8",
    "probability": "<f8",
    "reward": "<f8",
    "terminated": "?",
}
"""Arrays with an entry for each outcome, and their types."""


# -- Gymnasium's P ----------------------------------------------------------------------------------------------------


def write_p(task: FrozenTask) -> bytes:
    """Return JSON: under `P` lists `[probability, next state, reward, terminated]` by state and action.

    Numbers are floats, and keys strings. `initial` is the start distribution, as toy_text's `initial_state_distrib` is.
    """
    P: dict[str, dict[str, list[list[Any]]]] = {}
    for s, a, o in task.steps():
        row = P.setdefault(str(s), {}).setdefault(str(a), [])
        row.append([float(o.probability), o.state, float(o.reward), o.ends])
    data = {
        "name": task.name, "horizon": _steps(task), "discount": float(task.discount), "states": task.states,
        "actions": task.actions, "initial": [float(p) for p in task.start], "P": P,
    }  # fmt: skip
    return (json.dumps(data) + "\n").encode()


def read_p(source: ForeignFile) -> FrozenTask:
    """Return the task of such a file; `P` alone, without other keys, starts in state 0."""
    try:
        data = json.loads(source.text())
    except (ValueError, RecursionError) as error:
        source.wrong(f"this is no JSON: {error}")
    if not isinstance(data, dict):
        source.wrong("this is no table `P` by state and action")
    return _of_p(source, data.get("P", data), data if "P" in data else {})


def read_environment(name: str) -> FrozenTask:
    """Return the task of an environment of Gymnasium that has a table `P`.

    Args:
        name: an id, such as `FrozenLake-v1`.

    Raises:
        SpecError: E701 for one that cannot be made, E728 for one without `P`.
    """
    import gymnasium

    try:
        env = gymnasium.make(name)
    except Exception as error:  # the code of the environment is not ours
        raise spec_error("E701", f"there is no file '{name}', and no such environment: {error}") from error
    inner: Any = env.unwrapped
    source = ForeignFile(name, b"")
    if not isinstance(getattr(inner, "P", None), Mapping):
        source.wrong("the environment has no table `P`")
    start = getattr(inner, "initial_state_distrib", None)
    other = {
        "initial": None if start is None else np.asarray(start).tolist(),
        "horizon": env.spec.max_episode_steps if env.spec is not None else None,
    }
    env.close()
    return _of_p(source, inner.P, other)


def _of_p(source: ForeignFile, P: Any, other: Mapping[str, Any]) -> FrozenTask:
    """Return the task of a table by state and action, keys being numbers or their texts."""
    try:
        by_state = {int(s): {int(a): list(outcomes) for a, outcomes in row.items()} for s, row in P.items()}
        rows: list[Row] = []
        for s in range(len(by_state)):
            row = {}
            for a, outcomes in sorted(by_state[s].items()):
                row[str(a)] = [FrozenOutcome(float(p), int(to), float(r), bool(ends)) for p, to, r, ends in outcomes]
            rows.append(row)
        initial = other.get("initial") or [1.0]
        start = {s: float(p) for s, p in enumerate(initial)}
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError):
        source.wrong("this is no table `P[state][action]` of lists [probability, next state, reward, terminated]")
    return assembled(source, start, rows, **_rest(other))


def _rest(other: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of tables among other data, those that make sense."""
    horizon = other.get("horizon")
    discount = other.get("discount")
    found: dict[str, Any] = {}
    if isinstance(horizon, int) and not isinstance(horizon, bool) and horizon > 0:
        found["horizon"] = horizon
    if isinstance(discount, float) and 0 <= discount <= 1:
        found["discount"] = discount
    return found


def _steps(task: FrozenTask) -> int | None:
    return task.horizon if task.last is None else task.last + 1


# -- NumPy ------------------------------------------------------------------------------------------------------------


def write_npz(task: FrozenTask) -> bytes:
    """Return arrays: of outcomes (`COLUMNS`), `start`, `states`, `actions`, `horizon` (0: none), `discount`, and labels."""
    columns: list[list[Any]] = [[] for _ in COLUMNS]
    for s, a, o in task.steps():
        for column, value in zip(columns, (s, a, o.state, float(o.probability), float(o.reward), o.ends), strict=True):
            column.append(value)
    arrays: dict[str, Any] = {}
    for (name, kind), column in zip(COLUMNS.items(), columns, strict=True):
        arrays[name] = np.array(column, kind)
    for component in task.values[0] if task.values else ():
        arrays[f"component_{component}"] = np.array([row[component] for row in task.values])
    for name, held in task.labels.items():
        arrays[f"label_{name}"] = np.array([s in held for s in range(len(task.states))])
    result = io.BytesIO()
    np.savez_compressed(
        result, start=np.array([float(p) for p in task.start]), states=np.array(task.states), actions=np.array(task.actions),
        horizon=np.array(_steps(task) or 0), discount=np.array(float(task.discount)), **arrays,
    )  # fmt: skip
    return result.getvalue()


def read_npz(source: ForeignFile) -> FrozenTask:
    """Return the task of such arrays; nothing in them is executed."""
    arrays = _loaded(source)
    columns = []
    for name, kind in COLUMNS.items():
        column = arrays.get(name)
        if column is None or column.ndim != 1 or not np.can_cast(column.dtype, kind, "same_kind"):
            source.wrong(f"the array `{name}` is missing, or has other numbers than are expected")
        columns.append(column.astype(kind).tolist())
    if len({len(column) for column in columns}) > 1:
        source.wrong("the arrays of outcomes have different lengths")
    start = arrays.get("start")
    if start is None or start.ndim != 1 or start.dtype.kind != "f":
        source.wrong("the array `start` is missing, or has no floats")
    rows: list[dict[str, list[FrozenOutcome]]] = [{} for _ in start]
    names = [str(name) for name in arrays.get("actions", np.array([])).reshape(-1)]
    for s, a, to, probability, reward, ends in zip(*columns, strict=True):
        if not 0 <= s < len(rows) or a < 0:
            source.wrong(f"there is no state {s}, or no action {a}")
        name = names[a] if a < len(names) else f"a{a}"
        rows[s].setdefault(name, []).append(FrozenOutcome(probability, to, reward, ends))
    other: dict[str, Any] = {}
    for key in ("horizon", "discount"):
        if key in arrays and arrays[key].size == 1:
            other[key] = arrays[key].reshape(-1)[0].item()
    return assembled(source, dict(enumerate(start.tolist())), rows, **_rest(other))


def _loaded(source: ForeignFile) -> dict[str, Any]:
    try:
        with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
            if sum(member.file_size for member in archive.infolist()) > MOST_BYTES:
                source.wrong(f"unpacked, it has more than {MOST_BYTES:,} bytes")
        with np.load(io.BytesIO(source.content), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, NotImplementedError, MemoryError) as error:
        source.wrong(f"these are no arrays of NumPy: {error}")
