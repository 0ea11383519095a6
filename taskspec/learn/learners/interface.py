"""Cases that learners get, vectors of observations and actions, and the policies and rewards that they return."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from taskspec.base.arrays import AnyArray, Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task

if TYPE_CHECKING:
    from taskspec.learn.data.episodes import Demonstrations


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


class LearnerCase(Protocol):
    """A case for a learner: a task to learn in `steps` steps, once for each of `seeds`."""

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
        """Return the vectors of a space."""
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
                raise CannotLearn(
                    "observations that are dicts are not vectors", "choose another `space` for the observation"
                )

    def unbounded(self) -> Vectors:
        """Return the same vectors without bounds of a box, which are then not scaled by them."""
        if self.counts:
            return self
        return replace(self, low=(-math.inf,) * self.size, high=(math.inf,) * self.size)

    @property
    def size(self) -> int:
        if self.counts:
            return sum(self.counts)
        return math.prod(self.shape)

    @property
    def is_bounded(self) -> bool:
        """True for a box with finite bounds, the low ones below the high ones."""
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
        if self.counts:
            return (rows - self.start).astype(np.int32)
        return rows.astype(np.float32)

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


Layers = Sequence[tuple[Array, Array]]
"""Weights (inputs, outputs) and biases (outputs,)."""


def forward(layers: Layers, x: Array, activation: str) -> Array:
    """Forward pass in NumPy: (N, inputs) -> (N, outputs)."""
    *inner, (w, b) = layers
    for u, c in inner:
        x = x @ u + c
        if activation == "tanh":
            x = np.tanh(x)
        else:
            x = np.maximum(x, 0)
    return np.asarray(x @ w + b)


@dataclass(frozen=True, eq=False)
class NetPolicy:
    """A net whose outputs are logits of actions, or means of real actions.

    Attributes:
        layers: weights (inputs, outputs) and biases (outputs,).
        deviations: logarithms (D,) of the standard deviations of real actions.
        seed: of sampled actions and ties.
        reward: the learned reward, a function of observation, action and next observation (N, ...); or None.
    """

    seen: Vectors
    actions: Vectors
    layers: Layers
    deviations: Array
    seed: int = 0
    reward: Callable[[Array, Array, Array], Array] | None = None
    _rng: list[np.random.Generator] = field(default_factory=list, repr=False)

    def predict(
        self, observations: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Array, None]:
        """Return actions (N, *shape) of observations (N, *shape), or one of one; and no memory."""
        seen = np.asarray(observations)
        alone = seen.ndim == len(self.seen.shape)
        chosen = self._act(seen[None] if alone else seen, deterministic)
        return (chosen[0] if alone else chosen), None

    def action_probabilities(self, observations: Any) -> Array:
        """Return float64 (N, A), the probability of every action; the last component varies fastest."""
        if not self.actions.counts:
            raise TypeError("real actions have no probabilities")
        parts = self._groups(np.asarray(observations))
        return reduce(lambda a, b: (a[:, :, None] * b[:, None, :]).reshape(len(a), -1), parts)

    def _output(self, seen: Array) -> Array:
        return forward(self.layers, self.seen(seen).astype(np.float64), "tanh")

    def _groups(self, seen: Array) -> list[Array]:
        ends = np.cumsum(self.actions.counts)[:-1]
        logits = np.split(self._output(seen), ends, axis=1)
        powers = [np.exp(each - each.max(axis=1, keepdims=True)) for each in logits]
        return [p / p.sum(axis=1, keepdims=True) for p in powers]

    def _act(self, seen: Array, deterministic: bool) -> Array:
        if not self._rng:
            self._rng.append(np.random.default_rng(self.seed))
        rng = self._rng[0]
        v = self.actions
        if not v.counts:
            mean = self._output(seen)
            drawn = mean
            if not deterministic:
                drawn = mean + np.exp(self.deviations) * rng.standard_normal(mean.shape)
            return np.clip(drawn, v.low, v.high).astype(np.float32).reshape(-1, *v.shape)
        columns = []
        for p in self._groups(seen):
            if deterministic:
                p = p >= p.max(axis=1, keepdims=True)
            columns.append((rng.random((len(p), 1)) * p.sum(axis=1, keepdims=True) >= p.cumsum(axis=1)).sum(axis=1))
        numbers = np.stack(columns, axis=1)
        if v.single:
            return numbers[:, 0] + v.start
        return numbers


@dataclass(frozen=True, eq=False)
class LearnedReward:
    """A reward of steps that do not end an episode: theta, plus discount phi(s') - phi(s) if there is a phi.

    Attributes:
        mean, deviation: (D,), that observations are standardised with.
        sees_action: whether actions are an input of theta.
        flagged: whether nets have an input that flags absorbing states, which is 0 here.
        pay: how outputs become rewards (see `Adversarial`).
    """

    seen: Vectors
    actions: Vectors
    mean: Array
    deviation: Array
    theta: Layers
    phi: Layers | None
    activation: str
    sees_action: bool
    flagged: bool
    discount: float
    pay: str

    def __call__(self, observations: Any, actions: Any, next_observations: Any) -> Array:
        """Return float64 (N,) of observations, actions and next observations, (N, *shape) each."""
        state = self._state(observations)
        taken = self.actions(np.asarray(actions)).astype(np.float64)
        output = self._forward(self.theta, np.hstack([state, taken]) if self.sees_action else state)
        if self.phi is not None:
            after = self._forward(self.phi, self._state(next_observations))
            output = output + self.discount * after - self._forward(self.phi, state)
        if self.pay == "softplus(l)":
            return np.logaddexp(0, output)
        if self.pay == "-softplus(-l)":
            return -np.logaddexp(0, -output)
        return output

    def _state(self, observations: Any) -> Array:
        rows = (self.seen(np.asarray(observations)) - self.mean) / self.deviation
        return np.hstack([rows, np.zeros((len(rows), int(self.flagged)))])

    def _forward(self, layers: Layers, x: Array) -> Array:
        return forward(layers, x, self.activation)[:, 0]
