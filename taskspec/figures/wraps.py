"""Numbers that come round: an angle kept within its bounds by a remainder jumps by its period, and is drawn in pieces."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from taskspec.lang import interval
from taskspec.lang.ir import Apply, Node, Read, Role, walk
from taskspec.task.task import Task


def turn(task: Task, node: Node) -> float:
    """The largest step of a number that is drawn as a line: half the range of a component that a remainder keeps in it."""
    if isinstance(node, Read) and node.role is Role.STATE:
        later = next((after for c, after in zip(task.state, task.next, strict=True) if c.name == node.name), None)
        if later is not None and any(isinstance(x, Apply) and x.op == "mod" for x in walk([later])):
            low, high = interval.bounds(later, {})
            return (high - low) / 2 if math.isfinite(high - low) else math.inf
    return math.inf


def runs(points: Sequence[Sequence[float]], turns: Sequence[float]) -> Iterator[slice]:
    """Stretches of a path, each without a step of a coordinate that is more than its turn."""
    first = 0
    for i in range(1, len(points)):
        if any(abs(b - a) > most for a, b, most in zip(points[i - 1], points[i], turns, strict=True)):
            yield slice(first, i)
            first = i
    yield slice(first, len(points))
