"""Gymnasium spaces from value layouts."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from taskspec.lang.types import Kind
from taskspec.task.spaces import FLOAT_MAX, SpaceLayout, single
from taskspec.task.task import Component


def space(layout: SpaceLayout) -> gymnasium.Space[Any]:
    """The space that holds the values of a layout."""
    match layout.form:
        case "discrete":
            return _discrete(layout.components[0])
        case "multi_discrete":
            return spaces.MultiDiscrete(np.array(layout.counts, np.int64))
        case "one_hot":
            return spaces.Box(0.0, 1.0, layout.shape, np.float32)
        case "dict":
            return spaces.Dict({c.name: _component(c) for c in layout.components})
        case "box":
            return _box(layout.low, layout.high, layout.shape)


def _discrete(c: Component) -> gymnasium.Space[Any]:
    return spaces.Discrete(c.counts[0], start=int(c.low[0]))


def _component(c: Component) -> gymnasium.Space[Any]:
    if c.is_finite and c.type.is_scalar:
        return _discrete(c)
    low, high = (tuple(single(v) for v in bound) for bound in (c.low, c.high))
    return _box(low, high, c.type.shape)


def _box(low: tuple[float, ...], high: tuple[float, ...], shape: tuple[int, ...]) -> spaces.Box:
    """Gymnasium 0.29 takes no lower bound of +inf and no upper one of -inf, which values that are always infinite have."""
    bounds = np.minimum(low, FLOAT_MAX), np.maximum(high, -FLOAT_MAX)
    lows, highs = (np.array(b, np.float32).reshape(shape) for b in bounds)
    return spaces.Box(lows, highs, dtype=np.float32)


def labels(c: Component, value: Any) -> Any:
    """A component's value for people: labels for choices, bools for conditions."""
    if c.domain is not None and c.type.is_scalar:
        return c.domain.labels[int(value)]
    return bool(value) if c.type.kind is Kind.BOOL and c.type.is_scalar else value
