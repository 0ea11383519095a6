"""One evaluator of conditions with three-valued (Kleene) logic, for every vocabulary of rules.

Claims are about the results of a task (`claim_rules`), diagnoses and findings about the scores of learners (`score_rules`). A
vocabulary is a subclass: it gives names, calls and comparisons their meaning.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

from taskspec.lang import syntax as s

Evidence = TypeVar("Evidence")
Number = TypeVar("Number")


class Undecidable(Exception):
    """A rule needs something that is not known: a sentence that says what."""

    def __init__(self, message: str, place: s.Expr | None = None) -> None:
        super().__init__(message)
        self.place = place


@dataclass(frozen=True, slots=True)
class Truth(Generic[Evidence]):
    """The truth of a condition (None: undecided), and the evidence that decides it, or leaves it open."""

    holds: bool | None
    evidence: tuple[Evidence, ...] = ()


def combine(op: str, parts: Iterable[Truth[Evidence]]) -> Truth[Evidence]:
    """Return the Kleene `and` or `or` of some parts, with the evidence of those that came out as the whole."""
    parts = list(parts)
    deciding = op == "or"
    holds: bool | None = not deciding
    if any(part.holds is deciding for part in parts):
        holds = deciding
    elif any(part.holds is None for part in parts):
        holds = None
    return Truth(holds, evidence_for(holds, parts))


def evidence_for(holds: bool | None, parts: Iterable[Truth[Evidence]]) -> tuple[Evidence, ...]:
    """Return the evidence of the parts with one value."""
    return tuple(each for part in parts if part.holds is holds for each in part.evidence)


class Evaluator(ABC, Generic[Number, Evidence]):
    """Evaluate the syntax of conditions and numbers; a subclass is a vocabulary.

    `operators` are those of arithmetic. With `stops_early`, parts after one that decides are not evaluated; otherwise all
    of them are, as evidence.
    """

    operators: ClassVar[frozenset[str]] = frozenset("+-*/")
    stops_early: ClassVar[bool] = False

    # -- conditions -------------------------------------------------------------------------------

    def truth(self, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition holds."""
        match expr:
            case s.Logical(op=op, operands=operands):
                return self._combined(op, map(self.truth, operands))
            case s.Unary(op="not", operand=operand):
                return self.negated(operand, expr)
            case s.Compare():
                return self.comparison(expr)
            case _:
                return self.statement(expr)

    def comparison(self, expr: s.Compare) -> Truth[Evidence]:
        """Return whether each side of a chain of comparisons compares with the next."""
        pairs = itertools.pairwise([("", expr.first), *expr.rest])
        return self._combined("and", (self.compared(left, op, right, expr) for (_, left), (op, right) in pairs))

    def _combined(self, op: str, parts: Iterator[Truth[Evidence]]) -> Truth[Evidence]:
        return combine(op, _until(op == "or", parts) if self.stops_early else parts)

    def negated(self, operand: s.Expr, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition does not hold; `expr` is the whole, with `not`."""
        found = self.truth(operand)
        return Truth(None if found.holds is None else not found.holds, found.evidence)

    @abstractmethod
    def statement(self, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition of the vocabulary's own holds."""

    @abstractmethod
    def compared(self, left: s.Expr, op: str, right: s.Expr, chain: s.Compare) -> Truth[Evidence]:
        """Return whether two sides of a chain compare as written."""

    # -- numbers ----------------------------------------------------------------------------------

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
    def constant(self, value: int | float) -> Number:
        """Return a number as written."""

    @abstractmethod
    def arithmetic(self, op: str, *numbers: Number) -> Number:
        """Return the result of one of the `operators`, or of `neg`."""

    @abstractmethod
    def quantity(self, expr: s.Expr) -> Number:
        """Return a number of the vocabulary's own."""


def _until(deciding: bool, parts: Iterator[Truth[Evidence]]) -> Iterator[Truth[Evidence]]:
    """Yield parts up to the first that decides."""
    for part in parts:
        yield part
        if part.holds is deciding:
            return
