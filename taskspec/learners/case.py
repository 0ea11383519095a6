"""Cases, as learners of this package use them, and observations and actions as flat vectors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task

if TYPE_CHECKING:
    from taskspec.data import Demonstrations


class CannotLearn(SpecError):
    """A learner is not made for a task (E724): an exam leaves the task out, instead of counting it as failed.

    Args:
        message: why not.
        hint: what else can be done.
    """

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__([Diagnostic("E724", None, message, hint)])
        self.message = message
        self.hint = hint

    def __reduce__(self) -> tuple[Any, ...]:
        return CannotLearn, (self.message, self.hint)  # so that it comes through from another process


def cannot_learn(message: str, hint: str | None = None) -> NoReturn:
    """Raise CannotLearn."""
    raise CannotLearn(message, hint)


class LearnerCase(Protocol):
    """What a learner is given: a task to learn in `steps` steps, once for each of `seeds`."""

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
        """The task whose rewards label segments."""
        ...

    def count(self, steps: int = 0, comparisons: int = 0) -> None:
        """Report steps taken and pairs compared, by each seed."""

    def show(self, *policies: Any) -> None:
        """Report the current policy of each seed: a point of the learning curve."""


@dataclass(frozen=True)
class Vectors:
    """The map from values of a space to vectors of `size` float32, for arrays of NumPy and JAX; finite values are one-hot.

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
        """Return the vectors of a space.

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
        """Whether it is a box with finite bounds, the low ones below the high ones."""
        ends = zip(self.low, self.high, strict=True)
        return not self.counts and all(math.isfinite(a) and math.isfinite(b) and a < b for a, b in ends)

    def __call__(self, values: AnyArray) -> AnyArray:
        """Return float32 (N, size) of values (N, *shape)."""
        if not self.counts:
            return values.reshape(len(values), -1).astype(np.float32)
        return self.one_hot(self.flat(values))

    def flat(self, values: AnyArray) -> AnyArray:
        """Return finite values (N, *shape) as numbers from 0, int32 (N, K); values of a box as float32 (N, size)."""
        rows = values.reshape(len(values), -1)
        return (rows - self.start).astype(np.int32) if self.counts else rows.astype(np.float32)

    def one_hot(self, numbers: AnyArray) -> AnyArray:
        """Return float32 (..., size) of numbers from 0, (..., K); real numbers are unchanged."""
        if not self.counts:
            return numbers
        firsts = np.cumsum([0, *self.counts[:-1]]).tolist()
        places = np.arange(self.size)
        hits = [numbers[..., k, None] + first == places for k, first in enumerate(firsts)]
        return sum(hit.astype(np.float32) for hit in hits)

    def scaled(self, vectors: AnyArray) -> AnyArray:
        """Return vectors with the bounds of a bounded box at 0 and 1; others are unchanged."""
        if not self.is_bounded:
            return vectors
        low = np.array(self.low, np.float32)
        high = np.array(self.high, np.float32)
        return (vectors - low) / (high - low)
