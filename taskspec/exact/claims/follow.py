"""What a task says beside what an example says: compared value by value, outcome by outcome, or form by form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector
from taskspec.exact.model.outcomes import FLOATS, branches, count, is_finite
from taskspec.exact.model.space import plain, words
from taskspec.exact.planning.certified.rational import Chances
from taskspec.exact.planning.certified.readings import Inexact, Reader
from taskspec.lang import syntax as s
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Draw, Node, draws
from taskspec.lang.normal import NormalForms
from taskspec.lang.variates.entry import ProbabilityArithmetic
from taskspec.task.task import Component, Example

Array = np.ndarray[Any, Any]
MOST_OUTCOMES, MOST_NUMBERS = 100_000, 2_000_000
RELATIVE, ABSOLUTE, CHANCE = 1e-9, 1e-12, 1e-9
"""How far apart equal numbers may be, and equal probabilities that are not known exactly."""


@dataclass(frozen=True)
class Consequence:
    """One thing that follows: in words, as a component, as the task has it, as the example has it, and where."""

    what: str
    component: Component
    actual: Node
    expected: Node
    expr: s.Expr


@dataclass(frozen=True)
class JointOutcomes:
    """Values (K, elements) of some nodes together, with their probabilities (K,) as rationals or floats."""

    values: Array
    weights: Array

    def chance(self, row: Array) -> float | Fraction:
        """How likely some values are."""
        nothing = Fraction(0) if self.weights.dtype == object else 0.0
        return sum(self.weights[_close(self.values, row)].tolist(), nothing)

    def merged(self) -> JointOutcomes:
        """With each of the values once, in order."""
        distinct, which = np.unique(self.values, axis=0, return_inverse=True)
        order = np.argsort(which.reshape(-1), kind="stable")
        starts = np.searchsorted(which.reshape(-1)[order], np.arange(len(distinct)))
        return JointOutcomes(distinct, np.add.reduceat(self.weights[order], starts))


def _close(rows: Array, row: Array) -> Array:
    with np.errstate(invalid="ignore"):  # infinite values are equal to themselves
        near = np.abs(rows - row) <= ABSOLUTE + RELATIVE * np.maximum(np.abs(rows), np.abs(row))
    return np.asarray(((rows == row) | near | (np.isnan(rows) & np.isnan(row))).all(axis=1))


def _alike(one: float | Fraction, other: float | Fraction) -> bool:
    """Whether two probabilities are equal: exactly where both are known exactly."""
    if isinstance(one, Fraction) and isinstance(other, Fraction):
        return one == other
    return abs(float(one) - float(other)) <= CHANCE


def outcomes(nodes: Sequence[Node]) -> JointOutcomes | None:
    """All values that can come of some nodes that read nothing, each once; None where there is no end to them, or too many."""
    found = listed(nodes)
    return None if found is None else found.merged()


def listed(nodes: Sequence[Node]) -> JointOutcomes | None:
    """The same, a value as often as draws lead to it."""
    found = draws(nodes)
    size = sum(node.type.size for node in (*nodes, *found))
    if not all(map(is_finite, found)) or count(found, {}) > min(MOST_OUTCOMES, MOST_NUMBERS / max(1, size)):
        return None
    try:
        return _enumerated(nodes, found, Chances(Reader(as_written=True)))
    except Inexact:
        return _enumerated(nodes, found, FLOATS)


def _enumerated(nodes: Sequence[Node], found: Sequence[Draw], numbers: ProbabilityArithmetic) -> JointOutcomes:
    """Outcomes of the draws one after the other, with probabilities as rationals or as floats."""
    rows, weights = [], []
    for branch in branches(found, {}, 1, numbers):
        n = 1 if branch.origin is None else len(branch.origin)
        values = evaluate(nodes, {}, branch.sample)
        flat = [np.broadcast_to(v, (*v.shape[:-1], n)).reshape(-1, n) for v in values]
        rows.append(np.concatenate(flat).T.astype(np.float64))
        weights.append(np.broadcast_to(branch.weight, (n,)))
    return JointOutcomes(np.concatenate(rows), np.concatenate(weights))


def compare(asked: Consequence, collector: Collector) -> None:
    """Report one thing that does not follow as the example says."""
    actual, expected = outcomes([asked.actual]), outcomes([asked.expected])
    if actual is None or expected is None:
        _compare_forms(asked, collector)
        return
    if all(_alike(actual.chance(row), p) for row, p in zip(expected.values, expected.weights, strict=True)):
        return
    message = f"{asked.what} is {_told(asked.component, actual)}, not {_told(asked.component, expected)}"
    collector.add("E611", asked.expr.place, message)


def _compare_forms(asked: Consequence, collector: Collector) -> None:
    """Distributions that cannot be enumerated are the same when they are written alike."""
    forms = NormalForms()
    if forms.all([asked.actual]) == forms.all([asked.expected]):
        return
    if not draws([asked.expected]):
        message = f"{asked.what} is drawn from a distribution with infinitely many outcomes, so it is not always {_value(asked)}"
        collector.add("E611", asked.expr.place, message, "write the distribution")
        return
    message = f"{asked.what} is drawn in another way, which may be the same or not"
    collector.add("E612", asked.expr.place, message, "write the distribution as the spec does")


def likely(asked: Sequence[Consequence], chance: Fraction, example: Example, collector: Collector) -> None:
    """Report a set of values that is not as likely as the example says."""
    actual = listed([a.actual for a in asked])
    expected = outcomes([a.expected for a in asked])
    if actual is None:
        message = "the probability cannot be computed: the draws have infinitely many, or too many, outcomes"
        collector.add("E612", example.place, message)
    elif expected is None or len(expected.values) > 1:
        collector.add("E613", example.place, "with a probability, give one value for each name")
    elif not _alike(actual.chance(expected.values[0]), chance):
        message = f"this has a probability of {_number(actual.chance(expected.values[0]))}, not {_number(chance)}"
        collector.add("E611", example.probability.place if example.probability else example.place, message)


# -- words ----------------------------------------------------------------------------------------


def _told(c: Component, found: JointOutcomes) -> str:
    """A value, or a few of many with their probabilities."""
    order = np.argsort(-found.weights, kind="stable")
    told = [_one(c, found.values[i]) for i in order[:4]]
    if len(order) == 1:
        return told[0]
    chances = [_number(found.weights[i]) for i in order[:4]]
    parts = [f"{value} ({p})" for value, p in zip(told, chances, strict=True)]
    return ", ".join(parts) + (", ..." if len(order) > 4 else "")


def _one(c: Component, row: Array) -> str:
    kind = {0: np.bool_, 1: np.int64, 2: np.float64}[int(c.type.kind)]
    return words(plain(c, row.reshape(c.type.shape).astype(kind)))


def _value(asked: Consequence) -> str:
    found = outcomes([asked.expected])
    return "this" if found is None else _told(asked.component, found)


def _number(p: float | Fraction) -> str:
    ratio = Fraction(p).limit_denominator(1000)
    return str(ratio) if abs(ratio - Fraction(p)) <= 1e-12 else f"{float(p):.6g}"
