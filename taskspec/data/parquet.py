"""Tables in Parquet: a row for each transition, arrays as lists of fixed length, metadata under the key `taskspec`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.extras import need

Array = np.ndarray[Any, Any]
KEY = b"taskspec"


def write_parquet(
    path: Path, table: Mapping[str, Array], shapes: Mapping[str, Any], metadata: Mapping[str, Any]
) -> None:
    """Write columns (N, *shape); `shapes` is kept beside the metadata.

    Raises:
        SpecError: E705 where pyarrow is not installed.
    """
    arrow, parquet = need("pyarrow", "parquet", "Parquet"), need("pyarrow.parquet", "parquet", "Parquet")
    columns = {name: _column(arrow, values) for name, values in table.items()}
    told = json.dumps({**metadata, "shapes": shapes})
    parquet.write_table(arrow.table(columns).replace_schema_metadata({KEY: told}), path)


def read_parquet(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Columns (N, *shape) and metadata.

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


def _column(arrow: Any, values: Array) -> Any:
    if values.ndim == 1:
        return arrow.array(values)
    return arrow.FixedSizeListArray.from_arrays(arrow.array(values.reshape(-1)), math.prod(values.shape[1:]))
