"""Evaluate findings and diagnoses on scores of seeds, and check them before there are any."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import chain
from typing import Any, NoReturn

import numpy as np

from taskspec.base.diagnostics import Collector, suggest
from taskspec.exact.rules.evaluator import Evaluator, Truth, Undecidable, combine, evidence_for
from taskspec.exact.solve.enclosure import Enclosure, compare
from taskspec.language.expressions import syntax as s
from taskspec.learn.documents.score_words import ABOUT_LEARNER, FIXED, FUNCTIONS, NUMBERS, QUANTIFIERS, SIDES, RuleNames
from taskspec.learn.documents.seed_scores import ONE, SeedScores
from taskspec.learn.statistics import CONFIDENCE, Estimate, estimate

_NUMERIC: dict[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "neg": np.negative,
    "abs": np.abs, "min": lambda *x: np.minimum.reduce(np.broadcast_arrays(*x)),
    "max": lambda *x: np.maximum.reduce(np.broadcast_arrays(*x)),
}  # fmt: skip


def check_rule(rule: s.Expr, names: RuleNames, collector: Collector) -> None:
    """Report every mistake in a rule: names, functions, arguments, and kinds of values."""
    ScoreEvaluator(SeedScores({}), names, collector=collector).truth(rule)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Evidence: the number that was compared, its estimate and interval, and the tasks and learners that it is about.

    If both sides rest on seeds, the number is their difference. `margin` is the distance of the interval of the difference
    of both sides from 0; negative if 0 is inside.
    """

    text: str
    value: float
    low: float
    high: float
    tasks: tuple[str, ...] = ()
    learners: tuple[str, ...] = ()
    margin: float = math.nan

    @property
    def is_missing(self) -> bool:
        """True if results that it needs are missing; the text names them."""
        return math.isnan(self.value)

    def __str__(self) -> str:
        if self.is_missing:
            return self.text
        if np.isinf(self.low):
            return f"{self.text} = {_number(self.value)}, of too few seeds for an interval"
        text = f"{self.text} = {_number(self.value)}"
        if self.low != self.high:
            text += f" [{_number(self.low)}, {_number(self.high)}]"
        return text


def _number(value: float) -> str:
    return f"{value:z.2f}".replace("-", "−")


