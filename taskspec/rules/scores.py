"""Findings and diagnoses: the vocabulary of scores, and the check of a rule before there are any results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, suggest
from taskspec.lang import syntax as s
from taskspec.rollout.statistics import Statistic, deviation, mean
from taskspec.rules.evaluator import Evaluator, Truth
from taskspec.rules.vocabulary import Word

# -- words --------------------------------------------------------------------------------------------


def _along_seeds(function: Callable[..., Array]) -> Statistic:
    return lambda samples: function(samples, axis=-1)


@dataclass(frozen=True, slots=True)
class OverSeeds:
    """A number over the seeds of a task: the entry of a result that it is made of, and the statistic."""

    word: Word
    entry: str
    statistic: Statistic


def _over_seeds(name: str, entry: str, statistic: Statistic, doc: str) -> OverSeeds:
    return OverSeeds(Word(name, f"{name}(task)", doc), entry, statistic)


NUMBERS: dict[str, OverSeeds] = {
    n.word.name: n
    for n in (
        _over_seeds("score", "deterministic", mean, "Mean score of the best actions of the policy; 0 is random, 1 the expert."),
        _over_seeds("sampled", "stochastic", mean, "Mean score of the policy that samples its actions."),
        _over_seeds("sd", "deterministic", deviation, "Standard deviation of the scores between seeds."),
        _over_seeds("median", "deterministic", _along_seeds(np.median), "Score that half of the seeds reach."),
        _over_seeds("highest", "deterministic", _along_seeds(np.max), "Score of the best seed."),
        _over_seeds("lowest", "deterministic", _along_seeds(np.min), "Score of the worst seed."),
        _over_seeds("starc", "starc", mean, "Mean distance of the learned reward to the true one, up to shaping and scale."),
        _over_seeds("regret", "reward_regret", mean, "Mean score that is lost by optimising the learned reward exactly."),
    )
}  # fmt: skip
"""Each takes a task, where there are several learners a learner before it, and one of `SIDES` behind it."""

FIXED: dict[str, Word] = {"constant": Word("constant", "constant(task)", "Score of the best constant action.")}
"""Numbers of a task that no seed changes."""

SIDES: dict[str, str] = {
    "printed": "the task as printed; the default",
    "twin": "its twins: states renamed, actions permuted, or a symmetry of the task; mean over all of them",
    "negated": "the task as printed, with the reward that is withheld negated",
}

FUNCTIONS: dict[str, tuple[int, int, str]] = {
    "abs": (1, 1, "Absolute value."), "min": (2, 9, "The smallest of some numbers."),
    "max": (2, 9, "The largest of some numbers."),
}  # fmt: skip
"""Functions of numbers: the fewest and the most arguments, and the meaning."""

QUANTIFIERS: dict[str, str] = {
    "all": "The condition holds for all: `all(score(t) > 0 for t in tasks)`.",
    "any": "It holds for at least one.",
    "most": "It holds for more than half.",
    "count": "The number for which it holds.",
}
ALL_TASKS, ALL_LEARNERS = "tasks", "learners"
"""Groups that need not be declared."""


@dataclass(frozen=True)
class RuleNames:
    """Names for rules: tasks, learners (none if the results are those of one), groups of either, tasks at other values."""

    tasks: tuple[str, ...]
    learners: tuple[str, ...] = ()
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    instances: tuple[str, ...] = ()

    def group(self, name: str) -> tuple[str, ...] | None:
        """Return the members of a group."""
        own = {ALL_TASKS: self.tasks} | ({ALL_LEARNERS: self.learners} if self.learners else {})
        return {**self.groups, **own}.get(name)

    @property
    def known_groups(self) -> tuple[str, ...]:
        return (ALL_TASKS, *((ALL_LEARNERS,) if self.learners else ()), *self.groups)

    def members(self, expr: s.Expr) -> tuple[str, ...]:
        """Return the members of a checked group, or list of names."""
        if isinstance(expr, s.Name):
            return self.group(expr.id) or ()
        assert isinstance(expr, s.SetOf | s.Vector)
        return tuple(item.id for item in expr.items if isinstance(item, s.Name))


# -- check --------------------------------------------------------------------------------------------

UNKNOWN = "unknown"
"""Kind of a variable whose group does not exist."""


class ScoreChecker(Evaluator[None, None]):
    """Collect every mistake in a rule: names, functions, arguments, and kinds of values.

    Args:
        bound: variables of comprehensions, each with the kind of its values: `task`, `learner` or `UNKNOWN`.
    """

    def __init__(self, names: RuleNames, collector: Collector, bound: Mapping[str, str] | None = None) -> None:
        self.names = names
        self.collector = collector
        self.bound = bound or {}

    def statement(self, expr: s.Expr) -> Truth[None]:
        match expr:
            case s.Boolean():
                pass
            case s.Call(function="all" | "any" | "most"):
                self._quantifier(expr)
            case _:
                self._fail("E306", expr, "a condition is needed here", "for example `score(task) > 0.9`")
        return Truth(None)

    def compared(self, left: s.Expr, op: str, right: s.Expr, chain: s.Compare) -> Truth[None]:
        if left is chain.first:
            self.number(left)
        if op in ("in", "not in"):
            self._fail("E316", right, "`in` is allowed only after the `if` of a comprehension")
        else:
            self.number(right)
        return Truth(None)

    def constant(self, value: int | float) -> None:
        pass

    def negative(self, number: None) -> None:
        pass

    def arithmetic(self, op: str, left: None, right: None) -> None:
        pass

    def quantity(self, expr: s.Expr) -> None:
        match expr:
            case s.Call(function="count"):
                self._quantifier(expr)
            case s.Call(function=name) if name in FUNCTIONS:
                self._function(expr)
            case s.Call(function=name) if name in NUMBERS or name in FIXED:
                self._subject(expr)
            case s.Call(function=name):
                known = (*NUMBERS, *FIXED, *FUNCTIONS, *QUANTIFIERS)
                hint = suggest(name, known) or f"there are {', '.join(known)}"
                self.collector.add("E303", expr.name_place, f"there is no function '{name}' in rules", hint)
            case s.Name(id=name):
                self._fail("E306", expr, f"a number is needed here, not '{name}'", f"for example `score({name})`")
            case _:
                self._fail("E306", expr, "a number is needed here", "for example `score(task)`")

    def _function(self, expr: s.Call) -> None:
        low, high, _ = FUNCTIONS[expr.function]
        if not low <= len(expr.args) <= high or expr.keywords:
            self._fail("E304", expr, f"{expr.function} takes {low if low == high else f'{low} or more'} numbers")
        for each in expr.args:
            self.number(each)

    # -- tasks and learners -----------------------------------------------------------------------

    def _subject(self, expr: s.Call) -> None:
        """Check the arguments `(learner, task, side)`: a learner if there are several, and optionally a side."""
        wanted = ["learner", "task"] if self.names.learners and expr.function in NUMBERS else ["task"]
        has_sides = expr.function in NUMBERS
        written = f"{expr.function}({', '.join(wanted)})"
        if expr.keywords or not len(wanted) <= len(expr.args) <= len(wanted) + has_sides:
            hint = f"behind them may stand {', '.join(SIDES)}" if has_sides else None
            self._fail("E304", expr, f"{expr.function} takes other arguments: {written}", hint)
            return
        for kind, each in zip(wanted, expr.args, strict=False):
            self._member(each, kind)
        for each in expr.args[len(wanted) :]:
            self._name_of(each, tuple(SIDES), "side of a task")

    def _member(self, expr: s.Expr, kind: str) -> None:
        """Check a task or a learner, or a variable for one."""
        if isinstance(expr, s.Name) and expr.id in self.bound:
            found = self.bound[expr.id]
            if found not in (kind, UNKNOWN):
                self._fail("E306", expr, f"'{expr.id}' is a {found} here; a {kind} is needed")
            return
        known = (*self.names.tasks, *self.names.instances) if kind == "task" else self.names.learners
        self._name_of(expr, known, kind, tuple(self.bound))

    def _name_of(self, expr: s.Expr, known: tuple[str, ...], kind: str, others: tuple[str, ...] = ()) -> None:
        if not isinstance(expr, s.Name) or expr.primed:
            self._fail("E306", expr, f"the name of a {kind} is needed here", f"one of {', '.join(known)}")
        elif expr.id not in known:
            hint = suggest(expr.id, (*known, *others)) or f"one of {', '.join(known)}"
            self._fail("E302", expr, f"there is no {kind} '{expr.id}' here", hint)

    # -- quantifiers ------------------------------------------------------------------------------

    def _quantifier(self, expr: s.Call) -> None:
        if len(expr.args) != 1 or expr.keywords or not isinstance(expr.args[0], s.Comprehension):
            hint = f"`{expr.function}(score(t) > 0.9 for t in tasks)`"
            self._fail("E304", expr, f"{expr.function} takes a condition for each of some tasks", hint)
            return
        inner = ScoreChecker(self.names, self.collector, self.bound)
        for clause in expr.args[0].clauses:
            kind = self._group(clause.domain)
            if len(clause.targets) != 1:
                self._fail("E316", clause.domain, "one variable goes through a group")
            inner.bound = {**inner.bound, **dict.fromkeys(clause.targets, kind)}
            for condition in clause.conditions:
                inner._filter(condition)
        inner.truth(expr.args[0].element)

    def _group(self, expr: s.Expr) -> str:
        """Check a group, or a list of names, and return the kind of its members."""
        match expr:
            case s.Name(id=name):
                members = self.names.group(name)
                if members is None:
                    self._name_of(expr, self.names.known_groups, "group")
                return UNKNOWN if members is None else self._kind_of(members)
            case s.SetOf(items=items) | s.Vector(items=items):
                kind = self._kind_of(self.names.members(expr))
                unbound = ScoreChecker(self.names, self.collector)
                for item in items:
                    unbound._member(item, kind)
                return kind
            case _:
                self._fail("E306", expr, "a group is needed here", f"one of {', '.join(self.names.known_groups)}")
                return "task"

    def _kind_of(self, members: tuple[str, ...]) -> str:
        return "learner" if any(m in self.names.learners for m in members) else "task"

    def _filter(self, expr: s.Expr) -> None:
        """Check a condition after `if`, which narrows a group by names."""
        match expr:
            case s.Logical(operands=operands):
                for operand in operands:
                    self._filter(operand)
            case s.Compare(first=s.Name(id=name), rest=(("in" | "not in", others),)) if name in self.bound:
                self._group(others)
            case s.Compare(first=s.Name(id=name), rest=(("==" | "!=", other),)) if name in self.bound:
                self._member(other, self.bound[name])
            case _:
                hint = "for example `if t != Sort`, or `if t not in {Sort, Parabola}`"
                self._fail("E316", expr, "a group is narrowed by names only", hint)

    def _fail(self, code: str, expr: s.Expr, message: str, hint: str | None = None) -> None:
        self.collector.add(code, expr.place, message, hint)
