"""A check: one thing that must hold of a task at every point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.interval import ranges
from taskspec.lang.ir import Node
from taskspec.lang.ranges import INF, Interval, Range
from taskspec.lang.types import Kind
from taskspec.task.reach import over
from taskspec.task.task import Component

Array = np.ndarray[Any, Any]


@dataclass(frozen=True, eq=False)
class Check:
    """One thing that must hold at every point: `node` has a value within `low` and `high`, and is a number.

    `guards` are conditions; where one fails, nothing is asked. `subject` is what the value belongs
    to; `section` and `entry` say where its expression is.
    """

    code: str
    node: Node
    low: tuple[float, ...]
    high: tuple[float, ...]
    section: str
    entry: str | None = None
    subject: Component | None = None
    place: s.Expr | None = None
    guards: tuple[Node, ...] = ()
    what: str = ""

    def wrong(self, value: Array) -> Array:
        """Where a value (*shape, M) is not allowed: (M,)."""
        shape = self.node.type.shape
        axes = tuple(range(len(shape)))
        low = np.array(self.low if shape else self.low[0]).reshape(*shape, 1)
        high = np.array(self.high if shape else self.high[0]).reshape(*shape, 1)
        if self.node.type.kind is not Kind.REAL:
            return np.asarray(((value < low) | (value > high)).any(axis=axes))
        slack = (1e-6 if self.code == "E401" else 1e-9) * (1 + np.abs(np.where(np.isfinite(value), value, 0)))
        inside = (value >= low - slack) & (value <= high + slack) & np.isfinite(value)
        return np.asarray((~inside).any(axis=axes))

    def is_proved(self, builder: Builder, reached: dict[str, Interval] | None = None) -> bool:
        """Whether bounds alone, by interval arithmetic, show that it holds everywhere, or as far as the state gets."""
        if reached is None:
            found = Range(*builder.bounds(self.node), builder.finite(self.node))
        else:
            found = ranges(self.node, over([self.node], reached))
        return found.finite and found.low >= max(self.low, default=-INF) and found.high <= min(self.high, default=INF)
