"""Worked examples: given values are substituted into the equations of a task, and the consequences compared.

Draws are enumerated. Distributions with infinitely many outcomes are equal if they are written in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, Diagnostic, SpecError
from taskspec.base.display import small_fraction
from taskspec.exact.model.probabilities import FLOATS, ExactProbabilities, Inexact, Reader
from taskspec.exact.model.space import domain, plain, words
from taskspec.exact.model.transitions import joint_outcomes, merge_outcomes, outcome_count
from taskspec.exact.rules.claim_verdicts import wrong_setting
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.interval import NormalForms
from taskspec.language.expressions.scope import Poisoned
from taskspec.language.expressions.types import BOOL, INF, REAL, TIME, Expression, Refused, Role, total_size
from taskspec.language.expressions.variates.entry import ProbabilityArithmetic
from taskspec.language.registry import load
from taskspec.language.task.annotations import SCOPE
from taskspec.language.task.build import build
from taskspec.language.task.context import assign
from taskspec.language.task.parts import Component, Example, Followed
from taskspec.language.task.questions import components_read, constant, is_random, scope
from taskspec.language.task.task import Task, TaskLike

MOST_OUTCOMES = 100_000
MOST_NUMBERS = 2_000_000
"""Outcomes, and numbers in all of them, up to which distributions are enumerated."""
RELATIVE = 1e-9
ABSOLUTE = 1e-12
"""Tolerances of equal numbers."""
CHANCE = 1e-9
"""Tolerance of equal probabilities that are not known exactly."""


@dataclass(frozen=True)
class Consequence:
    """A consequence of what an example gives.

    Args:
        what: in words.
        component: whose value it is.
        actual, expected: as in the task, and as in the example.
        expr: the place in the example.
    """

    what: str
    component: Component
    actual: Expression
    expected: Expression
    expr: s.Expr


@dataclass(frozen=True)
class JointOutcomes:
    """Distinct values (K, elements) of a node, in order, with their probabilities (K,) as rationals or floats."""

    values: Array
    weights: Array

    def probability(self, row: Array) -> float | Fraction:
        """Return the probability of values (elements,)."""
        with np.errstate(invalid="ignore"):  # infinite values are equal to themselves
            near = np.abs(self.values - row) <= ABSOLUTE + RELATIVE * np.maximum(np.abs(self.values), np.abs(row))
        same = (self.values == row) | near | (np.isnan(self.values) & np.isnan(row))
        return sum(self.weights[same.all(axis=1)].tolist(), Fraction(0) if self.weights.dtype == object else 0.0)

    def in_words(self, c: Component) -> str:
        """Return a value in words, or a few of many with their probabilities."""
        order = np.argsort(-self.weights, kind="stable")
        shown = []
        for i in order[:4]:
            row = self.values[i].reshape(c.type.shape).astype((np.bool_, np.int64, np.float64)[int(c.type.kind)])
            shown.append(words(plain(c, row)))
        if len(order) == 1:
            return shown[0]
        parts = [f"{value} ({_number(self.weights[i])})" for value, i in zip(shown, order[:4], strict=True)]
        return ", ".join(parts) + ", ..." * (len(order) > 4)


def _are_equal(one: float | Fraction, other: float | Fraction) -> bool:
    if isinstance(one, Fraction) and isinstance(other, Fraction):
        return one == other
    return abs(float(one) - float(other)) <= CHANCE


def _number(p: float | Fraction) -> str:
    ratio = small_fraction(p, 1000)
    if ratio is None:
        return f"{float(p):.6g}"
    return str(ratio)


def outcomes(nodes: Sequence[Expression]) -> JointOutcomes | None:
    """Return the joint outcomes of nodes that read nothing; None if there are infinitely many, or too many."""
    if outcome_count(nodes) > min(MOST_OUTCOMES, MOST_NUMBERS / max(1, total_size(nodes))):
        return None
    try:
        return _enumerated(nodes, ExactProbabilities(Reader(as_written=True)))
    except Inexact:
        return _enumerated(nodes, FLOATS)


def _enumerated(nodes: Sequence[Expression], numbers: ProbabilityArithmetic) -> JointOutcomes:
    rows = []
    weights = []
    for values, _, weight in joint_outcomes(nodes, {}, 1, numbers):
        rows.append(np.concatenate([v.reshape(-1, len(weight)) for v in values]).astype(np.float64))
        weights.append(weight)
    columns, total = merge_outcomes(list(np.concatenate(rows, axis=1)), np.concatenate(weights))
    return JointOutcomes(np.array(columns).T.reshape(len(total), -1), total)


def compare(asked: Consequence, collector: Collector) -> None:
    """Report a consequence that differs from the task's."""
    what = asked.what
    actual = outcomes([asked.actual])
    expected = outcomes([asked.expected])
    if actual is not None and expected is not None:
        pairs = zip(expected.values, expected.weights, strict=True)
        if not all(_are_equal(actual.probability(row), p) for row, p in pairs):
            message = f"{what} is {actual.in_words(asked.component)}, not {expected.in_words(asked.component)}"
            collector.add("E611", asked.expr.place, message)
        return
    forms = NormalForms()  # distributions that cannot be enumerated are equal if their normal forms are
    if forms.all([asked.actual]) == forms.all([asked.expected]):
        return
    if is_random([asked.expected]):
        message = f"{what} is drawn in another way, which may be the same or not"
        collector.add("E612", asked.expr.place, message, "write the distribution as the spec does")
        return
    value = "this"
    if expected is not None:
        value = expected.in_words(asked.component)
    message = f"{what} is drawn from a distribution with infinitely many outcomes, so it is not always {value}"
    collector.add("E611", asked.expr.place, message, "write the distribution")


