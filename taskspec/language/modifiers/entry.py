"""The entries of the table of modifiers, and the reading of their arguments."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal, TypeAlias, get_args

from taskspec.base.display import decimal
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.types import Refused
from taskspec.language.task.task import Task

Arguments: TypeAlias = Mapping[str, Any]
Kept: TypeAlias = Literal["every policy's return", "all returns", "best policies", "nothing"]
"""Guarantees of a modifier, the strongest first: the return of every policy of states and times stays the same; the optimal, the
random and the worst return do; the best policies do."""
KEPT = get_args(Kept)


class Inapplicable(Refused):
    """A modifier that a task cannot be given: the reason, as a sentence, and maybe a hint."""

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message, "E720", hint)


@dataclass(frozen=True, slots=True)
class ModifierArgument:
    """An argument of a modifier; one without a default must be given.

    A number lies between `low` and `high`; a word is one of `words`, where there are some. `sample` is a value that suits
    a task, for examples and tests; the default unless it is given.
    """

    name: str
    kind: Literal["int", "real", "bool", "word", "expression"]
    doc: str
    default: Any = None
    low: float = -math.inf
    high: float = math.inf
    words: tuple[str, ...] = ()
    sample: Callable[[Task], Any] | None = None

    def read(self, value: Any) -> Any:
        """Convert an argument to the value that is kept: a number, true or false, or a text.

        Raises:
            ValueError: says what is needed.
        """
        match self.kind:
            case "bool":
                truth = {"true": True, "false": False}.get(str(value).lower())
                if truth is None:
                    raise ValueError(self.range)
                return truth
            case "int" | "real":
                return self._number(value)
        if self.kind == "expression" and isinstance(value, int | float):
            value = str(value).lower()
        if not isinstance(value, str) or not value.strip() or (self.words and value not in self.words):
            raise ValueError(self.range)
        return value.strip()

    @property
    def range(self) -> str:
        """The values it takes, in words."""
        match self.kind:
            case "bool":
                return "true or false"
            case "word" if self.words:
                return " or ".join(self.words)
            case "word":
                return "a name"
            case "expression":
                return "an expression"
        words = "a number"
        if self.kind == "int":
            words = "an int"
        if math.isinf(self.low):
            return words
        if math.isinf(self.high):
            return f"{words}, at least {decimal(self.low)}"
        return f"{words} from {decimal(self.low)} to {decimal(self.high)}"

    def _number(self, value: Any) -> int | float:
        try:
            if isinstance(value, str):
                number = Fraction(value.strip())
            else:
                number = Fraction(value)
        except (TypeError, ValueError, ZeroDivisionError, OverflowError):
            raise ValueError(self.range) from None
        is_whole = number.denominator == 1
        if isinstance(value, bool) or not self.low <= number <= self.high or (self.kind == "int" and not is_whole):
            raise ValueError(self.range)
        if is_whole and abs(number) < 2**53:
            return int(number)
        return float(number)


STD = ModifierArgument("std", "real", "the standard deviation", low=0, high=1e9, sample=lambda task: 0.5)
"""The argument of modifiers that add normal noise."""

StandIn: TypeAlias = Literal["modified as well", "unaffected", "lost"]


def as_well(given: Arguments) -> StandIn:
    return "modified as well"


def unaffected(given: Arguments) -> StandIn:
    return "unaffected"


def always(task: Task, given: Arguments) -> bool:
    return True


def never(task: Task, given: Arguments) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class ModifierEntry:
    """A modifier.

    `change` gives the changed task from a builder that knows its nodes, the task and all arguments, or raises
    `Inapplicable`; what it leaves as it is need not be
    touched. `says` is a sentence about the task before, with the numbers, in Markdown with mathematics. `keeps` holds where
    `when` says so (in words: `condition`). Where `observed` says so (in words: `observed_condition`), returns are also kept
    for those who see observations alone: every policy of what was seen and done so far has one that earns the same, and the
    other way round. With `claims` the claims and examples of the spec are still about the task.
    """

    name: str
    arguments: tuple[ModifierArgument, ...]
    doc: str
    change: Callable[[Builder, Task, Arguments], Task]
    says: Callable[[Task, Arguments], str]
    keeps: Kept = "nothing"
    when: Callable[[Task, Arguments], bool] = always
    condition: str = ""
    observed: Callable[[Task, Arguments], bool] = never
    observed_condition: str = ""
    needs: str = ""
    claims: bool = False
    time_limit: Literal["unread", "read", "changed"] = "unread"
    """Whether it reads or changes the horizon: once a modifier has read it, no other one changes it."""
    abstraction: Callable[[Arguments], StandIn] = lambda given: "lost"
    """Effect on the finite stand-in of a task that has one."""

    def kept(self, task: Task, given: Arguments) -> Kept:
        """Guarantees for a task with these arguments."""
        if self.when(task, given):
            return self.keeps
        return "nothing"

    def keeps_observers(self, task: Task, given: Arguments) -> bool:
        """Test whether policies of observations alone keep their returns in a task with these arguments."""
        return self.kept(task, given) in KEPT[:2] and self.observed(task, given)

    def sample(self, task: Task) -> dict[str, Any]:
        """Arguments that suit a task, for examples and tests."""
        arguments = {}
        for a in self.arguments:
            if a.sample is None:
                arguments[a.name] = a.default
            else:
                arguments[a.name] = a.sample(task)
        return arguments
