"""Tables in Parquet: arrays as lists of fixed length, metadata under the key `taskspec`; pyarrow is imported here."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.extras import need

Array = np.ndarray[Any, Any]
KEY = b"taskspec"


def write_table(
    path: Path, columns: Mapping[str, Array | Sequence[Any]], metadata: Mapping[str, Any] | None = None
) -> None:
    """Write columns: arrays (N, *shape), or N values of one type, None where there is none.

    Raises:
        SpecError: E705 where pyarrow is not installed.
    """
    arrow, parquet = need("pyarrow", "parquet", "Parquet"), need("pyarrow.parquet", "parquet", "Parquet")
    table = arrow.table({name: _column(arrow, values) for name, values in columns.items()})
    kept = None if metadata is None else {KEY: json.dumps(metadata)}
    parquet.write_table(table.replace_schema_metadata(kept), path)


def read_table(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Columns (N, *shape) and metadata, of which `shapes` says what each value was.

    Raises:
        SpecError: E705 where pyarrow is not installed.
        ValueError, KeyError: where the file is none of ours.
    """
    parquet = need("pyarrow.parquet", "parquet", "Parquet")
    table = parquet.read_table(path)
    metadata = json.loads((table.schema.metadata or {})[KEY])
    shapes = metadata.pop("shapes")
    found = {}
    for name in table.column_names:
        column = table[name].combine_chunks()
        values = column.flatten() if shapes[name] else column
        found[name] = values.to_numpy(zero_copy_only=False).reshape(len(table), *shapes[name])
    return found, metadata


def _column(arrow: Any, values: Array | Sequence[Any]) -> Any:
    if not isinstance(values, np.ndarray) or values.ndim == 1:
        return arrow.array(values)
    return arrow.FixedSizeListArray.from_arrays(arrow.array(values.reshape(-1)), math.prod(values.shape[1:]))
