"""The axes of an experiment's settings: all combinations of their values, or a sample of them."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from taskspec.experiments.values import Draw

Values: TypeAlias = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Axis:
    """Parameters that change together: the tuples of their values, or what draws the value of one."""

    names: tuple[str, ...]
    values: Sequence[Values] | Draw

    @property
    def size(self) -> int:
        """How many values there are; 0 where they are drawn."""
        return 0 if callable(self.values) else len(self.values)

    def without(self, names: frozenset[str]) -> Axis:
        """The same axis for the other parameters."""
        kept = [i for i, name in enumerate(self.names) if name not in names]
        if callable(self.values):
            return Axis(self.names if kept else (), self.values)
        values = dict.fromkeys(tuple(v[i] for i in kept) for v in self.values)
        return Axis(tuple(self.names[i] for i in kept), list(values))

    def drawn(self, rng: np.random.Generator) -> Values:
        """One of the values."""
        return (self.values(rng),) if callable(self.values) else self.values[int(rng.integers(len(self.values)))]


def combinations(axes: Sequence[Axis]) -> Iterator[tuple[Values, ...]]:
    """One tuple of values for each axis, in every combination, that of the last axis changing fastest."""
    return itertools.product(*(axis.values for axis in axes if not callable(axis.values)))


def sample(axes: Sequence[Axis], count: int, seed: int) -> Iterator[tuple[Values, ...]]:
    """Some combinations: each once and in order, or drawn one by one where values are drawn."""
    if any(callable(axis.values) for axis in axes):
        rng = np.random.default_rng(seed)
        return (tuple(axis.drawn(rng) for axis in axes) for _ in range(count))
    size = math.prod(axis.size for axis in axes)
    chosen = random.Random(seed).sample(range(size), min(count, size))
    return (_at(axes, i) for i in sorted(chosen))


def _at(axes: Sequence[Axis], index: int) -> tuple[Values, ...]:
    """The combination with an index among all of them."""
    found: list[Values] = []
    for axis in reversed(axes):
        index, i = divmod(index, axis.size)
        assert not callable(axis.values)
        found.append(axis.values[i])
    return tuple(reversed(found))
