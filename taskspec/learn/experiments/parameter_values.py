"""Values of parameters as an experiment writes them, and the axes that they span."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import compress
from typing import Any, TypeAlias

import numpy as np

from taskspec.base.diagnostics import Collector, Span, SpecError, spec_error
from taskspec.base.limits import how_to_raise, limits
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.parse import parse_into
from taskspec.language.expressions.scope import Binding, Lazy, Poisoned, Scope, Value
from taskspec.language.expressions.types import Domain, Kind, Type
from taskspec.language.task.parts import Parameter

Draw = Callable[[np.random.Generator], Any]
"""A value that is drawn for each setting."""
KINDS = {"bool": Kind.BOOL, "int": Kind.INT, "real": Kind.REAL}


def count(written: Any) -> int:
    """Return how many values are written, without listing them."""
    match written:
        case {"range": numbers}:
            start, stop, step = _exact(numbers)
            if step:
                return max(math.ceil((stop - start) / step), 0)
            return 0
        case {"logrange": numbers}:
            return max(int(numbers[2]), 0)
        case list():
            return len(written)
    return 1


def too_many(wanted: int) -> SpecError:
    """Return the error that there would be more instances than the limit."""
    most = limits().instances
    message = f"{wanted:,} instances are too many; the limit is {most:,}"
    return spec_error("E314", message, how_to_raise("instances", wanted))


def listed(written: Any, kind: str) -> list[Any] | Draw:
    """Return values as a list, or a draw of one; `kind` is that of the parameter.

    Raises:
        SpecError: E214 for numbers with a rule that give no values, E314 for more values than there may be instances.
    """
    _check(written)
    whole = kind == "int"

    match written:
        case {"range": numbers}:
            start, _, step = _exact(numbers)
            return [_number(start + i * step, whole) for i in range(count(written))]
        case {"logrange": [first, last, *_]}:
            spaced = np.geomspace(first, last, count(written))
            if whole:
                return list(dict.fromkeys(map(round, spaced)))
            return list(map(float, spaced))
        case {"uniform": [low, high]}:
            return partial(_uniform, low, high, whole)
        case {"loguniform": [low, high]}:
            return partial(_loguniform, low, high, whole)
        case list():
            return list(written)
    return [written]


def _number(value: Fraction, whole: bool) -> int | float:
    if whole and value.denominator == 1:
        return int(value)
    return float(value)


def _uniform(low: Any, high: Any, whole: bool, rng: np.random.Generator) -> int | float:
    if whole:
        return int(rng.integers(low, high, endpoint=True))
    return float(rng.uniform(low, high))


def _loguniform(low: float, high: float, whole: bool, rng: np.random.Generator) -> int | float:
    drawn = math.exp(rng.uniform(math.log(low), math.log(high)))
    if whole:
        return round(drawn)
    return drawn


def _exact(numbers: Sequence[float]) -> tuple[Fraction, Fraction, Fraction]:
    start, stop, step, *_ = [*(Fraction(str(number)) for number in numbers), Fraction(1)]
    return start, stop, step


def _check(written: Any) -> None:
    """Raise SpecError for numbers with a rule that give no values, or too many."""
    problem = _problem(written)
    if problem is not None:
        raise spec_error("E214", problem)
    if count(written) > limits().instances:
        raise too_many(count(written))


def _problem(written: Any) -> str | None:
    """Return why numbers with a rule give no values; None where they do."""
    match written:
        case {"range": numbers} if not count(written):
            return f"this range is empty: it goes from {numbers[0]} on, and ends below {numbers[1]}"
        case {"logrange": [first, last, n]} if not (first * last > 0 and isinstance(n, int) and n >= 1):
            return "a `logrange` needs two numbers above 0, and a whole number of values"
        case {"uniform": [low, high]} if low > high:
            return f"{low} is above {high}"
        case {"loguniform": [low, high]} if not 0 < low <= high:
            return "a `loguniform` needs a number above 0 and one that is not smaller"
    return None


class Assignment:
    """Values for all parameters of a task, those that are expressions worked out from the others.

    Args:
        known: the parameters of the task at their defaults, for the kinds and values of those that are not given.
        given: values by name; a text is an expression, but for a choice.
        span: where a value is written.
    """

    def __init__(
        self, known: Sequence[Parameter], given: Mapping[str, Any], span: Callable[[str, int, int], Span],
        collector: Collector,
    ) -> None:  # fmt: skip
        self.known = {p.name: p for p in known}
        self.given = given
        self.span = span
        self.builder = Builder()
        self.checker = _ExactChecker(self.builder, collector)
        bindings: dict[str, Binding] = {}
        for p in known:
            if p.kind != "choice":
                bindings[p.name] = Lazy(partial(self._value, p.name))
        self.scope = Scope(bindings, draws="values of parameters are fixed numbers")
        self._busy: list[str] = []

    def values(self) -> dict[str, Any] | None:
        """Return the given values, worked out; None where one is broken, which is reported."""
        try:
            return {name: self._plain(name) for name in self.given}
        except Poisoned:
            return None

    def _plain(self, name: str) -> Any:
        value = self.given[name]
        if not isinstance(value, str) or name not in self.known or self.known[name].kind == "choice":
            return value
        text = s.SourceText(value, lambda start, end: self.span(name, start, end))
        expr = parse_into(text, self.checker.collector)
        if expr is None:
            raise Poisoned
        if name in self._busy:
            self.checker.fail("E310", expr, f"'{name}' needs its own value: {' -> '.join([*self._busy, name])}")
        self._busy.append(name)
        try:
            node = self.checker.constant(expr, self.scope, "a value of a parameter")
        finally:
            self._busy.pop()
        if not node.type.is_scalar:
            self.checker.fail("E307", expr, "a value of a parameter is a single number")
        return node.numbers[0]

    def _value(self, name: str, at: s.Name) -> Value:
        parameter = self.known[name]
        value = self._plain(name) if name in self.given else parameter.value
        if isinstance(value, str):
            self.checker.fail("E306", at, f"'{name}' is a label, no number")
        kind = Kind.REAL
        if isinstance(value, bool):
            kind = Kind.BOOL
        elif isinstance(value, int):
            kind = KINDS[parameter.kind]
        elif isinstance(value, float):
            value = _decimal(value)
        return Value(self.builder.const(value, Type(kind)))


class _ExactChecker(Checker):
    """Numbers are the decimals that are written, not the floats nearest to them: `0.1 * 6` is 0.6."""

    def _number(self, number: int | float, want: Domain | None) -> Value:
        if isinstance(number, float):
            return Value(self.builder.scalar(_decimal(number)))
        return super()._number(number, want)


def _decimal(number: float) -> Fraction | float:
    if math.isfinite(number):
        return Fraction(repr(number))
    return number


# The axes of an experiment's settings: all combinations of their values, or a sample of them.

Values: TypeAlias = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Axis:
    """Parameters that change together: the tuples of their values, or what draws the value of one."""

    names: tuple[str, ...]
    values: Sequence[Values] | Draw

    @property
    def size(self) -> int:
        """The number of values; 0 where they are drawn."""
        if callable(self.values):
            return 0
        return len(self.values)

    def without(self, names: frozenset[str]) -> Axis:
        """Return the same axis for the other parameters."""
        kept = [name not in names for name in self.names]
        others = tuple(compress(self.names, kept))
        if callable(self.values):
            return Axis(others, self.values)
        values = dict.fromkeys(tuple(compress(value, kept)) for value in self.values)
        return Axis(others, list(values))

    def drawn(self, rng: np.random.Generator) -> Values:
        """Return one of the values."""
        if callable(self.values):
            return (self.values(rng),)
        return self.values[int(rng.integers(len(self.values)))]


def combinations(axes: Sequence[Axis]) -> Iterator[tuple[Values, ...]]:
    """Return one tuple of values for each axis, in every combination, that of the last axis changing fastest."""
    return itertools.product(*(axis.values for axis in axes if not callable(axis.values)))


def sample(axes: Sequence[Axis], count: int, seed: int) -> Iterator[tuple[Values, ...]]:
    """Yield some combinations: each once and in order, or drawn one by one where values are drawn."""
    if any(callable(axis.values) for axis in axes):
        rng = np.random.default_rng(seed)
        for _ in range(count):
            yield tuple(axis.drawn(rng) for axis in axes)
        return
    size = math.prod(axis.size for axis in axes)
    chosen = random.Random(seed).sample(range(size), min(count, size))
    for i in sorted(chosen):
        yield _at(axes, i)


def _at(axes: Sequence[Axis], index: int) -> tuple[Values, ...]:
    values: list[Values] = []
    for axis in reversed(axes):
        index, i = divmod(index, axis.size)
        assert not callable(axis.values)
        values.append(axis.values[i])
    return tuple(reversed(values))
