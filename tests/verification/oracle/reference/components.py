"""Components of the state and of the action: which values they can have."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tests.verification.oracle.reference.values import Choice, Shape, Value, Wrong, as_float, number, settled, spread

LARGEST = 2**31 - 1
Form = Callable[[Any], Value]


class Outside(Exception):
    """A value that the component cannot have."""


@dataclass(frozen=True)
class Component:
    name: str
    kind: str
    shape: Shape
    low: tuple[Any, ...] | None
    """A bound for each element, or None."""
    high: tuple[Any, ...] | None
    choice: Choice | None = None
    has_no_axis: bool = False
    """Whether its shape is written as `[]`, and not left out."""

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def finite(self) -> bool:
        return (
            self.size == 0
            or self.kind in ("bool", "choice")
            or (self.kind == "int" and self.low is not None and self.high is not None)
        )

    def ends(self, i: int) -> tuple[Any, Any]:
        """The smallest and the largest value of element i; numbers of labels for a choice."""
        match self.kind:
            case "bool":
                return 0, 1
            case "choice":
                assert self.choice is not None
                return 0, len(self.choice.labels) - 1
        return (
            -math.inf if self.low is None else self.low[i],
            math.inf if self.high is None else self.high[i],
        )

    def hold(self, value: Value) -> Value:
        """The value as this component keeps it. `Outside`: it cannot."""
        kept = self.cast(value)
        for i, x in enumerate(kept.data):
            low, high = self.ends(i)
            if not low <= x <= high or not math.isfinite(x):
                raise Outside(f"{self.name} = {x}")
        return kept

    def cast(self, value: Value) -> Value:
        if self.kind == "choice":
            labels = value.data if value.choice == self.choice else self._numbered(value)
            value = Value("choice", value.shape, tuple(labels), False, choice=self.choice)
            return Value("choice", self.shape, spread(value, self.shape), False, choice=self.choice)
        value = number(value)
        if "bool int real".find(value.kind) > "bool int real".find(self.kind):
            raise Wrong(f"{self.name} is {self.kind}, not {value.kind}")
        data = [as_float(x) if self.kind == "real" else x for x in spread(value, self.shape)]
        if self.kind == "int" and (self.low is None or self.high is None):
            data = [max(-LARGEST - 1, min(LARGEST, x)) for x in data]
        return settled(self.kind, self.shape, data, fixed=False, rough=value.rough)

    def _numbered(self, value: Value) -> list[int]:
        """Numbers of the labels that ints stand for; -1 where it is none."""
        assert self.choice is not None
        ints = number(value)
        if ints.kind == "real" or (value.choice is not None and not value.choice.meaning):
            raise Wrong(f"{self.name} needs one of its labels")
        if not self.choice.meaning:
            return [int(x) for x in ints.data]
        stand = [v.item for v in self.choice.meaning]
        return [stand.index(x) if x in stand else -1 for x in ints.data]

    def everything(self) -> Iterator[Value]:
        """All values of a finite component."""
        ranges = [range(int(low), int(high) + 1) for low, high in map(self.ends, range(self.size))]
        for data in itertools.product(*ranges):
            yield self.of(data)

    def of(self, data: tuple[Any, ...]) -> Value:
        if self.kind == "choice":
            return Value("choice", self.shape, data, False, choice=self.choice)
        return settled(self.kind, self.shape, data, fixed=False)

    def only(self) -> Value | None:
        """Its value, if it can have one only."""
        if self.finite and all(low == high for low, high in map(self.ends, range(self.size))):
            return self.of(tuple(self.ends(i)[0] for i in range(self.size)))
        return None


def component(name: str, data: dict[str, Any], form: Form) -> Component:
    """A component as declared; bounds and shape may use parameters and constants."""
    shape = as_shape(data.get("shape"), form)
    low, high = (bound(data.get(key), form, shape, data["type"]) for key in ("low", "high"))
    return Component(name, data["type"], shape, low, high, as_choice(data, form), data.get("shape") == [])


def as_shape(data: Any, form: Form) -> Shape:
    if data is None or data == []:
        return ()
    value = form(data)
    return tuple(int(n) for n in value.data)


def bound(data: Any, form: Form, shape: Shape, kind: str) -> tuple[Any, ...] | None:
    """One bound for each element; a real's is a float; of an int's, the next int inside is taken elsewhere."""
    if data is None:
        return None
    value = number(form(data))
    ends = spread(value, shape)
    if all(isinstance(x, float) and math.isinf(x) for x in ends):
        return None
    return tuple(as_float(x) if kind == "real" else whole(x) for x in ends)


def whole(x: Any) -> int:
    if Fraction(x).denominator != 1:
        raise Wrong("the bound of an int is an int")
    return int(x)


def as_choice(data: dict[str, Any], form: Form) -> Choice | None:
    if data["type"] != "choice":
        return None
    values = data["values"]
    if isinstance(values, dict):
        meaning = tuple(form(v) for v in values.values())
        return Choice(tuple(map(str, values)), meaning)
    return Choice(tuple(map(str, values)))


def label_value(choice: Choice, label: str) -> Value:
    return Value("choice", (), (choice.labels.index(label),), True, choice=choice)
