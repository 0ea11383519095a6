"""The points at which a task is evaluated: all of them, or samples; and what that costs, at nominal rates."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import how_to_raise, limits
from taskspec.exact.model.model import too_large
from taskspec.exact.model.space import Reads, Space
from taskspec.language.expressions.ir import Const, Draw, walk
from taskspec.language.expressions.types import TIME, Expression, Kind, Role, total_size
from taskspec.language.expressions.variates import VARIATES, words_of
from taskspec.language.task.parts import Component

SAMPLES = 4096
FAR = 100.0
"""The distance from 0 up to which an unbounded value is sampled."""


@dataclass(frozen=True, slots=True)
class Method:
    """The points at which something was found: all `points`, or that many samples."""

    exact: bool
    points: int
    states: int | None = None

    def __str__(self) -> str:
        if not self.exact:
            return f"sampled: {self.points:,} points"
        if not self.points:
            return "by bounds"
        states = ""
        if self.states is not None:
            states = f", {self.states:,} states"
        return f"exact: all {self.points:,} points{states}"

    @classmethod
    def joined(cls, methods: Sequence[Method]) -> Method:
        """Return the combined method: exact only if all parts are, with the points of the parts that decide that."""
        exact = all(m.exact for m in methods)
        points = sum(m.points for m in methods if m.exact == exact)
        return cls(exact, points, next((m.states for m in methods if m.states is not None), None))


@dataclass(frozen=True)
class Batch:
    """Some points: the reads at each (batch axis last), and the codes of the states where they have one.

    `acting` is whether episodes are there; None: not known.
    """

    reads: Reads
    lanes: int
    states: Array | None
    acting: bool | None = None


@dataclass(frozen=True)
class Grid:
    """Every state, with every action (if `actions` is given), at every time (if `times` is)."""

    states: Space
    actions: Space | None
    times: range | None

    @property
    def size(self) -> int:
        actions = 1
        if self.actions is not None:
            actions = self.actions.size
        return self.states.size * actions * len(self.times or (0,))

    def batches(self, most: int) -> Iterator[Batch]:
        """Yield all points, at most `most` at a time."""
        total = self.size
        for low in range(0, total, most):
            rest, states = np.divmod(np.arange(low, min(total, low + most)), self.states.size)
            reads = dict(self.states.decode(states))
            if self.actions is not None:
                rest, actions = np.divmod(rest, self.actions.size)
                reads |= self.actions.decode(actions)
            if self.times is not None:
                reads[TIME] = rest + self.times.start
            yield Batch(reads, len(states), states)


@dataclass(frozen=True)
class Samples:
    """Points that episodes visit, and others of the declared domains, which episodes may or may not visit.

    The domain of a real value says where it lies, but not what holds between several (a point on a
    circle, probabilities that sum to 1). States with one among others are therefore taken from
    episodes alone.
    """

    visited: Reads
    others: Reads

    @property
    def size(self) -> int:
        return _count(self.visited) + _count(self.others)

    def batches(self, most: int) -> Iterator[Batch]:
        for reads, acting in ((self.visited, True), (self.others, None)):
            lanes = _count(reads)
            for low in range(0, lanes, most):
                here = {k: v if v.shape[-1] == 1 else v[..., low : low + most] for k, v in reads.items()}
                yield Batch(here, min(most, lanes - low), None, acting)


def _count(reads: Reads) -> int:
    return max((v.shape[-1] for v in reads.values()), default=0)


def drawn(
    components: Iterable[tuple[Role, Component]], times: range, rng: np.random.Generator
) -> dict[tuple[Role, str], Array]:
    """Return values of some components all over their domains, at some times."""
    reads = {(role, c.name): sampled(c, SAMPLES, rng) for role, c in components}
    return reads | {TIME: rng.integers(times.start, times.stop, SAMPLES)}


def resampled(reads: Reads, components: Iterable[tuple[Role, Component]], rng: np.random.Generator) -> Reads:
    """Return reads at some points, as often as there are samples, with other values of some components."""
    if not _count(reads):
        return {}
    lanes = rng.integers(0, _count(reads), SAMPLES)
    chosen = {k: v[..., lanes] for k, v in reads.items()}
    for role, c in components:
        chosen[role, c.name] = sampled(c, SAMPLES, rng)
    return chosen


def sampled(c: Component, lanes: int, rng: np.random.Generator) -> Array:
    """Return values (*shape, lanes) of a component; each element is at an end of its range every eighth time, and near one
    as often.
    """
    rows = [_element(low, high, c.type.kind, lanes, rng) for low, high in zip(c.low, c.high, strict=True)]
    kind: Any = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}[c.type.kind]
    return np.array(rows).reshape(*c.type.shape, lanes).astype(kind)


def _element(low: float, high: float, kind: Kind, lanes: int, rng: np.random.Generator) -> Array:
    bottom = low
    top = high + 0.0  # -0.0 is 0.0, and not below it
    if not math.isfinite(low):
        bottom = -FAR
        if math.isfinite(high):
            bottom = min(-FAR, high - 2 * FAR)
    if not math.isfinite(high):
        top = max(FAR, bottom + 2 * FAR)
    if kind is Kind.REAL:
        values = rng.uniform(bottom, top, lanes)
    else:
        values = np.floor(rng.uniform(bottom, top + 1, lanes)).clip(bottom, top)
    place = rng.integers(0, 16, lanes)
    near = (top - bottom) * 10 ** -rng.uniform(0, 9, lanes)
    if kind is not Kind.REAL:
        near = np.floor(near)
    return np.choose(np.minimum(place, 4), [bottom, top, bottom + near, top - near, values])


def columns(parts: Iterable[Reads]) -> Reads:
    """Return several batches of one another after the other."""
    parts = list(parts)
    if parts:
        return {key: np.concatenate([p[key] for p in parts], axis=-1) for key in parts[0]}
    return {}


RATE = 3e8
"""Nominal number of operations on single numbers that NumPy does in a second."""
CALL = 1e-5
"""Seconds that an operation of NumPy takes, however few numbers there are."""
BYTES = 8
WORD = 5
SORTED = 60
PASS = 3
"""Operations for a random word, for one of a draw that sorts its words, and for each further pass over the words."""


class Cost:
    """The cost of evaluating nodes at many points at once: their operations, and the numbers in one point's results.

    Args:
        roots: the nodes.
        simulated: draws are sampled, instead of being enumerated.
        beside: operations at each point beside those of the nodes.
    """

    def __init__(self, roots: Iterable[Expression], simulated: bool = False, beside: int = 0) -> None:
        nodes = [node for node in walk(roots) if not isinstance(node, Const)]
        self.calls = max(1, len(nodes))
        self.numbers = max(1, total_size(nodes) + beside)
        for node in nodes:
            if simulated and isinstance(node, Draw):
                more_passes = PASS * (VARIATES[node.base].passes(node) - 1)
                word = WORD
                if VARIATES[node.base].sorts:
                    word = SORTED
                self.numbers += words_of(node) * (word + more_passes)
                self.calls += more_passes

    def seconds(self, points: float, batches: float = 1) -> float:
        """Return how long so many points take, in so many batches."""
        return points * self.numbers / RATE + batches * self.calls * CALL

    def affordable(self) -> int:
        """Return how many points there may be in the time that an analysis has."""
        return int(limits().seconds * RATE / self.numbers)

    def batch(self, most: float) -> int:
        """Return how many points, of at most so many, fit into memory at once."""
        return max(1, int(min(most, limits().megabytes * 1e6 / (BYTES * self.numbers))))


class Budget:
    """The time of an analysis whose length only shows as it goes on.

    `what` takes more than that time, says the message.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        self.spent = 0.0
        self.most = limits().seconds

    def spend(self, cost: Cost, points: float, beside: float = 0.0) -> None:
        """Begin a batch of so many points, with so many seconds for what is done beside them."""
        self.spent += cost.seconds(points) + beside
        if self.spent > self.most:
            message = f"{self.what} take more than {self.most} seconds, the limit"
            too_large(message, how_to_raise("seconds", 10 * self.most))


UNITS = ((86_400, "days"), (3_600, "hours"), (60, "minutes"), (1, "seconds"))


def duration(seconds: float) -> str:
    """Return a time in words, to two digits: `about 40 seconds`, `about 3 hours`."""
    size, unit = next((s, u) for s, u in UNITS if seconds >= 2 * s or s == 1)
    if not seconds / size < 1e15:
        return f"about endlessly many {unit}"
    return f"about {float(f'{seconds / size:.2g}'):,.0f} {unit}"
