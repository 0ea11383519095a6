"""Tables of Python users: Gymnasium's `P` as JSON or from an environment, and arrays of NumPy."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from taskspec.base.diagnostics import spec_error
from taskspec.exact.solve.outcomes import Outcome
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.reading import MOST_BYTES, Contents, ForeignFile, Row, assembled, guarded

COLUMNS = {
    "state": "<i8",
    "action": "<i8",
    "next_state": "<i8",
    "probability": "<f8",
    "reward": "<f8",
    "terminated": "?",
}
"""Arrays with an entry for each outcome, and their types."""


def write_p(task: FrozenTask) -> bytes:
    """Return JSON: under `P` lists `[probability, next state, reward, terminated]` by state and action.

    Numbers are floats, and keys strings. `initial` is the start distribution, as toy_text's `initial_state_distrib` is, and
    `observations` has what is observed in each state, where that is not the state.
    """
    P: dict[str, dict[str, list[list[Any]]]] = {}
    for s, a, o in task.steps():
        row = P.setdefault(str(s), {}).setdefault(str(a), [])
        row.append([float(o.probability), o.state, float(o.reward), o.ends])
    data: dict[str, Any] = {
        "name": task.name, "horizon": task.steps_in_episode, "discount": float(task.discount), "states": task.states,
        "actions": task.actions, "initial": np.array(task.start, np.float64).tolist(), "P": P,
    }  # fmt: skip
    if task.labels:
        data["labels"] = {name: sorted(held) for name, held in task.labels.items()}
    if task.seen is not None:
        data["observations"] = task.seen
    return (json.dumps(data) + "\n").encode()


def read_p(source: ForeignFile) -> FrozenTask:
    """Return the task of such a file; `P` alone, without other keys, starts in state 0."""
    data = json.loads(source.text())
    if "P" not in data:
        return _of_p(source, data, {})
    return _of_p(source, data.pop("P"), data)


def read_environment(name: str) -> FrozenTask:
    """Return the task of an environment of Gymnasium that has a table `P`.

    Raises:
        SpecError: E701 for one that cannot be made, E728 for one without `P`, or whose observations are not its states.
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
    if getattr(env.observation_space, "n", None) != len(inner.P):
        source.wrong(f"its observations are {env.observation_space}, not the {len(inner.P)} states of its table `P`")
    other: dict[str, Any] = {}
    start = getattr(inner, "initial_state_distrib", None)
    if start is not None:
        other["initial"] = np.asarray(start).tolist()
    if env.spec is not None:
        other["horizon"] = env.spec.max_episode_steps
    env.close()
    return guarded(lambda source: _of_p(source, inner.P, other))(source)


def _of_p(source: ForeignFile, P: Any, other: dict[str, Any]) -> FrozenTask:
    """Return the task of a table by state and action, keys being numbers or their texts; other keys are taken out."""
    by_state = _by_number(P)
    names = list(other.pop("actions", ()))
    rows: list[Row] = []
    for s in range(len(by_state)):
        row: dict[str, list[Outcome]] = {}
        for a, listed in sorted(_by_number(by_state[s]).items()):
            outcomes = []
            for p, to, r, ends in listed:
                outcomes.append(Outcome(float(p), int(to), float(r), bool(ends)))
            row[_action(source, names, a)] = outcomes
        rows.append(row)
    seen = other.pop("observations", None)
    if seen is not None:
        seen = tuple(tuple(map(float, row)) for row in seen)
    other.pop("name", None)
    start = {s: float(p) for s, p in enumerate(other.pop("initial", None) or [1.0])}
    states = other.pop("states", ())
    horizon = other.pop("horizon", None)
    discount = other.pop("discount", 1.0)
    return assembled(source, Contents(start, rows, states, horizon, discount, seen, lost=tuple(other)))


def _by_number(entries: Mapping[Any, Any]) -> dict[int, Any]:
    return {int(key): entry for key, entry in entries.items()}


def _action(source: ForeignFile, names: list[Any], a: int) -> str:
    if not names and a >= 0:
        return str(a)
    if not 0 <= a < len(names):
        source.wrong(f"there is an action {a}, and {len(names)} names of actions")
    return str(names[a])


def write_npz(task: FrozenTask) -> bytes:
    """Return arrays: of outcomes (`COLUMNS`), `start`, `states`, `actions`, `horizon` (0: none), `discount`, and labels.

    `observations` (S, N) has what is observed in each state, where that is not the state.
    """
    outcomes = []
    for s, a, o in task.steps():
        outcomes.append((s, a, o.state, float(o.probability), float(o.reward), o.ends))
    arrays: dict[str, Any] = {}
    for (name, kind), column in zip(COLUMNS.items(), zip(*outcomes, strict=True), strict=True):
        arrays[name] = np.array(column, kind)
    if task.values:
        for component in task.values[0]:
            arrays[f"component_{component}"] = np.array([row[component] for row in task.values])
    for name, held in task.labels.items():
        arrays[f"label_{name}"] = np.isin(range(len(task.states)), list(held))
    if task.seen is not None:
        arrays["observations"] = np.array(task.seen, np.float64)
    result = io.BytesIO()
    np.savez_compressed(
        result, start=np.array(task.start, np.float64), states=np.array(task.states), actions=np.array(task.actions),
        horizon=np.array(task.steps_in_episode or 0), discount=np.array(float(task.discount)), **arrays,
    )  # fmt: skip
    return result.getvalue()


def read_npz(source: ForeignFile) -> FrozenTask:
    """Return the task of such arrays; nothing in them is executed."""
    arrays = _loaded(source)
    columns = []
    for name, kind in COLUMNS.items():
        columns.append(arrays.pop(name).astype(kind, casting="same_kind").tolist())
    start = arrays.pop("start").astype(np.float64, casting="same_kind").tolist()
    rows: list[dict[str, list[Outcome]]] = [{} for _ in start]
    names = arrays.pop("actions").tolist()
    for s, a, to, probability, reward, ends in zip(*columns, strict=True):
        if not 0 <= s < len(rows):
            source.wrong(f"there is no state {s}")
        rows[s].setdefault(_action(source, names, a), []).append(Outcome(probability, to, reward, ends))
    seen = None
    if "observations" in arrays:
        seen = tuple(map(tuple, arrays.pop("observations").astype(np.float64, casting="same_kind").tolist()))
    states = arrays.pop("states").tolist()
    horizon = int(arrays.pop("horizon")) or None
    discount = float(arrays.pop("discount"))
    return assembled(
        source, Contents(dict(enumerate(start)), rows, states, horizon, discount, seen, lost=tuple(arrays))
    )


def _loaded(source: ForeignFile) -> dict[str, Any]:
    with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
        if sum(member.file_size for member in archive.infolist()) > MOST_BYTES:
            source.wrong(f"unpacked, it has more than {MOST_BYTES:,} bytes")
    with np.load(io.BytesIO(source.content), allow_pickle=False) as arrays:
        return dict(arrays)
