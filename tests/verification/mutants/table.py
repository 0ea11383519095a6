"""What became of the changes, as the tables of docs/explain/correctness.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from tests.verification.mutants.changes import Mutant

HEAD = (
    "| room | changes | sampled | killed | out of time | survived | of these listed below |",
    "|---|---|---|---|---|---|---|",
)


@cache
def equivalent() -> dict[str, str]:
    """By the key of a change why it changes nothing."""
    listed = yaml.safe_load(Path(__file__).with_name("equivalent.yaml").read_text())
    return {entry["change"]: entry["why"] for entry in listed}


def row(room: str, every: Sequence[Mutant], sampled: Sequence[Mutant], known: Mapping[str, Mapping[str, Any]]) -> str:
    """The line of a room."""
    became = {m.key: known[m.key]["became"] for m in sampled if m.key in known}
    survived = [key for key, what in became.items() if what == "survived"]
    counts = [list(became.values()).count(what) for what in ("killed", "timeout", "survived")]
    numbers = (len(every), len(became), *counts, sum(key in equivalent() for key in survived))
    return f"| `{room}` | {' | '.join(f'{n:,}' for n in numbers)} |"


def reasons() -> list[str]:
    """A line for each change that no test can notice."""
    return [
        "| where | change | why nothing notices |",
        "|---|---|---|",
        *(_reason(*entry) for entry in equivalent().items()),
    ]


def _reason(key: str, why: str) -> str:
    place, _, change = key.removeprefix("taskspec/").rpartition(" (")[0].partition(": ")
    file, _, inner = place.partition("::")
    before, _, after = change.partition(" => ")
    where = f"`{file}`, `{inner}`" if inner else f"`{file}`"
    return f"| {where} | `{_cell(before)}` → `{_cell(after)}` | {why} |"


def _cell(code: str) -> str:
    return code.replace("|", r"\|")
