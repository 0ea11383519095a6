"""A task that separates two learners, as text on the terminal, as a spec and as JSON data."""

from __future__ import annotations

from typing import Any

from taskspec.base.display import fixed, interval
from taskspec.show.terminal.styled_text import console, line
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.spec_text import spec_text
from taskspec.tools.separation.separate import Separation, finding


def print_separation(separation: Separation) -> None:
    """Print the scores of both learners, and how the task was obtained."""
    worse = separation.worse
    better = separation.better
    out = console()
    out.print(line((worse, "bad"), " is worse than ", (better, "good"), f": {separation.path[-1]}"))
    width = max(len(worse), len(better))
    for name, (mean, low, high) in zip((worse, better), separation.intervals, strict=True):
        out.print(line(f"  {name:{width}}  {fixed(mean, 2):>5}  {interval(low, high)}"))
    seeds = f"{len(separation.scores[0])} fresh seeds, p = {separation.p_value:.2g}"
    out.print(line((f"  {seeds}; {separation.tried} tasks tried", "quiet")))
    if len(separation.path) > 1:
        out.print(line((f"  shrunk from {separation.path[0]}", "quiet")))
    if not separation.is_complete:
        out.print(line(("  the search was stopped before it ended", "quiet")))


def spec_of(separation: Separation, family: str) -> str | None:
    """Write the task as a spec of tables; None for an instance that has none."""
    if isinstance(separation.task, FrozenTask):
        return spec_text(finding(separation, family))
    return None


def record(separation: Separation) -> dict[str, Any]:
    """Write a separation as JSON data; its task as a spec, or by its id."""
    names = ("worse", "better", "scores", "p_value", "tried", "path", "is_complete")
    data: dict[str, Any] = {name: getattr(separation, name) for name in names}
    data["means"] = []
    if separation.worse:
        data["means"] = [{"mean": mean, "low": low, "high": high} for mean, low, high in separation.intervals]
    data["task"] = None
    if isinstance(separation.task, FrozenTask):
        data["task"] = spec_text(separation.task)
    elif separation.task is not None:
        data["task"] = separation.task.id
    return data
