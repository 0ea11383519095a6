"""Evaluate findings and diagnoses on scores of seeds; an interval that leaves a comparison open leaves it undecided."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang import syntax as s
from taskspec.rollout.statistics import Estimate, estimate
from taskspec.rules.evaluator import Evaluator, Truth, Undecidable, combine, evidence_for
from taskspec.rules.scores import NUMBERS, RuleNames
from taskspec.solve.enclosure import Enclosure, compare

# -- scores -------------------------------------------------------------------------------------------

ONE = ""
"""The learner where there is only one."""
_VERSIONED = re.compile(r"(?:[^?+]*/)?([^?+]+?)(?:-v\d+)?([?+].*)?")


def side(score: Mapping[str, Any]) -> str:
    """Return the side of a task that a score belongs to: "printed", "twin", or the name of a probe."""
    return score["probe"] or ("printed" if score["twin"] is None else "twin")


def short_name(task: str) -> str:
    """Return the name of a task in rules: `NoisyObs?L=50` for `derail/NoisyObs-v0?L=50`."""
    found = _VERSIONED.fullmatch(task)
    return found[1] + (found[2] or "") if found else task


class SeedScores:
    """Scores of learners, by learner, task and side.

    Args:
        exams: results by the name of the learner, as `exam.json` holds them; of one learner under the name `ONE`.
        floor: lower scores are raised to it.
        drawn: whether policies sample their actions, instead of taking their best ones.
        same: names of tasks that count as others, where those were not run.
        instances: names in rules of tasks at other values of parameters, by their own names.
    """

    def __init__(
        self, exams: Mapping[str, Mapping[str, Any]], floor: float | None = None, drawn: bool = False,
        same: Mapping[str, str] | None = None, instances: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
        self.floor = floor
        self.drawn = drawn
        self.records: dict[tuple[str, str, str], list[Mapping[str, Any]]] = defaultdict(list)
        self.tasks: dict[str, Mapping[str, Any]] = {}
        self.ids: dict[str, str] = {}
        renamed = {**(same or {}), **(instances or {})}
        for learner, exam in exams.items():
            own = {short_name(task) for task in exam["tasks"]}
            names = {task: _name_in_rules(short_name(task), own, renamed) for task in exam["tasks"]}
            for task, about in exam["tasks"].items():
                self.ids[names[task]] = task
                self.tasks[names[task]] = about
            for record in exam["scores"]:
                self.records[learner, names[record["task"]], side(record)].append(record)

    def values(self, learner: str, task: str, side: str, entry: str) -> Array:
        """Return one number for each seed (n,), seeds in order; the mean over twins if there are several.

        Raises:
            Undecidable: if there are none.
        """
        entry = "stochastic" if self.drawn and entry == "deterministic" else entry
        by_seed: dict[int, list[float]] = defaultdict(list)
        for record in self.records.get((learner, task, side), ()):
            if record.get("error") is None and record.get(entry) is not None:
                by_seed[record["seed"]].append(float(record[entry]))
        if not by_seed:
            of = f"{learner} on " if learner else ""
            raise Undecidable(f"there are no results of {of}{_side_in_words(task, side)}")
        found = np.array([np.mean(by_seed[seed]) for seed in sorted(by_seed)])
        is_score = entry in ("deterministic", "stochastic")
        return np.maximum(found, self.floor) if is_score and self.floor is not None else found

    def constant(self, task: str) -> float:
        """Return the score of the best constant action.

        Raises:
            Undecidable: if it is not known.
        """
        found = self.tasks.get(task, {}).get("constant")
        if found is None:
            raise Undecidable(f"the best constant action of {task} is not known")
        return float(found)


def _name_in_rules(task: str, own: Set[str], same: Mapping[str, str]) -> str:
    other = same.get(task, task)
    return task if other in own else other


def _side_in_words(task: str, side: str) -> str:
    return {"printed": task, "twin": f"twins of {task}"}.get(side, f"{task} with the reward {side}")


# -- evaluation ---------------------------------------------------------------------------------------

_NUMERIC: dict[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide,
    "abs": np.abs, "min": lambda *x: np.minimum.reduce(np.broadcast_arrays(*x)),
    "max": lambda *x: np.maximum.reduce(np.broadcast_arrays(*x)),
}  # fmt: skip


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
        """Whether results that it needs are missing; the text says which."""
        return math.isnan(self.value)

    def __str__(self) -> str:
        if self.is_missing:
            return self.text
        if np.isinf(self.low):
            return f"{self.text} = {_number(self.value)}, of too few seeds for an interval"
        interval = "" if self.low == self.high else f" [{_number(self.low)}, {_number(self.high)}]"
        return f"{self.text} = {_number(self.value)}{interval}"


def _number(value: float) -> str:
    text = f"{value:.2f}"
    return ("0.00" if text == "-0.00" else text).replace("-", "−")


@dataclass(frozen=True)
class ScoreEvaluator(Evaluator[Estimate, Comparison]):
    """Evaluate checked rules on the scores of one learner, or of several.

    Args:
        unable: tasks by learner that quantifiers pass over.
        bound: variables of comprehensions, each with its task or learner.
    """

    scores: SeedScores
    names: RuleNames
    unable: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    bound: Mapping[str, str] = field(default_factory=dict)
    _known: dict[tuple[str, str, str, str], Estimate] = field(default_factory=dict)

    # -- conditions -------------------------------------------------------------------------------

    def statement(self, expr: s.Expr) -> Truth[Comparison]:
        match expr:
            case s.Boolean(value=value):
                return Truth(value)
            case s.Call(function="most"):
                parts = list(self._each(expr))
                holds = _compare(">", _counted(parts).map(lambda n: n - len(parts) / 2))
                return Truth(holds, evidence_for(holds, parts))
            case s.Call(function="all"):
                return combine("and", self._each(expr))
            case s.Call(function="any"):
                return combine("or", self._each(expr))
        raise AssertionError(f"no condition: {expr}")

    def compared(self, left: s.Expr, op: str, right: s.Expr, chain: s.Compare) -> Truth[Comparison]:
        tasks, learners = self._subjects((left, right))
        try:
            a, b = self.number(left), self.number(right)
        except Undecidable as error:
            return Truth(None, (Comparison(str(error), np.nan, -np.inf, np.inf, tasks, learners),))
        difference = a.map(np.subtract, b)
        estimated = [(e, n) for e, n in ((left, a), (right, b)) if not isinstance(e, s.Number | s.Unary)]
        if len(estimated) == 1:
            side, number = estimated[0]
            text = self._text(side)
        else:
            number = difference
            text = f"{self._text(left)} − {self._text(right)}"
        low, high = difference.interval
        found = Comparison(text, number.value, *number.interval, tasks, learners, max(low, -high))
        return Truth(_compare(op, difference), (found,))

    def _subjects(self, exprs: Sequence[s.Expr]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the tasks and the learners that are named in some expressions, in order."""
        names = [n.id for expr in exprs for n in s.names(expr) if isinstance(n, s.Name)]
        ids = dict.fromkeys(self.bound.get(name, name) for name in names)
        known = (*self.names.tasks, *self.names.instances)
        return tuple(i for i in ids if i in known), tuple(i for i in ids if i in self.names.learners)

    def _text(self, expr: s.Expr) -> str:
        """Return an expression as it is written, with the members of groups for their variables."""
        written = expr.place.written
        if not self.bound:
            return written
        variables = rf"\b({'|'.join(map(re.escape, self.bound))})\b"
        return re.sub(variables, lambda found: self.bound[found[1]], written)

    # -- numbers ----------------------------------------------------------------------------------

    def constant(self, value: int | float) -> Estimate:
        return Estimate.exactly(float(value))

    def negative(self, number: Estimate) -> Estimate:
        return number.map(np.negative)

    def arithmetic(self, op: str, left: Estimate, right: Estimate) -> Estimate:
        return left.map(_NUMERIC[op], right)

    def quantity(self, expr: s.Expr) -> Estimate:
        """Return a number over seeds.

        Raises:
            Undecidable: if results that it needs are missing.
        """
        match expr:
            case s.Call(function="count"):
                return _counted(list(self._each(expr)))
            case s.Call(function=name, args=args) if name in _NUMERIC:
                first, *others = map(self.number, args)
                return first.map(_NUMERIC[name], *others)
            case s.Call(function=name, args=args):
                subject = [self.bound.get(a.id, a.id) for a in args if isinstance(a, s.Name)]
                return self._over_seeds(name, subject)
        raise AssertionError(f"no number: {expr}")

    def _over_seeds(self, name: str, subject: list[str]) -> Estimate:
        if name not in NUMBERS:
            return Estimate.exactly(self.scores.constant(subject[0]))
        learner = subject.pop(0) if self.names.learners else ONE
        task = subject[0]
        side = subject[1] if len(subject) > 1 else "printed"
        key = (name, learner, task, side)
        if key not in self._known:
            values = self.scores.values(learner, task, side, NUMBERS[name].entry)
            self._known[key] = estimate(values, NUMBERS[name].statistic, "/".join(key[1:]))
        return self._known[key]

    # -- quantifiers ------------------------------------------------------------------------------

    def _each(self, expr: s.Call) -> Iterator[Truth[Comparison]]:
        """Yield the condition of a quantifier for each member of its groups."""
        comprehension = expr.args[0]
        assert isinstance(comprehension, s.Comprehension)
        for inner in self._chosen(comprehension.clauses):
            tasks, learners = inner._subjects((comprehension.element,))
            if not any(task in self.unable.get(learner, ()) for learner in learners for task in tasks):
                yield inner.truth(comprehension.element)

    def _chosen(self, clauses: Sequence[s.Clause]) -> Iterator[ScoreEvaluator]:
        """Yield an evaluator for each choice of members that the filters let through."""
        if not clauses:
            yield self
            return
        clause, *rest = clauses
        for member in self.names.members(clause.domain):
            inner = replace(self, bound={**self.bound, clause.targets[0]: member})
            if all(map(inner._passes, clause.conditions)):
                yield from inner._chosen(rest)

    def _passes(self, expr: s.Expr) -> bool:
        match expr:
            case s.Logical(op=op, operands=operands):
                return (all if op == "and" else any)(map(self._passes, operands))
            case s.Compare(first=s.Name(id=name), rest=((op, s.Name(id=other)),)) if op in ("==", "!="):
                return (self.bound[name] == self.bound.get(other, other)) is (op == "==")
            case s.Compare(first=s.Name(id=name), rest=((op, others),)):
                return (self.bound[name] in self.names.members(others)) is (op == "in")
        raise AssertionError(f"no filter: {expr}")


def _counted(parts: Sequence[Truth[Comparison]]) -> Estimate:
    """Return how many parts hold: an interval if some are undecided."""
    true = sum(part.holds is True for part in parts)
    undecided = sum(part.holds is None for part in parts)
    return Estimate.between(true, true + undecided) if undecided else Estimate.exactly(true)


def _compare(op: str, difference: Estimate) -> bool | None:
    """Return whether the left side is greater, smaller or equal, by the interval of the difference of both."""
    low, high = (end if math.isinf(end) else Fraction(end) for end in difference.interval)
    return compare(op, Enclosure(low, high), Enclosure.exactly(0), Fraction(0))
