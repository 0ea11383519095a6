"""Finite domains as numbers: the code of each state and action, and sets of codes as sorted arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.expressions.types import BOOLEAN_LABELS, Kind, Role
from taskspec.language.task.parts import Component, counts_of

# -- sets of codes as sorted arrays, each code once: by sorting, which is far faster than NumPy's hash tables -------------


def distinct(codes: Array) -> Array:
    """Return the codes of an array (N,), sorted, each once."""
    ordered = np.sort(codes)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def union(parts: Sequence[Array]) -> Array:
    """Return the codes of several arrays, sorted, each once; of none, an empty array."""
    if parts:
        return distinct(np.concatenate(parts))
    return np.zeros(0, np.int64)


class Growing:
    """A set of codes that grows: a few sorted arrays, each more than twice as long as the next one."""

    def __init__(self) -> None:
        self._parts: list[Array] = []
        self.size = 0

    def add(self, codes: Array) -> Array:
        """Add sorted codes; gives those that are new."""
        new = self.without(codes)
        self.size += len(new)
        if len(new):
            self._parts.append(new)
        while len(self._parts) > 1 and len(self._parts[-2]) <= 2 * len(self._parts[-1]):
            self._parts[-2:] = [union(self._parts[-2:])]
        return new

    def without(self, codes: Array) -> Array:
        """Return those of some codes that are not in the set."""
        for part in self._parts:
            codes = without(codes, part)
        return codes

    def all(self) -> Array:
        """Return the codes of the set, sorted."""
        return union(self._parts)


def holds(codes: Array, members: Array) -> Array:
    """Return which of some codes (N,) are among sorted ones."""
    if not len(members):
        return np.zeros(len(codes), np.bool_)
    at = np.minimum(np.searchsorted(members, codes), len(members) - 1)
    return np.asarray(members[at] == codes)


def without(codes: Array, others: Array) -> Array:
    """Return the codes that are not among sorted ones."""
    return codes[~holds(codes, others)]


def entries_of(first: Array, counts: Array) -> Array:
    """Return the numbers first, first + 1, ... of each row, `counts` of them, one row after the other."""
    return np.asarray(np.arange(counts.sum()) + np.repeat(first - np.cumsum(counts) + counts, counts))


# -- codes of states and actions --------------------------------------------------------------------------------------
#
# Codes count in mixed radix, the first element of the first component slowest, so that the code of a
# single component with low = 0 is its value.

Reads = Mapping[tuple[Role, str], Array]
MAX_CODES = 2**62


@dataclass(frozen=True)
class Space:
    """The values of some components, all finite.

    `size` is how many combinations there are; arrays have the batch axis last, as in `lang.batch`.
    """

    components: tuple[Component, ...]
    role: Role

    @cached_property
    def size(self) -> int:
        return math.prod(counts_of(self.components))

    @cached_property
    def strides(self) -> tuple[tuple[int, ...], ...]:
        """For each component, how far apart in code two neighbouring values of each element are."""
        rest = self.size
        result = []
        for c in self.components:
            row = []
            for n in c.counts:
                rest //= n
                row.append(rest)
            result.append(tuple(row))
        return tuple(result)

    def decode(self, codes: Array, names: frozenset[tuple[Role, str]] | None = None) -> dict[tuple[Role, str], Array]:
        """Return values (*shape, N) of the components (those in `names`) from codes (N,)."""
        values = {}
        for c, strides in zip(self.components, self.strides, strict=True):
            key = (self.role, c.name)
            if names is None or key in names:
                values[key] = self._values(c, strides, codes)
        return values

    def _values(self, c: Component, strides: Sequence[int], codes: Array) -> Array:
        parts = []
        for low, count, stride in zip(c.low, c.counts, strides, strict=True):
            digits = codes
            if stride > 1:
                digits = codes // stride
            if stride * count < self.size:
                digits = digits % count
            parts.append(digits + int(low) if low else digits)
        values = np.array(parts).reshape(*c.type.shape, codes.shape[-1])
        return values.astype(np.bool_ if c.type.kind is Kind.BOOL else np.int64, copy=False)

    def encode(self, values: Sequence[Array], lanes: int) -> tuple[Array, Array | None]:
        """Return codes (lanes,) of values (*shape, lanes or 1), and which of them lie outside (None: none does).

        The code of a value outside is that of some value inside.
        """
        codes: Any = 0
        outside: Any = None
        for c, strides, value in zip(self.components, self.strides, values, strict=True):
            rows = value.reshape(-1, value.shape[-1])
            for row, low, count, stride in zip(rows, c.low, c.counts, strides, strict=True):
                digits = row.astype(np.int64, copy=False)
                if low:
                    digits = digits - int(low)
                if digits.size and (digits.min() < 0 or digits.max() >= count):
                    wrong = (digits < 0) | (digits >= count)
                    if outside is None:
                        outside = wrong
                    else:
                        outside = outside | wrong
                    digits = np.where(wrong, 0, digits)
                codes = codes + (digits * stride if stride > 1 else digits)
        if outside is not None:
            outside = np.broadcast_to(outside, (lanes,))
        return np.broadcast_to(codes, (lanes,)), outside

    def describe(self, code: int) -> str:
        """Return a combination in words, as `x = 2, y = 0`."""
        reads = self.decode(np.array([code]))
        return ", ".join(f"{c.name} = {shown(c, reads[self.role, c.name][..., 0])}" for c in self.components)

    def values_of(self, code: int) -> dict[str, Any]:
        """Return a combination as plain data: labels for choices, numbers and nested lists otherwise."""
        reads = self.decode(np.array([code]))
        return {c.name: plain(c, reads[self.role, c.name][..., 0]) for c in self.components}


def plain(c: Component, value: Any) -> Any:
    """Return a value of a component as plain data, a choice as its label (or labels)."""
    value = np.asarray(value).tolist()
    if c.domain is None:
        return value
    if isinstance(value, list):
        return [plain(c, code) for code in value]
    if 0 <= value < len(c.domain.labels):
        return c.domain.labels[int(value)]
    if c.domain.values is None:
        return f"label number {value}"
    return "none of them"


def shown(c: Component, value: Array) -> str:
    """Return a value of a component in words: labels without quotes, reals to six digits."""
    return words(plain(c, value))


def words(value: Any) -> str:
    match value:
        case list():
            inside = ", ".join(map(words, value[:12]))
            return f"[{inside}{', ...' if len(value) > 12 else ''}]"
        case bool():
            return BOOLEAN_LABELS[value]
        case float():
            return f"{value:.6g}"
        case _:
            return str(value)


def domain(c: Component) -> str:
    """Return the values that a component can have, in words."""
    if c.domain is not None:
        labels = c.domain.labels
        return f"one of {', '.join(labels[:8])}{', ...' if len(labels) > 8 else ''}"
    low = min(c.low)
    high = max(c.high)
    bottom = words(_number(low))
    top = words(_number(high))
    if max(c.low) > low or min(c.high) < high:
        if max(c.low) > low:
            bottom += " or more"
        if min(c.high) < high:
            top += " or less"
        return f"its own range for each element, within {bottom} ... {top}"
    if high == math.inf:
        if low == -math.inf:
            return "a number"
        return f"at least {bottom}"
    if low == -math.inf:
        return f"at most {top}"
    return f"between {bottom} and {top}"


def _number(value: float) -> int | float:
    if abs(value) < 1e15 and value == int(value):
        return int(value)
    return value