def compare_probability(asked: Sequence[Consequence], chance: Fraction, example: Example, collector: Collector) -> None:
    """Report joint values whose probability differs from the example's."""
    actual = outcomes([a.actual for a in asked])
    expected = outcomes([a.expected for a in asked])
    if actual is None:
        message = "the probability cannot be computed: the draws have infinitely many, or too many, outcomes"
        collector.add("E612", example.place, message)
    elif expected is None or len(expected.values) > 1:
        collector.add("E613", example.place, "with a probability, give one value for each name")
    else:
        probability = actual.probability(expected.values[0])
        if not _are_equal(probability, chance):
            message = f"this has a probability of {_number(probability)}, not {_number(chance)}"
            collector.add("E611", (example.probability or example).place, message)


# -- examples -------------------------------------------------------------------------------------

REWARD = Component("reward", REAL, (-INF,), (INF,))
TERMINAL = Component("terminal", BOOL, (0,), (1,))
TRUNCATED = Component("truncated", BOOL, (0,), (1,))


def wrong_examples(task: TaskLike) -> Iterator[tuple[int, Diagnostic]]:
    """Yield every problem with the examples of a task, with the number of its example."""
    task = load(task)
    known: dict[str, Task | SpecError] = {repr({}): task}
    for i, example in enumerate(task.annotations.examples):
        for case in example.cases or ({},):
            key = repr(case)
            if key not in known:
                try:
                    known[key] = build(
                        task.source.document, task.source.variant, task.given | dict(case), task.source.suite
                    )
                except SpecError as error:
                    known[key] = error
            built = known[key]
            if isinstance(built, SpecError):
                problems: tuple[Diagnostic, ...] = (wrong_setting(task, "examples", i, case, built),)
            else:
                problems = _Trial(built, built.annotations.examples[i]).problems()
            for problem in problems:
                if case:
                    note = f"for {', '.join(f'{k} = {words(v)}' for k, v in case.items())}"
                    problem = replace(problem, notes=(*problem.notes, note))
                yield i, problem


