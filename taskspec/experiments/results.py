"""What a sweep found: a row for each instance, and the files that hold them."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

from taskspec.base.files import whole, write_text
from taskspec.data.files import write_table
from taskspec.experiments.instances import Instance
from taskspec.experiments.measure import COLUMNS


@dataclass(frozen=True)
class Measured:
    """One instance with what was measured; `error` is why nothing was (None: all is well).

    `values` are the numbers by name; `policies` those of roll-outs by name of the policy.
    """

    instance: Instance
    status: str
    values: Mapping[str, Any] = field(default_factory=dict)
    policies: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    error: str | None = None
    seconds: float = 0.0

    def record(self) -> dict[str, Any]:
        """As plain data for JSON; what is not known is None."""
        about = {
            "id": self.instance.id, "task": self.instance.task, "parameters": dict(self.instance.parameters),
            "modifiers": list(self.instance.modifiers), "status": self.status, "error": self.error, "seconds": self.seconds,
        }  # fmt: skip
        return {
            **about,
            **dict.fromkeys(COLUMNS),
            **self.values,
            "policies": {k: dict(v) for k, v in self.policies.items()},
        }

    def flat(self) -> dict[str, Any]:
        """The same with one value in each column: `parameters.L`, `policies.random.mean`."""
        found: dict[str, Any] = {}
        for name, value in self.record().items():
            if isinstance(value, Mapping):
                found |= {f"{name}.{key}": each for key, each in _flat(value)}
            else:
                found[name] = "+".join(value) if isinstance(value, list) else value
        return found


def _flat(values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from ((f"{name}.{key}", each) for key, each in _flat(value))
        else:
            yield name, value


def table(rows: Sequence[Measured]) -> tuple[list[str], list[list[Any]]]:
    """Names of columns, and the values of every row; None where a row has none."""
    flat = [row.flat() for row in rows]
    names = sorted(dict.fromkeys(name for each in flat for name in each), key=_rank)
    return names, [[each.get(name) for name in names] for each in flat]


def _rank(name: str) -> int:
    """What an instance is comes first, with all its parameters."""
    return 0 if name in ("id", "task") else 1 if name.startswith("parameters.") else 2


def write_json(rows: Sequence[Measured], path: Path) -> None:
    """A list of one object for each instance."""
    write_text(path, json.dumps([_finite(row.record()) for row in rows], indent=1) + "\n")


def _finite(value: Any) -> Any:
    """Data as JSON can hold it: infinities become text."""
    match value:
        case dict():
            return {key: _finite(each) for key, each in value.items()}
        case list():
            return [_finite(each) for each in value]
        case float() if not math.isfinite(value):
            return str(value)
    return value


def write_csv(rows: Sequence[Measured], path: Path) -> None:
    """A line for each instance, under names of columns."""
    names, values = table(rows)
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(values)
    write_text(path, text.getvalue())


def write_parquet(rows: Sequence[Measured], path: Path) -> None:
    """The same columns in Parquet.

    Raises:
        SpecError: E705 without pyarrow.
    """
    names, values = table(rows)
    with whole(path) as unfinished:
        write_table(unfinished, {name: _of_one_type([row[i] for row in values]) for i, name in enumerate(names)})


def _of_one_type(values: Sequence[Any]) -> list[Any]:
    """Values of a column as texts, where they are of several types."""
    kinds = {
        bool if isinstance(v, bool) else float if isinstance(v, int | float) else str for v in values if v is not None
    }
    return list(values) if len(kinds) < 2 else [None if v is None else str(v) for v in values]


WRITERS = {"json": write_json, "csv": write_csv, "parquet": write_parquet}
"""Formats of tables by name, which is the suffix of their files, too."""