@dataclass(frozen=True)
class ScoreEvaluator(Evaluator[Estimate, Comparison]):
    """Evaluate rules on the scores of one learner, or of several.

    Args:
        unable: tasks by learner that quantifiers pass over.
        bound: variables of comprehensions, each with its task or learner.
        of_means: whether numbers over seeds count as known exactly, without intervals.
        slack: by how much every comparison of scores may fail and still hold; negative to ask for more.
        confidence: of the intervals in which a comparison has to hold everywhere, or nowhere.
        made: takes every comparison that is made.
        collector: for mistakes in a rule that is only checked: one member of each group is tried.
    """

    scores: SeedScores
    names: RuleNames
    unable: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    bound: Mapping[str, str] = field(default_factory=dict)
    of_means: bool = False
    slack: float = 0.0
    confidence: float = CONFIDENCE
    made: list[Comparison] = field(default_factory=list)
    collector: Collector | None = None
    _known: dict[tuple[str, str, str, str], Estimate] = field(default_factory=dict)

    def statement(self, expr: s.Expr) -> Truth[Comparison]:
        if isinstance(expr, s.Boolean):
            return Truth(expr.value)
        try:
            match expr:
                case s.Call(function="most"):
                    parts = list(self._each(expr))
                    holds = self._holds(">", _counted(parts).map(np.subtract, Estimate.exactly(len(parts) / 2)))
                    return Truth(holds, evidence_for(holds, parts))
                case s.Call(function="all"):
                    return combine("and", self._each(expr))
                case s.Call(function="any"):
                    return combine("or", self._each(expr))
            self._fail("E306", expr, "a condition is needed here", "for example `score(task) > 0.9`")
        except Undecidable:  # a mistake, which is reported
            return Truth(None)

    def compared(self, left: s.Expr, op: str, right: s.Expr, chain: s.Compare) -> Truth[Comparison]:
        tasks, learners = self._subjects((left, right))
        try:
            if op in ("in", "not in"):
                self._fail("E316", right, "`in` is allowed only after the `if` of a comprehension")
            a = self.number(left)
            b = self.number(right)
        except Undecidable as error:
            return Truth(None, (Comparison(str(error), np.nan, -np.inf, np.inf, tasks, learners),))
        difference = a.map(np.subtract, b)
        if isinstance(left, s.Call) and left.function == "learns_from":  # no evidence, but what the rule is for
            return Truth(self._holds(op, difference))
        is_left_given = isinstance(left, s.Number | s.Unary)
        is_right_given = isinstance(right, s.Number | s.Unary)
        if is_left_given == is_right_given:
            number = difference
            text = f"{self._text(left)} − {self._text(right)}"
        elif is_right_given:
            number = a
            text = self._text(left)
        else:
            number = b
            text = self._text(right)
        low, high = difference.interval
        comparison = Comparison(text, number.value, *number.interval, tasks, learners, max(low, -high))
        self.made.append(comparison)
        slack = self._slack(op, (left, right))
        if slack != 0:
            difference = difference.map(np.add, Estimate.exactly(slack))
        return Truth(self._holds(op, difference), (comparison,))

    def _holds(self, op: str, difference: Estimate) -> bool | None:
        ends: list[Any] = list(difference.interval_at(self.confidence))
        for i, end in enumerate(ends):
            if math.isfinite(end):
                ends[i] = Fraction(end)
        return compare(op, Enclosure(*ends), Enclosure.exactly(0), Fraction(0))

    def _slack(self, op: str, exprs: Sequence[s.Expr]) -> float:
        """Return what is added to the difference of two sides; deviations between seeds are compared as they are."""
        for node in chain(*map(s.names, exprs)):
            if isinstance(node, s.Call) and node.function in NUMBERS and NUMBERS[node.function].statistic == "sd":
                return 0.0
        return {">": self.slack, ">=": self.slack, "<": -self.slack, "<=": -self.slack}.get(op, 0.0)

    def _subjects(self, exprs: Sequence[s.Expr]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        named: dict[str, None] = {}
        for node in chain(*map(s.names, exprs)):
            if isinstance(node, s.Name):
                named[self.bound.get(node.id, node.id)] = None
        tasks = (*self.names.tasks, *self.names.instances)
        return tuple(filter(tasks.__contains__, named)), tuple(filter(self.names.learners.__contains__, named))

    def _text(self, expr: s.Expr) -> str:
        written = expr.place.written
        if not self.bound:
            return written
        variables = rf"\b({'|'.join(map(re.escape, self.bound))})\b"
        return re.sub(variables, lambda match: self.bound[match[1]], written)

    def constant(self, value: int | float) -> Estimate:
        return Estimate.exactly(float(value))

    def arithmetic(self, op: str, *numbers: Estimate) -> Estimate:
        return numbers[0].map(_NUMERIC[op], *numbers[1:])

    def quantity(self, expr: s.Expr) -> Estimate:
        """Return a number over seeds."""
        match expr:
            case s.Call(function="count"):
                return _counted(list(self._each(expr)))
            case s.Call(function="mean"):
                return self._mean(expr)
            case s.Call(function=name, args=args, keywords=keywords) if name in FUNCTIONS:
                low, high, _ = FUNCTIONS[name]
                if keywords or not low <= len(args) <= high:
                    count = f"{low} or more" if low < high else str(low)
                    self._fail("E304", expr, f"{name} takes {count} numbers")
                return self.arithmetic(name, *map(self.number, args))
            case s.Call(function=name) if name in NUMBERS or name in FIXED:
                return self._over_seeds(expr)
            case s.Call(function=name, args=args) if name in ABOUT_LEARNER and not self.names.learners:
                _, known = ABOUT_LEARNER[name]
                if expr.keywords or len(args) != 1:
                    self._fail("E304", expr, f"{name} takes one name", f"one of {', '.join(known)}")
                what = self._name(args[0], known, {"learns_from": "source", "used": "amount"}[name])
                return Estimate.exactly(self.scores.about_learner(name, what))
            case s.Call(function=name):
                known = (*NUMBERS, *FIXED, *ABOUT_LEARNER, *FUNCTIONS, *QUANTIFIERS)
                hint = suggest(name, known) or f"there are {', '.join(known)}"
                self._fail("E303", expr, f"there is no function '{name}' in rules", hint)
            case s.Name(id=name):
                self._fail("E306", expr, f"a number is needed here, not '{name}'", f"for example `score({name})`")
            case _:
                self._fail("E306", expr, "a number is needed here", "for example `score(task)`")

    def _over_seeds(self, expr: s.Call) -> Estimate:
        """Return a number about `(learner, task, side)`: a learner if there are several, and optionally a side."""
        name = expr.function
        args = expr.args
        kinds = ["task"]
        if self.names.learners and name in NUMBERS:
            kinds = ["learner", "task"]
        has_sides = name in NUMBERS
        if expr.keywords or not len(kinds) <= len(args) <= len(kinds) + has_sides:
            hint = None
            if has_sides:
                hint = f"behind them may stand {', '.join(SIDES)}"
            self._fail("E304", expr, f"{name} takes other arguments: {name}({', '.join(kinds)})", hint)
        *learners, task = map(self._member, args, kinds)
        learner = learners[0] if learners else ONE
        side = "printed"
        if len(args) > len(kinds):
            side = self._name(args[-1], tuple(SIDES), "side of a task")
        if name in FIXED:
            return Estimate.exactly(self.scores.constant(task))
        key = (name, learner, task, side)
        if key not in self._known:
            values = self.scores.values(learner, task, side, NUMBERS[name].entry)
            number = estimate(values, NUMBERS[name].statistic, "/".join(key[1:]))
            if self.of_means:
                number = Estimate.exactly(number.value)
            self._known[key] = number
        return self._known[key]

    def _member(self, expr: s.Expr, kind: str) -> str:
        if isinstance(expr, s.Name) and expr.id in self.bound:
            member = self.bound[expr.id]
            if self._kind_of(member) != kind:
                self._fail("E306", expr, f"'{expr.id}' is a {self._kind_of(member)} here; a {kind} is needed")
            return member
        known = self.names.learners
        if kind == "task":
            known = (*self.names.tasks, *self.names.instances)
        return self._name(expr, known, kind, tuple(self.bound))

    def _kind_of(self, member: str) -> str:
        if member in self.names.learners:
            return "learner"
        return "task"

    def _name(self, expr: s.Expr, known: tuple[str, ...], kind: str, others: tuple[str, ...] = ()) -> str:
        if not isinstance(expr, s.Name) or expr.primed:
            self._fail("E306", expr, f"the name of a {kind} is needed here", f"one of {', '.join(known)}")
        if expr.id not in known:
            hint = suggest(expr.id, (*known, *others)) or f"one of {', '.join(known)}"
            self._fail("E302", expr, f"there is no {kind} '{expr.id}' here", hint)
        return expr.id

    def _each(self, expr: s.Call) -> Iterator[Truth[Comparison]]:
        """Yield whether a condition holds, for each member of a group."""
        for inner, condition in self._of_members(expr, "a condition", "score(t) > 0.9"):
            yield inner.truth(condition)

    def _mean(self, expr: s.Call) -> Estimate:
        """Return the mean of a number over the members of a group that have it for more than one seed."""
        numbers = []
        missing = "there are too few results for a mean"
        for inner, element in self._of_members(expr, "a number", "score(t)"):
            try:
                number = inner.number(element)
            except Undecidable as error:
                missing = str(error)
                continue
            if not np.isnan(number.draws).any():
                numbers.append(number)
        if not numbers:
            raise Undecidable(missing)
        first, *others = numbers
        return first.map(lambda *each: sum(each) / len(each), *others)

    def _of_members(self, expr: s.Call, needed: str, example: str) -> Iterator[tuple[ScoreEvaluator, s.Expr]]:
        """Yield an evaluator for each member of a group, and the element of the comprehension."""
        if len(expr.args) != 1 or expr.keywords or not isinstance(expr.args[0], s.Comprehension):
            hint = f"`{expr.function}({example} for t in tasks)`"
            self._fail("E304", expr, f"{expr.function} takes {needed} for each of some tasks", hint)
        comprehension = expr.args[0]
        for inner in self._chosen(comprehension.clauses):
            if not (self.unable and inner._is_about_unable(comprehension.element)):
                yield inner, comprehension.element

    def _is_about_unable(self, condition: s.Expr) -> bool:
        tasks, learners = self._subjects((condition,))
        unable = chain(*(self.unable.get(learner, ()) for learner in learners))
        return not set(tasks).isdisjoint(unable)

    def _chosen(self, clauses: Sequence[s.Clause]) -> Iterator[ScoreEvaluator]:
        if not clauses:
            yield self
            return
        clause, *rest = clauses
        members = self._members(clause.domain)
        if len(clause.targets) != 1:
            self._fail("E316", clause.domain, "one variable goes through a group")
        if self.collector is not None:
            members = members[:1]
        for member in members:
            inner = replace(self, bound={**self.bound, clause.targets[0]: member})
            passes = list(map(inner._passes, clause.conditions))
            if all(passes) or self.collector is not None:
                yield from inner._chosen(rest)

    def _members(self, expr: s.Expr) -> tuple[str, ...]:
        match expr:
            case s.Name(id=name):
                members = self.names.all_groups.get(name)
                if members is None:
                    self._name(expr, tuple(self.names.all_groups), "group")
                return members or ()
            case s.SetOf(items=items) | s.Vector(items=items):
                unbound = replace(self, bound={})
                kind = "task"
                if any(isinstance(item, s.Name) and item.id in self.names.learners for item in items):
                    kind = "learner"
                return tuple(unbound._member(item, kind) for item in items)
            case _:
                self._fail("E306", expr, "a group is needed here", f"one of {', '.join(tuple(self.names.all_groups))}")

    def _passes(self, expr: s.Expr) -> bool:
        match expr:
            case s.Logical(op=op, operands=operands):
                passed = list(map(self._passes, operands))
                return {"and": all, "or": any}[op](passed)
            case s.Compare(first=s.Name(id=name), rest=(("in" | "not in" as op, others),)) if name in self.bound:
                return (self.bound[name] in self._members(others)) is (op == "in")
            case s.Compare(first=s.Name(id=name), rest=(("==" | "!=" as op, other),)) if name in self.bound:
                member = self.bound[name]
                return (member == self._member(other, self._kind_of(member))) is (op == "==")
        hint = "for example `if t != Sort`, or `if t not in {Sort, Parabola}`"
        self._fail("E316", expr, "a group is narrowed by names only", hint)

    def _fail(self, code: str, expr: s.Expr, message: str, hint: str | None = None) -> NoReturn:
        assert self.collector is not None, message
        place = expr.place
        if code == "E303" and isinstance(expr, s.Call):
            place = expr.name_place
        self.collector.add(code, place, message, hint)
        raise Undecidable(message)


def _counted(parts: Sequence[Truth[Comparison]]) -> Estimate:
    """Return how many parts hold: an interval if some are undecided."""
    true = sum(part.holds is True for part in parts)
    undecided = sum(part.holds is None for part in parts)
    if undecided:
        return Estimate.between(true, true + undecided)
    return Estimate.exactly(true)
