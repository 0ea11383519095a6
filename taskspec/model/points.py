"""The points at which a task is looked at: all of them, or samples."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.ir import Role
from taskspec.lang.types import Kind
from taskspec.model.space import Reads, Space
from taskspec.task.task import Component

TIME = (Role.TIME, "t")
SAMPLES = 4096
FAR = 100.0  # how far from 0 an unbounded value is sampled


@dataclass(frozen=True, slots=True)
class Method:
    """How something was found out: at all `points`, or at that many samples."""

    exact: bool
    points: int
    states: int | None = None

    def __str__(self) -> str:
        if not self.exact:
            return f"sampled: {self.points:,} points"
        return (
            "by bounds"
            if not self.points
            else f"exact: all {self.points:,} points" + ("" if self.states is None else f", {self.states:,} states")
        )

    @classmethod
    def joined(cls, methods: Sequence[Method]) -> Method:
        """Of several: exact only if all are; the points of those that decide that."""
        exact = all(m.exact for m in methods)
        points = sum(m.points for m in methods if m.exact == exact)
        return cls(exact, points, next((m.states for m in methods if m.states is not None), None))


@dataclass(frozen=True)
class Batch:
    """Some points: what is read at each (batch axis last), and the codes of the states where they have one.

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
        return self.states.size * (1 if self.actions is None else self.actions.size) * len(self.times or (0,))

    def batches(self, most: int) -> Iterator[Batch]:
        """Yield all points, at most `most` at a time."""
        total = self.size
        for low in range(0, total, most):
            rest = np.arange(low, min(total, low + most))
            rest, states = np.divmod(rest, self.states.size)
            reads = dict(self.states.decode(states))
            if self.actions is not None:
                rest, actions = np.divmod(rest, self.actions.size)
                reads |= self.actions.decode(actions)
            if self.times is not None:
                reads[TIME] = rest + self.times.start
            yield Batch(reads, len(states), states)


@dataclass(frozen=True)
class Samples:
    """Points that episodes visit, and others of the declared domains of which it is not known whether any does.

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
        yield from _parts(self.visited, True, most)
        yield from _parts(self.others, None, most)


def _count(reads: Reads) -> int:
    return max((v.shape[-1] for v in reads.values()), default=0)


def _parts(reads: Reads, acting: bool | None, most: int) -> Iterator[Batch]:
    lanes = _count(reads)
    for low in range(0, lanes, most):
        here = {k: v if v.shape[-1] == 1 else v[..., low : low + most] for k, v in reads.items()}
        yield Batch(here, min(most, lanes - low), None, acting)


def drawn(
    components: Iterable[tuple[Role, Component]], times: range, rng: np.random.Generator
) -> dict[tuple[Role, str], Array]:
    """Return values of some components all over their domains, at some times."""
    reads = {(role, c.name): sampled(c, SAMPLES, rng) for role, c in components}
    return reads | {TIME: rng.integers(times.start, times.stop, SAMPLES)}


def anew(reads: Reads, components: Iterable[tuple[Role, Component]], rng: np.random.Generator) -> Reads:
    """Return what is read at some points, as often as there are samples, with other values of some components."""
    if not _count(reads):
        return {}
    lanes = rng.integers(0, _count(reads), SAMPLES)
    return {k: v[..., lanes] for k, v in reads.items()} | {
        (role, c.name): sampled(c, SAMPLES, rng) for role, c in components
    }


def are_related(state: Sequence[Component]) -> bool:
    """Return whether more may hold of the components of a state than their domains say: there is a real among others."""
    return any(c.type.kind is Kind.REAL for c in state) and sum(c.type.size for c in state) > 1


def sampled(c: Component, lanes: int, rng: np.random.Generator) -> Array:
    """Return values (*shape, lanes) of a component; each element is at an end of its range every eighth time, and near one
    as often.
    """
    rows = [_element(low, high, c.type.kind, lanes, rng) for low, high in zip(c.low, c.high, strict=True)]
    values = np.array(rows) if c.type.shape else rows[0]
    kind: Any = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}[c.type.kind]
    return values.reshape(*c.type.shape, lanes).astype(kind)


def _element(low: float, high: float, kind: Kind, lanes: int, rng: np.random.Generator) -> Array:
    bottom = low if math.isfinite(low) else min(-FAR, high - 2 * FAR) if math.isfinite(high) else -FAR
    top = high + 0.0 if math.isfinite(high) else max(FAR, bottom + 2 * FAR)  # -0.0 is 0.0, and not below it
    if kind is Kind.REAL:
        values = rng.uniform(bottom, top, lanes)
    else:
        values = np.floor(rng.uniform(bottom, top + 1, lanes)).clip(bottom, top)
    place = rng.integers(0, 16, lanes)
    near = (top - bottom) * 10 ** -rng.uniform(0, 9, lanes)
    near = near if kind is Kind.REAL else np.floor(near)
    return np.choose(np.minimum(place, 4), [bottom, top, bottom + near, top - near, values])


def columns(parts: Iterable[Reads]) -> Reads:
    """Return several batches of one another after the other."""
    parts = list(parts)
    return {key: np.concatenate([p[key] for p in parts], axis=-1) for key in parts[0]} if parts else {}
