"""Judge rules on results: true, false, or undecided where an interval leaves both open."""

from __future__ import annotations

import itertools
import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exam.rules.check import NUMBERS, RuleNames
from taskspec.exam.verdicts import side
from taskspec.lang import syntax as s
from taskspec.rollout.statistics import Estimate, estimate
from taskspec.rules.vocabulary import Undecidable

# ---------- samples
# The results that rules are about: scores of seeds, by learner, task and side.

ONE = ""
"""The learner where there is only one."""
_VERSIONED = re.compile(r"(?:[^?+]*/)?([^?+]+?)(?:-v\d+)?([?+].*)?")


def short(task: str) -> str:
    """The name of a task in rules: `NoisyObs?L=50` for `derail/NoisyObs-v0?L=50`."""
    found = _VERSIONED.fullmatch(task)
    return found[1] + (found[2] or "") if found else task


class SeedScores:
    """Results of learners by name, as `exam.json` holds them; of one learner under the name `ONE`.

    Args:
        exams: results by the name of the learner.
        floor: scores below it count as it.
        drawn: whether scores are those of policies that draw their actions, instead of those that take their best ones.
        same: names of tasks that count as others, where those were not run.
        instances: names of tasks at some values, by those.
    """

    def __init__(
        self, exams: Mapping[str, Mapping[str, Any]], floor: float | None = None, drawn: bool = False,
        same: Mapping[str, str] | None = None, instances: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
        self.floor, self.drawn = floor, drawn
        self.records: dict[tuple[str, str, str], list[Mapping[str, Any]]] = defaultdict(list)
        self.tasks: dict[str, Mapping[str, Any]] = {}
        self.ids: dict[str, str] = {}
        for learner, exam in exams.items():
            own = {short(task) for task in exam["tasks"]}
            called = {
                task: _known_as(short(task), own, {**(same or {}), **(instances or {})}) for task in exam["tasks"]
            }
            self.ids |= {called[task]: task for task in exam["tasks"]}
            self.tasks |= {called[task]: about for task, about in exam["tasks"].items()}
            for record in exam["scores"]:
                self.records[learner, called[record["task"]], side(record)].append(record)

    def values(self, learner: str, task: str, side: str, entry: str) -> Array:
        """One number for each seed, the mean over the twins where it was run on several, seeds in order.

        Raises:
            Undecidable: where there is none.
        """
        entry = "stochastic" if self.drawn and entry == "deterministic" else entry
        by_seed: dict[int, list[float]] = defaultdict(list)
        for record in self.records.get((learner, task, side), ()):
            if record.get("error") is None and record.get(entry) is not None:
                by_seed[record["seed"]].append(float(record[entry]))
        if not by_seed:
            raise Undecidable(f"there are no results of {f'{learner} on ' if learner else ''}{_called(task, side)}")
        found = np.array([np.mean(by_seed[seed]) for seed in sorted(by_seed)])
        is_score = entry in ("deterministic", "stochastic")
        return np.maximum(found, self.floor) if is_score and self.floor is not None else found

    def constant(self, task: str) -> float:
        """The score of the best action that is taken always.

        Raises:
            Undecidable: where it is not known.
        """
        about = self.tasks.get(task, {})
        found = about.get("constant")
        if found is None:
            raise Undecidable(f"the best constant action of {task} is not known")
        return float(found)


def _known_as(task: str, own: Set[str], same: Mapping[str, str]) -> str:
    other = same.get(task, task)
    return task if other in own else other


def _called(task: str, side: str) -> str:
    return {"printed": task, "twin": f"twins of {task}"}.get(side, f"{task} with the reward {side}")


# ---------- judge
# Judges rules on results: true, false, or undecided where a bootstrap interval leaves a comparison open.

Bound = Mapping[str, str]
"""Variables of comprehensions, each with the task or learner that it stands for."""
_NUMERIC: dict[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide,
    "abs": np.abs, "min": lambda *x: np.minimum.reduce(np.broadcast_arrays(*x)),
    "max": lambda *x: np.maximum.reduce(np.broadcast_arrays(*x)),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Compared:
    """One comparison: what was compared, its estimate and interval, and which tasks and learners it is about.

    Of two sides that both rest on seeds, the number is their difference. `margin` is how far the interval of the difference of
    both sides reaches beyond 0, on the side on which it lies; below 0, how far it reaches to the other side.
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
        """Whether results that it needs are not there; the text says which."""
        return math.isnan(self.value)

    def __str__(self) -> str:
        if self.is_missing:
            return self.text
        if np.isinf(self.low):
            return f"{self.text} = {_number(self.value)}, of too few seeds for an interval"
        exactly = self.low == self.high
        return (
            f"{self.text} = {_number(self.value)}{'' if exactly else f' [{_number(self.low)}, {_number(self.high)}]'}"
        )


def _number(value: float) -> str:
    text = f"{value:.2f}"
    return ("0.00" if text == "-0.00" else text).replace("-", "−")


@dataclass(frozen=True, slots=True)
class Judged:
    """Whether a condition holds (None: undecided), and the comparisons that decide it, or leave it open."""

    holds: bool | None
    seen: tuple[Compared, ...] = ()

    @property
    def tasks(self) -> tuple[str, ...]:
        """The tasks that it is about, in order."""
        return tuple(dict.fromkeys(task for each in self.seen for task in each.tasks))


class Judge:
    """Judges rules over the results of one learner, or of several.

    `unable` lists tasks by learner that quantifiers pass over.
    """

    def __init__(
        self, samples: SeedScores, names: RuleNames, unable: Mapping[str, tuple[str, ...]] | None = None
    ) -> None:
        self.samples, self.names, self.unable = samples, names, unable or {}
        self._known: dict[tuple[str, str, str, str], Estimate] = {}

    def condition(self, expr: s.Expr, bound: Bound | None = None) -> Judged:
        """Whether a checked condition holds."""
        bound = bound or {}
        match expr:
            case s.Boolean(value=value):
                return Judged(value)
            case s.Logical(op=op, operands=operands):
                return _combined(op, [self.condition(each, bound) for each in operands])
            case s.Unary(operand=operand):
                inner = self.condition(operand, bound)
                return Judged(None if inner.holds is None else not inner.holds, inner.seen)
            case s.Call(function="most"):
                found = list(self._each(expr, bound))
                more = _compare(">", _counted(found).map(lambda n: n - len(found) / 2))
                return Judged(more, _seen(found, more))
            case s.Call(function=name):
                return _combined("and" if name == "all" else "or", list(self._each(expr, bound)))
            case s.Compare(first=first, rest=rest):
                pairs = itertools.pairwise([("", first), *rest])
                return _combined("and", [self._compared(a, op, b, bound) for (_, a), (op, b) in pairs])
        raise AssertionError(f"no condition: {expr}")

    def _compared(self, left: s.Expr, op: str, right: s.Expr, bound: Bound) -> Judged:
        tasks, learners = self._about((left, right), bound)
        try:
            a, b = self.number(left, bound), self.number(right, bound)
        except Undecidable as error:
            return Judged(None, (Compared(str(error), np.nan, -np.inf, np.inf, tasks, learners),))
        difference = a.map(np.subtract, b)
        low, high = difference.interval
        shown = [(_text(e, bound), n) for e, n in ((left, a), (right, b)) if not isinstance(e, s.Number | s.Unary)]
        if len(shown) == 1:
            text, number = shown[0]
        else:
            text, number = f"{_text(left, bound)} − {_text(right, bound)}", difference
        return Judged(
            _compare(op, difference),
            (Compared(text, number.value, *number.interval, tasks, learners, max(low, -high)),),
        )

    def _about(self, exprs: tuple[s.Expr, ...], bound: Bound) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The tasks and learners that are named below some expressions."""
        ids = [bound.get(n.id, n.id) for e in exprs for n in s.names(e) if isinstance(n, s.Name)]
        tasks = (*self.names.tasks, *self.names.instances)
        found = [tuple(dict.fromkeys(i for i in ids if i in known)) for known in (tasks, self.names.learners)]
        return found[0], found[1]

    # -- numbers -------------------------------------------------------------------------------------

    def number(self, expr: s.Expr, bound: Bound) -> Estimate:
        """The value of a checked number.

        Raises:
            Undecidable: where results that it needs are missing.
        """
        match expr:
            case s.Number(value=value):
                return Estimate.exactly(float(value))
            case s.Unary(op=op, operand=operand):
                inner = self.number(operand, bound)
                return inner.map(np.negative) if op == "-" else inner
            case s.Binary(op=op, left=left, right=right):
                return self.number(left, bound).map(_NUMERIC[op], self.number(right, bound))
            case s.Call(function="count"):
                return _counted(list(self._each(expr, bound)))
            case s.Call(function=name, args=args) if name in _NUMERIC:
                first, *others = (self.number(each, bound) for each in args)
                return first.map(_NUMERIC[name], *others)
            case s.Call(function=name, args=args):
                return self._told(name, [bound.get(a.id, a.id) for a in args if isinstance(a, s.Name)])
        raise AssertionError(f"no number: {expr}")

    def _told(self, name: str, about: list[str]) -> Estimate:
        if name not in NUMBERS:
            return Estimate.exactly(self.samples.constant(about[0]))
        learner = about.pop(0) if self.names.learners else ONE
        task, side = about[0], about[1] if len(about) > 1 else "printed"
        key = (name, learner, task, side)
        if key not in self._known:
            values = self.samples.values(learner, task, side, NUMBERS[name].entry)
            self._known[key] = estimate(values, NUMBERS[name].statistic, "/".join(key[1:]))
        return self._known[key]

    # -- quantifiers ---------------------------------------------------------------------------------

    def _each(self, expr: s.Call, bound: Bound) -> Iterator[Judged]:
        """The condition of a quantifier, judged for each member."""
        comprehension = expr.args[0]
        assert isinstance(comprehension, s.Comprehension)
        for chosen in self._chosen(comprehension.clauses, dict(bound)):
            tasks, learners = self._about((comprehension.element,), chosen)
            if not any(task in self.unable.get(learner, ()) for learner in learners for task in tasks):
                yield self.condition(comprehension.element, chosen)

    def _chosen(self, clauses: tuple[s.Clause, ...], bound: dict[str, str]) -> Iterator[dict[str, str]]:
        if not clauses:
            yield bound
            return
        clause, *rest = clauses
        for member in self._members(clause.domain):
            inner = bound | {clause.targets[0]: member}
            if all(self._passes(condition, inner) for condition in clause.conditions):
                yield from self._chosen(tuple(rest), inner)

    def _members(self, expr: s.Expr) -> tuple[str, ...]:
        if isinstance(expr, s.Name):
            return self.names.group(expr.id) or ()
        assert isinstance(expr, s.SetOf | s.Vector)
        return tuple(item.id for item in expr.items if isinstance(item, s.Name))

    def _passes(self, expr: s.Expr, bound: Bound) -> bool:
        match expr:
            case s.Logical(op=op, operands=operands):
                return (all if op == "and" else any)(self._passes(each, bound) for each in operands)
            case s.Compare(first=s.Name(id=name), rest=((op, s.Name(id=other)),)) if op in ("==", "!="):
                return (bound[name] == bound.get(other, other)) is (op == "==")
            case s.Compare(first=s.Name(id=name), rest=((op, others),)):
                return (bound[name] in self._members(others)) is (op == "in")
        raise AssertionError(f"no filter: {expr}")


def _combined(op: str, parts: list[Judged]) -> Judged:
    """Of three values: a false part decides an `and`, a true one an `or`, and otherwise one that is open leaves it open."""
    deciding = op == "or"
    holds: bool | None = not deciding
    if any(part.holds is deciding for part in parts):
        holds = deciding
    elif any(part.holds is None for part in parts):
        holds = None
    return Judged(holds, _seen(parts, holds))


def _seen(parts: list[Judged], holds: bool | None) -> tuple[Compared, ...]:
    """The comparisons of the parts that came out as the whole did."""
    return tuple(each for part in parts if part.holds is holds for each in part.seen)


def _counted(parts: list[Judged]) -> Estimate:
    """How many parts hold: an interval where some are undecided."""
    sure, open_ = (sum(part.holds is truth for part in parts) for truth in (True, None))
    return Estimate.between(sure, sure + open_) if open_ else Estimate.exactly(sure)


def _compare(op: str, difference: Estimate) -> bool | None:
    """Whether the left side is greater, smaller or equal, told from the interval of the difference of both."""
    low, high = difference.interval
    match op:
        case ">":
            return True if low > 0 else False if high <= 0 else None
        case ">=":
            return True if low >= 0 else False if high < 0 else None
        case "<":
            return True if high < 0 else False if low >= 0 else None
        case "<=":
            return True if high <= 0 else False if low > 0 else None
        case "==":
            return True if low == high == 0 else False if low > 0 or high < 0 else None
    return False if low == high == 0 else True if low > 0 or high < 0 else None


def _text(expr: s.Expr, bound: Bound) -> str:
    """An expression as it is written, with the members of groups for their variables."""
    written = expr.place.written
    if not bound:
        return written
    return re.sub(rf"\b({'|'.join(map(re.escape, bound))})\b", lambda found: bound[found[1]], written)
