"""Results of sweeps as a table on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taskspec.base.display import decimal, estimate
from taskspec.learn.experiments.sweeping import Measured
from taskspec.show.terminal.styled_text import Columns, VisibleText

MEASURES = ("solution_length", "best_at_random")
"""Measures in the table, where the experiment names none; files have all."""
MOST = 1000
"""Instances of which the table has a row; files have all."""


def measured_table(rows: Sequence[Measured], measures: Sequence[str] | None) -> Columns:
    """Return a row for each instance, the first `MOST`: sizes, returns, measures, roll-outs."""
    shown = rows[:MOST]
    if measures is None:
        measures = MEASURES
    chosen = [name for name in measures if name not in ("states", "actions")]
    policies = dict.fromkeys(name for row in shown for name in row.policies)
    headers = [name.replace("_", " ") for name in chosen] + [f"{name}, rolled out" for name in policies]
    numbers = range(1, 5 + len(headers))
    table = Columns("", "states", "optimal", "expert", "random", *headers, styles=("name",), right=numbers, names=0)
    for row in shown:
        if row.error is not None:
            table.add_row(row.instance.id, VisibleText(row.status.replace("_", " "), style="bad"))
            continue
        values = row.values
        cells = [f"{values['states']:,}" if values.get("states") is not None else ""]
        cells += [_number(values.get(name), values.get(f"{name}_half")) for name in ("optimal", "expert", "random")]
        cells += [_number(values.get(name)) for name in chosen]
        for name in policies:
            means = row.policies.get(name, {})
            cells.append(_number(means.get("mean"), means.get("half")))
        table.add_row(row.instance.id, *cells)
    if len(rows) > MOST:
        table.add_row(f"and {len(rows) - MOST:,} more")
    return table


def _number(value: Any, half: Any = None) -> str:
    if not isinstance(value, int | float):
        if value is None:
            return ""
        return str(value)
    if not half or half <= 1e-9 * abs(value):
        return decimal(value, 6)
    mean, width = estimate(value, half)
    return f"{mean} ± {width}"
