"""Data in files: NumPy's npz, Parquet, and the data sets of imitation and Minari; every array is checked when it is read."""

from __future__ import annotations

import json
import math
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn
from zipfile import BadZipFile, is_zipfile

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import spec_error, suggest
from taskspec.base.display import plural
from taskspec.base.extras import need
from taskspec.base.files import whole, whole_folder
from taskspec.base.named import entries_by_name
from taskspec.envs.making import made_by
from taskspec.exact.model.model import misused
from taskspec.learn.data.episodes import COLUMNS, Demonstrations, Transitions, columns
from taskspec.learn.data.preferences import Preferences

REAL = (np.dtype(np.float64),)
BOOL = (np.dtype(np.bool_),)
WHOLE = (np.dtype(np.int64),)
SPACE = (np.dtype(np.int64), np.dtype(np.float32))  # the types of observations and of actions


def check_transitions(data: Transitions, is_whole: bool) -> None:
    """Check the arrays of whole episodes, or of segments: runs of steps that only the last may end."""
    rows = len(data.rews) if np.ndim(data.rews) else 0
    if not rows:
        raise ValueError("it has no transitions")
    for name, types in {"rews": REAL, "terminated": BOOL, "truncated": BOOL, "episode": WHOLE, "time": WHOLE}.items():
        _check(name, getattr(data, name), types, (rows,))
    before = _parts("obs", data.obs)
    after = _parts("next_obs", data.next_obs)
    if [name.removeprefix("next_") for name in after] != list(before):
        raise ValueError(f"observations are {', '.join(before)} before a step and {', '.join(after)} after it")
    for name, part in {"acts": data.acts, **before}.items():
        _check(name, part, SPACE, (rows, *np.shape(part)[1:]))
    for (name, part), old in zip(after.items(), before.values(), strict=True):
        _check(name, part, (old.dtype,), old.shape)
    goes_on = np.append(np.diff(data.episode) == 0, False)
    is_first = np.append(True, ~goes_on[:-1])
    begins_late = data.time < 0
    if is_whole:
        begins_late = data.time != 0
    wrong = {
        "rews": ~np.isfinite(data.rews),
        "episode": (data.episode < 0) | (np.diff(data.episode, prepend=0) < 0),
        "time": np.where(is_first, begins_late, np.diff(data.time, prepend=0) != 1),
        "dones": (data.dones & goes_on) | (is_whole & ~data.dones & ~goes_on),
    }
    for name, is_wrong in wrong.items():
        if is_wrong.any():
            row = int(np.argmax(is_wrong))
            raise ValueError(f"`{name}` cannot be {getattr(data, name)[row]} in row {row}")


def check_pairs(segments: Transitions, preferences: Array, returns: Array, queries: Array) -> None:
    pairs = len(preferences) if np.ndim(preferences) else 0
    if not np.array_equal(segments.episode[segments.starts], np.arange(2 * pairs)):
        raise ValueError(f"`episode` does not number the segments of {pairs} pairs from 0 to {2 * pairs - 1}")
    _check("preferences", preferences, REAL, (pairs,))
    _check("returns", returns, REAL, (pairs, 2))
    _check("queries", queries, WHOLE, (pairs,))
    if not (((preferences >= 0) & (preferences <= 1)).all() and np.isfinite(returns).all()):
        raise ValueError("`preferences` are not all between 0 and 1, or `returns` not all finite")


def _parts(name: str, seen: Any) -> dict[str, Array]:
    if isinstance(seen, dict):
        return {f"{name}.{key}": seen[key] for key in sorted(seen)}
    return {name: seen}


def _check(name: str, value: Any, types: tuple[np.dtype[Any], ...], shape: tuple[int, ...]) -> None:
    if not isinstance(value, np.ndarray) or value.dtype not in types or value.shape != shape:
        raise ValueError(f"`{name}` is not an array of {' or '.join(map(str, types))} with the shape {shape}")


KEY = b"taskspec"


def write_table(
    path: Path, columns: Mapping[str, Array | Sequence[Any]], metadata: Mapping[str, Any] | None = None
) -> None:
    """Write columns: arrays (N, *shape), or N values of one type, None where there is none."""
    arrow = need("pyarrow", "parquet", "Parquet")
    parquet = need("pyarrow.parquet", "parquet", "Parquet")
    held = {}
    for name, values in columns.items():
        if np.ndim(values) > 1:
            flat_values = arrow.array(np.ravel(values))
            held[name] = arrow.FixedSizeListArray.from_arrays(flat_values, math.prod(np.shape(values)[1:]))
        else:
            held[name] = arrow.array(values)
    table = arrow.table(held)
    kept = None
    if metadata is not None:
        kept = {KEY: json.dumps(metadata)}
    parquet.write_table(table.replace_schema_metadata(kept), path)


