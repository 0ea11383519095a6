"""What rules may say beyond the language itself, and whether a rule means something."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, suggest
from taskspec.lang import syntax as s
from taskspec.rollout.statistics import Statistic, deviation, mean
from taskspec.rules.vocabulary import Word

# ---------- vocabulary
# What rules may say beyond the language itself: numbers over the seeds of a task, and quantifiers over tasks and learners.


def _highest(samples: Array) -> Array:
    found: Array = np.max(samples, axis=-1)
    return found


def _lowest(samples: Array) -> Array:
    found: Array = np.min(samples, axis=-1)
    return found


def _median(samples: Array) -> Array:
    found: Array = np.median(samples, axis=-1)
    return found


@dataclass(frozen=True, slots=True)
class OverSeeds:
    """A number over the seeds of a task: which entry of a result it is made of, and how."""

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
        _over_seeds("median", "deterministic", _median, "Score that half of the seeds reach."),
        _over_seeds("highest", "deterministic", _highest, "Score of the best seed."),
        _over_seeds("lowest", "deterministic", _lowest, "Score of the worst seed."),
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
"""Functions of numbers: how many they take, and what they are."""

QUANTIFIERS: dict[str, str] = {
    "all": "The condition holds for all: `all(score(t) > 0 for t in tasks)`.",
    "any": "It holds for at least one.",
    "most": "It holds for more than half.",
    "count": "The number for which it holds.",
}
ALL_TASKS, ALL_LEARNERS = "tasks", "learners"
"""Groups that are there without being written."""


@dataclass(frozen=True)
class RuleNames:
    """What a rule may name: tasks, learners (none where results are those of one), groups of either, tasks at other values."""

    tasks: tuple[str, ...]
    learners: tuple[str, ...] = ()
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    instances: tuple[str, ...] = ()

    def group(self, name: str) -> tuple[str, ...] | None:
        """The members of a group."""
        own = {ALL_TASKS: self.tasks} | ({ALL_LEARNERS: self.learners} if self.learners else {})
        return {**self.groups, **own}.get(name)

    @property
    def known_groups(self) -> tuple[str, ...]:
        return (ALL_TASKS, *((ALL_LEARNERS,) if self.learners else ()), *self.groups)


# ---------- check
# Whether a rule means something: every name, function, argument and kind of value in it, before there are any results.

Bound = Mapping[str, str]
"""Variables of comprehensions, each with what it stands for: `task`, `learner`, or what cannot be told."""
UNKNOWN = "unknown"


class RuleChecker:
    """Walks a rule and collects all that is wrong with it."""

    def __init__(self, names: RuleNames, collector: Collector) -> None:
        self.names, self.collector = names, collector

    def condition(self, expr: s.Expr, bound: Bound) -> None:
        """A condition belongs here."""
        match expr:
            case s.Logical(operands=operands):
                for operand in operands:
                    self.condition(operand, bound)
            case s.Unary(op="not", operand=operand):
                self.condition(operand, bound)
            case s.Compare(first=first, rest=rest):
                self.compare(first, rest, bound)
            case s.Call(function="all" | "any" | "most"):
                self.quantifier(expr, bound)
            case s.Boolean():
                pass
            case _:
                self.fail("E306", expr, "a condition is needed here", "for example `score(task) > 0.9`")

    def compare(self, first: s.Expr, rest: tuple[tuple[str, s.Expr], ...], bound: Bound) -> None:
        self.number(first, bound)
        for op, other in rest:
            if op in ("in", "not in"):
                self.fail("E316", other, "`in` is allowed only after the `if` of a comprehension")
            else:
                self.number(other, bound)

    def number(self, expr: s.Expr, bound: Bound) -> None:
        """A number belongs here."""
        match expr:
            case s.Number():
                pass
            case s.Binary(op="+" | "-" | "*" | "/", left=left, right=right):
                self.number(left, bound)
                self.number(right, bound)
            case s.Unary(op="-" | "+", operand=operand):
                self.number(operand, bound)
            case s.Call(function="count"):
                self.quantifier(expr, bound)
            case s.Call(function=name) if name in FUNCTIONS:
                self.function(expr, bound)
            case s.Call(function=name) if name in NUMBERS or name in FIXED:
                self.about(expr, bound)
            case s.Call(function=name):
                known = (*NUMBERS, *FIXED, *FUNCTIONS, *QUANTIFIERS)
                hint = suggest(name, known) or f"there are {', '.join(known)}"
                self.collector.add("E303", expr.name_place, f"there is no function '{name}' in rules", hint)
            case s.Name(id=name):
                self.fail("E306", expr, f"a number is needed here, not '{name}'", f"for example `score({name})`")
            case _:
                self.fail("E306", expr, "a number is needed here", "for example `score(task)`")

    def function(self, expr: s.Call, bound: Bound) -> None:
        low, high, _ = FUNCTIONS[expr.function]
        if not low <= len(expr.args) <= high or expr.keywords:
            self.fail("E304", expr, f"{expr.function} takes {low if low == high else f'{low} or more'} numbers")
        for each in expr.args:
            self.number(each, bound)

    # -- what a number is about ----------------------------------------------------------------------

    def about(self, expr: s.Call, bound: Bound) -> None:
        """The arguments `(learner, task, side)`; there is a learner where there are several, and a side need not be given."""
        wanted = (["learner"] if self.names.learners and expr.function in NUMBERS else []) + ["task"]
        sides = expr.function in NUMBERS
        written = f"{expr.function}({', '.join(wanted)})"
        if expr.keywords or not len(wanted) <= len(expr.args) <= len(wanted) + sides:
            hint = f"behind them may stand {', '.join(SIDES)}" if sides else None
            self.fail("E304", expr, f"{expr.function} takes other arguments: {written}", hint)
            return
        for kind, each in zip(wanted, expr.args, strict=False):
            self.member(each, kind, bound)
        for each in expr.args[len(wanted) :]:
            self.name_of(each, tuple(SIDES), "side of a task")

    def member(self, expr: s.Expr, kind: str, bound: Bound) -> None:
        """A task or a learner, or a variable for one."""
        if isinstance(expr, s.Name) and expr.id in bound:
            if bound[expr.id] not in (kind, UNKNOWN):
                self.fail("E306", expr, f"'{expr.id}' is a {bound[expr.id]} here; a {kind} is needed")
            return
        known = (*self.names.tasks, *self.names.instances) if kind == "task" else self.names.learners
        self.name_of(expr, known, kind, tuple(bound))

    def name_of(self, expr: s.Expr, known: tuple[str, ...], kind: str, others: tuple[str, ...] = ()) -> None:
        if not isinstance(expr, s.Name) or expr.primed:
            self.fail("E306", expr, f"the name of a {kind} is needed here", f"one of {', '.join(known)}")
        elif expr.id not in known:
            hint = suggest(expr.id, (*known, *others)) or f"one of {', '.join(known)}"
            self.fail("E302", expr, f"there is no {kind} '{expr.id}' here", hint)

    # -- quantifiers ---------------------------------------------------------------------------------

    def quantifier(self, expr: s.Call, bound: Bound) -> None:
        if len(expr.args) != 1 or expr.keywords or not isinstance(expr.args[0], s.Comprehension):
            hint = f"`{expr.function}(score(t) > 0.9 for t in tasks)`"
            self.fail("E304", expr, f"{expr.function} takes a condition for each of some tasks", hint)
            return
        inner = dict(bound)
        for clause in expr.args[0].clauses:
            kind = self.domain(clause.domain)
            if len(clause.targets) != 1:
                self.fail("E316", clause.domain, "one variable goes through a group")
            inner |= dict.fromkeys(clause.targets, kind)
            for condition in clause.conditions:
                self.filter(condition, inner)
        self.condition(expr.args[0].element, inner)

    def domain(self, expr: s.Expr) -> str:
        """What a group, or a list of names, is of."""
        match expr:
            case s.Name(id=name):
                members = self.names.group(name)
                if members is None:
                    self.name_of(expr, self.names.known_groups, "group")
                return UNKNOWN if members is None else self.kind_of(members)
            case s.SetOf(items=items) | s.Vector(items=items):
                names = tuple(i.id for i in items if isinstance(i, s.Name))
                kind = self.kind_of(names)
                for item in items:
                    self.member(item, kind, {})
                return kind
            case _:
                self.fail("E306", expr, "a group is needed here", f"one of {', '.join(self.names.known_groups)}")
                return "task"

    def kind_of(self, members: tuple[str, ...]) -> str:
        return "learner" if any(m in self.names.learners for m in members) else "task"

    def filter(self, expr: s.Expr, bound: Bound) -> None:
        """What stands behind `if`: which members are meant, told by their names."""
        match expr:
            case s.Logical(operands=operands):
                for operand in operands:
                    self.filter(operand, bound)
            case s.Compare(first=s.Name(id=name), rest=(("in" | "not in", others),)) if name in bound:
                self.domain(others)
            case s.Compare(first=s.Name(id=name), rest=(("==" | "!=", other),)) if name in bound:
                self.member(other, bound[name], bound)
            case _:
                hint = "for example `if t != Sort`, or `if t not in {Sort, Parabola}`"
                self.fail("E316", expr, "a group is narrowed by names only", hint)

    def fail(self, code: str, expr: s.Expr, message: str, hint: str | None = None) -> None:
        self.collector.add(code, expr.place, message, hint)
