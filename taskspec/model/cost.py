"""What an analysis will take, worked out before it is begun, at nominal rates: the same on every machine."""

from __future__ import annotations

import math
from collections.abc import Iterable

from taskspec.base.limits import how_to_raise, limits
from taskspec.lang.ir import Const, Draw, Node, walk
from taskspec.lang.variates import VARIATES, words_of
from taskspec.model.model import refuse

RATE = 3e8
"""Operations on single numbers that NumPy gets through in a second."""
CALL = 1e-5
"""Seconds that an operation of NumPy takes, however few numbers there are."""
BYTES = 8
WORD = 5
SORTED = 60
PASS = 3
"""How many operations a random word is worth, and one of a draw that sorts them; and one that is gone through once more."""


class Cost:
    """The cost of evaluating nodes at many points at once: their operations, and the numbers in one point's results.

    Args:
        roots: the nodes.
        simulated: draws are sampled, instead of being gone through.
        beside: operations at each point beside those of the nodes.
    """

    def __init__(self, roots: Iterable[Node], simulated: bool = False, beside: int = 0) -> None:
        nodes = [node for node in walk(roots) if not isinstance(node, Const)]
        sizes = [node.type.size for node in nodes]
        self.calls = max(1, len(sizes))
        self.numbers = max(1, sum(sizes) + beside)
        if simulated:
            drawn = [node for node in nodes if isinstance(node, Draw)]
            self.numbers += sum(words_of(draw) * _operations(draw) for draw in drawn)
            self.calls += sum(PASS * _more_passes(draw) for draw in drawn)

    def seconds(self, points: float, batches: float = 1) -> float:
        """Return how long so many points take, in so many batches."""
        return points * self.numbers / RATE + batches * self.calls * CALL

    def affordable(self) -> int:
        """Return how many points there may be in the time that an analysis has."""
        return int(limits().seconds * RATE / self.numbers)

    def batch(self, most: float) -> int:
        """Return how many points, of at most so many, fit into memory at once."""
        return max(1, int(min(most, limits().megabytes * 1e6 / (BYTES * self.numbers))))


def _operations(draw: Draw) -> int:
    """Return what sampling takes for each word of a draw."""
    return (SORTED if VARIATES[draw.base].sorts else WORD) + PASS * _more_passes(draw)


def _more_passes(draw: Draw) -> int:
    return VARIATES[draw.base].passes(draw) - 1


class Budget:
    """The time of an analysis whose length only shows as it goes on.

    `what` takes more than that time, says the message.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        self.spent = 0.0
        self.most = limits().seconds

    def spend(self, cost: Cost, points: float, beside: float = 0.0) -> None:
        """Begin a batch of so many points, with so many seconds for what is done beside them.

        Raises:
            SpecError: (E712) when the time is over.
        """
        self.spent += cost.seconds(points) + beside
        if self.spent > self.most:
            message = f"{self.what} take more than {self.most} seconds, the limit"
            refuse(message, how_to_raise("seconds", 10 * self.most))


def duration(seconds: float) -> str:
    """Return a time in words: `about 40 seconds`, `about 3 hours`."""
    for size, unit in ((86_400, "days"), (3_600, "hours"), (60, "minutes")):
        if seconds >= 2 * size:
            return f"about {_rounded(seconds / size)} {unit}"
    return f"about {_rounded(seconds)} seconds"


def _rounded(number: float) -> str:
    """Return two digits are enough for an estimate."""
    if not math.isfinite(number) or number >= 1e15:
        return "endlessly many"
    digits = max(0, len(str(int(number))) - 2)
    return f"{round(number / 10**digits) * 10**digits:,}"
