"""Scores of exams as a table in Parquet: a row for each seed on each task."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from taskspec.data.parquet import write_table
from taskspec.files import whole

COLUMNS = (
    "task", "twin", "probe", "seed", "deterministic", "stochastic", "half", "return", "error", "steps", "demonstrations",
    "comparisons", "seconds", "starc", "reward_regret",
)  # fmt: skip
"""Of a score, as `exam.json` calls them; learning curves are left to it."""


def write_scores(exams: Mapping[str, Mapping[str, Any]], path: Path) -> Path:
    """Write the scores of exams, by the name of the learner, which is the first column.

    Raises:
        SpecError: E705 without pyarrow; E716, it cannot be written.
    """
    rows = [{"learner": name, **score} for name, exam in exams.items() for score in exam["scores"]]
    with whole(path) as place:
        write_table(place, {name: [row.get(name) for row in rows] for name in ("learner", *COLUMNS)})
    return path
