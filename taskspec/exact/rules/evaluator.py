"""One evaluator of conditions with three-valued (Kleene) logic, for every vocabulary of rules.

Claims are about the results of a task (`claim_rules`), diagnoses and findings about the scores of learners (`score_rules`). A
vocabulary is a subclass: it gives names, calls and comparisons their meaning.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

from taskspec.language.expressions import syntax as s

Evidence = TypeVar("Evidence")
Number = TypeVar("Number")


class Undecidable(Exception):
    """A rule needs something that is not known: a sentence that says what."""

    def __init__(self, message: str, place: s.Expr | None = None) -> None:
        super().__init__(message)
        self.place = place


class InvalidClaim(Exception):
    """An expression that is no claim: a sentence that says why."""

    def __init__(self, message: str, place: s.Expr | None = None, hint: str | None = None) -> None:
        super().__init__(message)
        self.place = place
        self.hint = hint


@dataclass(frozen=True, slots=True)
class Word:
    """A name, how it is written, and its meaning; the language reference is made from these.

    `phrase` is printed for it on pages, followed by `given` and the number in brackets, if any.
    """

    name: str
    written: str
    doc: str
    phrase: str = ""
    given: str = ""


@dataclass(frozen=True, slots=True)
class Truth(Generic[Evidence]):
    """The truth of a condition (None: undecided), and the evidence that decides it, or leaves it open."""

    holds: bool | None
    evidence: tuple[Evidence, ...] = ()


def combine(op: str, parts: Iterable[Truth[Evidence]], stops_early: bool = False) -> Truth[Evidence]:
    """Return the Kleene `and` or `or` of some parts, with the evidence of those that came out as the whole.

    Args:
        stops_early: whether parts after one that decides are left out; otherwise all of them are evidence.
    """
    deciding = op == "or"
    found = []
    for part in parts:
        found.append(part)
        if stops_early and part.holds is deciding:
            break
    holds: bool | None = not deciding
    values = [part.holds for part in found]
    if deciding in values:
        holds = deciding
    elif None in values:
        holds = None
    return Truth(holds, evidence_for(holds, found))


def evidence_for(holds: bool | None, parts: Iterable[Truth[Evidence]]) -> tuple[Evidence, ...]:
    """Return the evidence of the parts with one value."""
    return tuple(each for part in parts if part.holds is holds for each in part.evidence)


class Evaluator(ABC, Generic[Number, Evidence]):
    """Evaluate the syntax of conditions and numbers; a subclass is a vocabulary, with its `operators` of arithmetic."""

    operators: ClassVar[frozenset[str]] = frozenset("+-*/")
    stops_early: ClassVar[bool] = False

    def truth(self, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition holds."""
        match expr:
            case s.Logical(op=op, operands=operands):
                return combine(op, map(self.truth, operands), self.stops_early)
            case s.Unary(op="not", operand=operand):
                return self.negated(operand, expr)
            case s.Compare():
                return self.comparison(expr)
            case _:
                return self.statement(expr)

    def comparison(self, expr: s.Compare) -> Truth[Evidence]:
        """Return whether each side of a chain of comparisons compares with the next."""
        pairs = itertools.pairwise([("", expr.first), *expr.rest])
        found = (self.compared(left, op, right, expr) for (_, left), (op, right) in pairs)
        return combine("and", found, self.stops_early)

    def negated(self, operand: s.Expr, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition does not hold; `expr` is the whole, with `not`."""
        found = self.truth(operand)
        return Truth(None if found.holds is None else not found.holds, found.evidence)

    def number(self, expr: s.Expr) -> Number:
        """Return the value of a number."""
        match expr:
            case s.Number(value=value):
                return self.constant(value)
            case s.Unary(op="-", operand=operand):
                return self.arithmetic("neg", self.number(operand))
            case s.Unary(op="+", operand=operand):
                return self.number(operand)
            case s.Binary(op=op, left=left, right=right) if op in self.operators:
                return self.arithmetic(op, self.number(left), self.number(right))
            case _:
                return self.quantity(expr)

    @abstractmethod
    def statement(self, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition of the vocabulary's own holds."""

    @abstractmethod
    def compared(self, left: s.Expr, op: str, right: s.Expr, chain: s.Compare) -> Truth[Evidence]:
        """Return whether two sides of a chain compare as written."""

    @abstractmethod
    def constant(self, value: int | float) -> Number:
        """Return a number as written."""

    @abstractmethod
    def arithmetic(self, op: str, *numbers: Number) -> Number:
        """Return the result of one of the `operators`, or of `neg`."""

    @abstractmethod
    def quantity(self, expr: s.Expr) -> Number:
        """Return a number of the vocabulary's own."""
