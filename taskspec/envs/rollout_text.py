"""Results of roll-outs, as text on the terminal and as data."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from typing import Any

from taskspec.base.columns import Columns
from taskspec.base.display import decimal, estimate
from taskspec.base.terminal import VisibleText, console, line
from taskspec.envs.rollouts import ENDINGS, Episode, Summary
from taskspec.language.task.record import settings
from taskspec.language.task.task import Task


def print_summary(task: Task, policy: str, seed: int, summary: Summary) -> None:
    """Print how a policy did: return with its interval, lengths, and how episodes ended."""
    out = console()
    given = f" {settings(task)}".rstrip()
    if "." in policy:
        who = policy
    else:
        who = f"{policy} policy"
    out.print(line((task.id, "name"), (given, "value"), (f"  {who}, seed {seed}", "quiet")))
    table = Columns("", "", styles=("quiet",), fold=(1,))
    table.add_row("  return", _mean(summary))
    if summary.deviation > 0:
        spread = f"{decimal(summary.lowest)} to {decimal(summary.highest)}, standard deviation {summary.deviation:.3g}"
        table.add_row("", VisibleText(spread, style="quiet"))
    if task.discount != 1:
        plain = f"discounted by {task.discount:g} a step; {decimal(summary.undiscounted)} without"
        table.add_row("", VisibleText(plain, style="quiet"))
    table.add_row("  length", f"{decimal(summary.length, 2)} steps")
    endings = Counter(summary.endings).most_common()
    table.add_row("  episodes", ", ".join(f"{n:,} {ENDINGS[key]}" for key, n in endings))
    out.print(table)


def _mean(summary: Summary) -> Any:
    if summary.half is None or summary.deviation == 0:
        every = "  in every episode" * (summary.episodes > 1)
        return line((decimal(summary.mean), "title"), (every, "quiet"))
    mean, half = estimate(summary.mean, summary.half)
    low = estimate(summary.mean - summary.half, summary.half)[0]
    high = estimate(summary.mean + summary.half, summary.half)[0]
    return line((mean, "title"), f" ± {half}", (f"   95 % CI: {low} to {high}", "quiet"))


def summary_data(task: Task, policy: str, seed: int, summary: Summary, done: Sequence[Episode]) -> dict[str, Any]:
    """Return how a policy did as plain data, with every return."""
    found = dataclasses.asdict(summary)
    half = found.pop("half")
    interval = None
    if half is not None:
        interval = [summary.mean - half, summary.mean + half]
    return {
        "id": task.id, "parameters": task.values, "modifiers": list(map(str, task.modifiers)), "policy": policy, "seed": seed,
        "content_hash": task.content_hash, **found, "confidence_95": interval, "returns": [each.total for each in done],
    }  # fmt: skip