@dataclass
class _Trial:
    """One example of a task whose parameters are those of the example."""

    task: Task
    example: Example

    def __post_init__(self) -> None:
        self.collector = Collector()
        self.builder = self.task.new_builder()
        self.checker = Checker(self.builder, self.collector)
        self.scope = scope(self.task, SCOPE)
        self.fixed = self.scope.child({})
        self.fixed.draws = "the values that an example begins with are fixed"

    def problems(self) -> tuple[Diagnostic, ...]:
        try:
            self._run()
        except Refused as refused:
            self.collector.add(refused.code, self.example.place, refused.message, refused.hint)
        return self.collector.diagnostics

    def _run(self) -> None:
        horizon = self.task.horizon
        if horizon is not None and self.example.t >= horizon + (not self.example.steps):
            message = f"no step is taken after {self.example.t} others: the horizon is {horizon}"
            self.collector.add("E613", self.example.place, message)
        asked = [
            consequence for follows in self.example.follows if (consequence := self._consequence(follows)) is not None
        ]
        chance = self._chance()
        if self.collector.diagnostics:
            return
        if chance is None:
            for one in asked:
                compare(one, self.collector)
        else:
            compare_probability(asked, chance, self.example, self.collector)

    @cached_property
    def given(self) -> dict[tuple[Role, str], Expression | None]:
        """State, action and time as constants; None for those that are wrong, which is reported."""
        components = {(Role.STATE, c.name): c for c in self.task.remembering().state}
        components |= {(Role.ACTION, c.name): c for c in self.task.action}
        values: dict[tuple[Role, str], Expression | None] = {
            key: self._value(components[key], expr) for key, expr in self.example.given.items()
        }
        values[TIME] = self.builder.scalar(self.example.t)
        return values

    def _value(self, c: Component, expr: Any) -> Expression | None:
        node = assign(self.checker, expr, self.fixed, c)
        if node is None or constant(node) is None:
            return None
        (flat,) = evaluate([node], {})
        if not all(low <= v <= high for v, low, high in zip(flat, c.low, c.high, strict=True)):
            value = "this value"
            if c.type.is_scalar:
                value = words(flat[0])
            self.collector.add("E613", expr.place, f"{c.name} cannot be {value}; it must be {domain(c)}")
            return None
        return node

    def _substituted(self, node: Expression, what: str) -> Expression | None:
        """Return a node with the given values substituted; None if some are missing, which is reported."""
        needed = components_read([node]) | components_read([node], Role.ACTION)
        given = {name: value for (_, name), value in self.given.items()}
        lacking = sorted(needed - given.keys())
        if lacking:
            names = " and ".join(f"'{name}'" for name in lacking)
            message = f"{what} depends on {names}, which this example does not give"
            self.collector.add("E613", self.example.place, message)
            return None
        if any(given[name] is None for name in needed):
            return None
        values = {key: value for key, value in self.given.items() if value is not None}
        return self.builder.substitute([node], values, late=False)[0]

    def _consequence(self, follows: Followed) -> Consequence | None:  # noqa: C901
        """Return a consequence in the task and in the example; None if one of them is wrong, which is reported."""
        task = self.task
        name = follows.name
        entry: tuple[Sequence[Component], Sequence[Expression], str]
        nodes: Sequence[Expression]
        match follows.section:
            case "initial":
                entry = (task.state, task.process.initial, f"the first {name}")
            case "next":
                entry = (task.state, task.process.next, f"the next {name}")
            case "observation":
                nodes = task.observation.nodes
                if self.example.starts:
                    nodes = task.first_observation
                elif self.example.acts:
                    nodes = task.next_observation
                entry = (task.observation.components, nodes, f"'{name}' in the observation")
            case "expert":
                if not isinstance(task.annotations.expert, tuple):
                    message = "only an expert given by expressions can be checked"
                    self.collector.add("E612", follows.expr.place, message)
                    return None
                entry = (task.action, task.remembering().annotations.expert_nodes, f"the expert's {name}")
            case "reward":
                entry = ([REWARD], [task.process.reward], "the reward")
            case "terminal":
                entry = ([TERMINAL], [task.process.terminal], "`terminal`")
            case _:
                cut = task.horizon is not None and self.example.t + 1 >= task.horizon
                entry = ([TRUNCATED], [self.builder.scalar(cut)], "`truncated`")
        components, nodes, what = entry
        pairs = zip(components, nodes, strict=True)
        component, node = next((c, node) for c, node in pairs if name in (None, c.name))
        expected = assign(self.checker, follows.expr, self.scope, component)
        actual = self._substituted(node, what)
        if expected is None or actual is None:
            return None
        return Consequence(what, component, actual, expected, follows.expr)

    def _chance(self) -> Fraction | None:
        expr = self.example.probability
        if expr is None:
            return None
        try:
            node = self.checker.constant(expr, self.fixed, "a probability")
        except Poisoned:
            return None
        if not node.type.is_scalar:
            self.collector.add("E306", expr.place, f"a probability is a number, not {node.type}")
            return None
        if not 0 <= node.value <= 1:
            self.collector.add(
                "E402", expr.place, f"a probability of {words(float(node.value))} is not between 0 and 1"
            )
            return None
        return Reader(as_written=True)(node.value)