def read_table(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return columns (N, *shape) and metadata; its `shapes` are those of the values."""
    parquet = need("pyarrow.parquet", "parquet", "Parquet")
    table = parquet.read_table(path)
    metadata = json.loads((table.schema.metadata or {})[KEY])
    shapes = metadata.pop("shapes")
    columns_read = {}
    for name in table.column_names:
        column = table[name].combine_chunks()
        values = column.flatten() if shapes[name] else column
        columns_read[name] = values.to_numpy(zero_copy_only=False).reshape(len(table), *shapes[name])
    return columns_read, metadata


Data = Demonstrations | Preferences
MARK = "taskspec.json"  # the file of a dataset's folder that holds the metadata
_NAME = re.compile(r"[-_\w]*\w-v\d+")  # names of datasets that Minari accepts


@dataclass(frozen=True, slots=True)
class Format:
    """A way to keep data. `suffix` of its files; "" where it is a folder, which holds demonstrations alone.

    `write` takes a path, the data, and the final name of the file or folder.
    """

    name: str
    suffix: str
    doc: str
    write: Callable[[Path, Any, str], None]


def _write_minari(folder: Path, data: Demonstrations, name: str) -> None:
    if not _NAME.fullmatch(name):
        misused(f"Minari cannot call a dataset '{name}'", "end the folder's name in a version: expert-v0")
    if data.task is None:
        misused("Minari stores what `demonstrations` gives, not what was read", "write both at once")
    storage = need("minari.dataset.minari_storage", "minari", "this format").MinariStorage
    for package in ("h5py", "PIL"):  # which Minari imports when it writes
        need(package, "minari", "this format")
    buffer = need("minari.data_collector").EpisodeBuffer
    told = data.metadata
    made = storage.new(
        folder / "data", observation_space=data.task.observation_space, action_space=data.task.action_space,
        env_spec=made_by(data.task), data_format="hdf5",
    )  # fmt: skip
    made.update_metadata({
        "dataset_id": name, "algorithm_name": told["policy"], "minari_version": need("minari").__version__,
        "description": f"{told['id']}, policy {told['policy']}, seed {told['seed']}", "taskspec": dict(told),
    })  # fmt: skip
    episodes = []
    for i, t in enumerate(data.trajectories):
        terminated, truncated = ([False] * (len(t) - 1) + [over] for over in (t.terminated, t.truncated))
        episodes.append(buffer(
            id=i, seed=told["seed"] + i, observations=t.obs, actions=t.acts, rewards=t.rews, terminations=terminated,
            truncations=truncated, infos={},
        ))  # fmt: skip
    made.update_episodes(episodes)


def _write_npz(path: Path, data: Data, name: str) -> None:
    with path.open("wb") as file:
        held: dict[str, Any] = {**flat(data), "metadata": np.array(json.dumps(data.metadata))}
        np.savez_compressed(file, **held)


def _read_npz(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    if not is_zipfile(path):
        raise ValueError("it is no npz file")
    with path.open("rb") as file, np.load(file, allow_pickle=False) as held:
        arrays = dict(held)
    return arrays, json.loads(str(arrays.pop("metadata")))


def _write_imitation(folder: Path, data: Demonstrations, name: str) -> None:
    if isinstance(data.obs, dict):
        misused("imitation does not store observations that are dicts", "`--format npz`")
    need("imitation.data.serialize", "imitation", "this format").save(folder, data.imitation())


def _write_parquet(path: Path, data: Data, name: str) -> None:
    table = flat(data)
    if isinstance(data, Preferences):  # a row for each transition
        pair, second = np.divmod(data.segments.episode, 2)
        table["returns"] = table["returns"][pair, second]
        table |= {name: table[name][pair] for name in ("preferences", "queries")}
        table = {PAIRS.get(name, name): value for name, value in table.items()}
    write_table(path, table, {**data.metadata, "shapes": {name: value.shape[1:] for name, value in table.items()}})


FORMATS = entries_by_name((
    Format("npz", ".npz", "arrays of NumPy", _write_npz),
    Format("parquet", ".parquet", "a table, a row for each transition", _write_parquet),
    Format("imitation", "", "a folder, for `imitation.data.serialize.load`", _write_imitation),
    Format("minari", "", "a folder, for `minari.MinariDataset`", _write_minari),
))  # fmt: skip


def write(data: Data, path: str | PathLike[str], format: str | None = None) -> None:
    """Keep data in a file, or in a folder.

    Args:
        path: where. What is there is replaced; a folder only if it holds such data.
        format: "npz", "parquet", "imitation" or "minari"; None goes by the suffix of the path.

    Raises:
        SpecError: E705 where a package is not installed, E726 for a format that there is not, E716 where it cannot be written.
    """
    place = Path(path)
    kind = format_of(place, format)
    if kind.suffix:
        with whole(place) as unfinished:
            kind.write(unfinished, data, place.name)
        return
    if isinstance(data, Preferences):
        misused(f"{kind.name} does not store preferences", "`--format npz` or `--format parquet`")
    with whole_folder(place, MARK) as folder:
        kind.write(folder, data, place.name)
        (folder / MARK).write_text(json.dumps(data.metadata, indent=2) + "\n", encoding="utf-8")


def format_of(path: Path, name: str | None = None) -> Format:
    """Return the format of a name, or of the suffix of a path."""
    if name is not None and name not in FORMATS:
        raise spec_error("E726", f"there is no format '{name}'", suggest(name, FORMATS) or ", ".join(FORMATS))
    form = FORMATS.get(name or "")
    for known in FORMATS.values():
        if form is None and path.suffix and known.suffix == path.suffix:
            form = known
    if form is None:
        raise spec_error("E726", f"'{path}' does not say in which format to write", f"--format {' | '.join(FORMATS)}")
    if form.suffix and path.suffix != form.suffix:
        raise spec_error("E726", f"'{path}' is not a {form.suffix} file", f"{path.with_suffix(form.suffix)}")
    return form


def read(path: str | PathLike[str]) -> Data:
    """Read demonstrations or preferences from an npz or a Parquet file.

    Args:
        path: of the file.

    Returns:
        the data, with its arrays checked.

    Raises:
        SpecError: E705 where a package is not installed, E710 or E711 where there is no such file, or it holds no such data.
    """
    place = Path(path)
    if not place.is_file():
        raise spec_error("E710", f"there is no file '{place}'")
    read_arrays = read_table if place.suffix == ".parquet" else _read_npz
    try:
        return _data(*read_arrays(place))
    except KeyError as error:
        _unreadable(place, f"it has no `{error.args[0]}`")
    except (OSError, EOFError, ValueError, TypeError, BadZipFile, zlib.error) as error:
        _unreadable(place, str(error))


def _unreadable(place: Path, reason: str) -> NoReturn:
    message = f"'{place}' contains neither demonstrations nor preferences: {reason}"
    raise spec_error("E711", message) from None


PAIRS = {"preferences": "preference", "returns": "return", "queries": "query"}
"""Arrays of preferences with an entry for each pair, and their names in a table."""


def flat(data: Data) -> dict[str, Array]:
    """Return the arrays of data by name; those of a dict of observations are `obs.NAME`."""
    segments = data.segments if isinstance(data, Preferences) else data
    arrays: dict[str, Array] = {}
    for name, value in columns(segments).items():
        arrays |= _parts(name, value)
    if isinstance(data, Preferences):
        for name in PAIRS:
            arrays[name] = getattr(data, name)
    return arrays


def _data(arrays: Mapping[str, Any], metadata: dict[str, Any]) -> Data:
    transitions = Transitions(**{name: _nested(arrays, name) for name in COLUMNS})
    is_whole = metadata["kind"] == "demonstrations"
    check_transitions(transitions, is_whole)
    if is_whole:
        return Demonstrations(**columns(transitions), metadata=metadata)
    if "preference" in arrays:
        first = transitions.starts
        per_pair = {"preferences": arrays["preference"][first][::2], "queries": arrays["query"][first][::2],
                    "returns": arrays["return"][first].reshape(-1, 2)}  # fmt: skip
    else:
        per_pair = {name: arrays[name] for name in PAIRS}
    check_pairs(transitions, **per_pair)
    return Preferences(transitions, **per_pair, metadata=metadata)


def _nested(arrays: Mapping[str, Any], name: str) -> Any:
    if name in arrays:
        return arrays[name]
    parts = {}
    for key, value in arrays.items():
        if key.startswith(f"{name}."):
            parts[key.removeprefix(f"{name}.")] = value
    if not parts:
        raise KeyError(name)
    return parts


def summary(metadata: Mapping[str, Any]) -> str:
    """Describe data in a few words: how much there is, and its policy or teacher."""
    if metadata["kind"] == "demonstrations":
        words = f"{metadata['transitions']:,} transitions of {metadata['episodes']:,} episodes"
        if metadata["return"] is not None:
            words += f"; the policy earns {metadata['return']['value']:.6g} ({metadata['return']['status']})"
        return words
    length = metadata["length"]
    parts = "whole episodes"
    if length is not None:
        shortest, longest = metadata["steps"]
        if longest < length:
            parts = f"whole episodes, which have fewer than {length} steps"
        elif shortest < length:
            parts = f"segments of {shortest} to {length} steps"
        else:
            parts = f"segments of {plural(length, 'step')}"
    words = f"{metadata['shown'] - metadata['skipped']:,} pairs of {parts}"
    if metadata["skipped"]:
        words += f", {metadata['skipped']:,} skipped"
    return f"{words}; teacher: {metadata['teacher']}"
