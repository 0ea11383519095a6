"""What a learner is given, what it raises where it cannot learn, and observations as flat vectors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol

import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.data import Demonstrations
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task

# ---------- refusals
# What a learner raises on a task that it is not made for.


class CannotLearn(SpecError):
    """A learner is not made for a task (E724): an exam leaves the task out, instead of counting it as failed.

    Args:
        message: why not.
        hint: what else can be done.
    """

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__([Diagnostic("E724", None, message, hint)])
        self.message, self.hint = message, hint

    def __reduce__(self) -> tuple[Any, ...]:
        return CannotLearn, (self.message, self.hint)  # so that it comes through from another process


def cannot_learn(message: str, hint: str | None = None) -> NoReturn:
    """Raise CannotLearn."""
    raise CannotLearn(message, hint)


# ---------- case
# What a learner is given, as learners of this package use it.


class LearnerCase(Protocol):
    """What is asked of a learner: to learn `task` in `steps` steps, once for every one of `seeds`."""

    @property
    def task(self) -> Task: ...

    @property
    def steps(self) -> int: ...

    @property
    def seeds(self) -> tuple[int, ...]: ...

    @property
    def demonstrations(self) -> Demonstrations: ...

    @property
    def judge(self) -> Task:
        """The task by whose rewards segments are compared."""
        ...

    def count(self, steps: int = 0, comparisons: int = 0) -> None:
        """Say that each seed took so many more steps, and had so many more pairs compared."""

    def show(self, *policies: Any) -> None:
        """Show what each seed has learned so far."""


# ---------- vectors
# Observations and actions as flat vectors: what is finite is one-hot.


@dataclass(frozen=True)
class Vectors:
    """How values of a space become vectors of `size` float32; of NumPy's arrays and of JAX's alike.

    Attributes:
        counts: how many values each finite element takes; empty for a box.
        shape: of a value.
        start: the lowest value of a single finite number.
        single: whether a value is one finite number.
        low, high: bounds of a box, flat.
    """

    counts: tuple[int, ...]
    shape: tuple[int, ...]
    start: int = 0
    single: bool = False
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()

    @classmethod
    def of(cls, layout: SpaceLayout) -> Vectors:
        """Of a space as environments lay it out.

        Raises:
            CannotLearn: for dicts.
        """
        match layout.form:
            case "discrete":
                return cls(layout.counts, (), start=layout.starts[0], single=True)
            case "multi_discrete":
                return cls(layout.counts, layout.shape)
            case "box":
                return cls((), layout.shape, low=layout.low, high=layout.high)
            case "one_hot":
                return cls((), layout.shape, low=(0.0,) * layout.size, high=(1.0,) * layout.size)
            case "dict":
                cannot_learn(
                    "observations that are dicts are not vectors", "choose another `space` for the observation"
                )

    @property
    def size(self) -> int:
        return sum(self.counts) if self.counts else math.prod(self.shape)

    @property
    def is_bounded(self) -> bool:
        """Whether it is a box, all of whose bounds are finite and apart."""
        ends = zip(self.low, self.high, strict=True)
        return not self.counts and all(math.isfinite(a) and math.isfinite(b) and a < b for a, b in ends)

    def __call__(self, values: AnyArray) -> AnyArray:
        """Float32 (N, size) of values (N, *shape)."""
        if not self.counts:
            return values.reshape(len(values), -1).astype(np.float32)
        return self.one_hot(self.flat(values))

    def flat(self, values: AnyArray) -> AnyArray:
        """Finite values (N, *shape) as numbers from 0, int32 (N, K); values of a box as they are, (N, size)."""
        rows = values.reshape(len(values), -1)
        return (rows - self.start).astype(np.int32) if self.counts else rows.astype(np.float32)

    def one_hot(self, numbers: AnyArray) -> AnyArray:
        """Float32 (..., size) of numbers from 0, (..., K); real numbers are left as they are."""
        if not self.counts:
            return numbers
        firsts = np.cumsum([0, *self.counts[:-1]]).tolist()
        places = np.arange(self.size)
        hits = [numbers[..., k, None] + first == places for k, first in enumerate(firsts)]
        return sum(hit.astype(np.float32) for hit in hits)

    def scaled(self, vectors: AnyArray) -> AnyArray:
        """Vectors with the bounds of a bounded box at 0 and 1; others as they are."""
        if not self.is_bounded:
            return vectors
        low, high = np.array(self.low, np.float32), np.array(self.high, np.float32)
        return (vectors - low) / (high - low)
