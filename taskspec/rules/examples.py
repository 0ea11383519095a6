"""Worked examples: given values are substituted into the equations of a task, and the consequences compared.

Draws are enumerated. Distributions with infinitely many outcomes are equal if they are written in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, Diagnostic, SpecError
from taskspec.lang import syntax as s
from taskspec.lang.check import Checker
from taskspec.lang.interval import NormalForms
from taskspec.lang.ir import Const, Node, Read, Role, draws, reads, rewrite
from taskspec.lang.scope import Poisoned, Scope
from taskspec.lang.types import BOOL, INF, REAL, Refused
from taskspec.lang.variates.entry import ProbabilityArithmetic
from taskspec.model.space import domain, plain, words
from taskspec.model.transitions import FLOATS, count, is_finite, joint_outcomes, merge_outcomes
from taskspec.registry import load
from taskspec.rules.claim_verdicts import wrong_setting
from taskspec.solve.enclosure import Inexact, Reader
from taskspec.solve.rational import ExactProbabilities
from taskspec.task.annotations import SCOPE
from taskspec.task.build import build
from taskspec.task.context import assign
from taskspec.task.task import Component, Example, Followed, Task, TaskLike

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
    actual: Node
    expected: Node
    expr: s.Expr


@dataclass(frozen=True)
class JointOutcomes:
    """Distinct values (K, elements) of a node, in order, with their probabilities (K,) as rationals or floats."""

    values: Array
    weights: Array

    def probability(self, row: Array) -> float | Fraction:
        """Return the probability of values (elements,)."""
        nothing = Fraction(0) if self.weights.dtype == object else 0.0
        return sum(self.weights[_close(self.values, row)].tolist(), nothing)


def _close(rows: Array, row: Array) -> Array:
    with np.errstate(invalid="ignore"):  # infinite values are equal to themselves
        near = np.abs(rows - row) <= ABSOLUTE + RELATIVE * np.maximum(np.abs(rows), np.abs(row))
    return np.asarray(((rows == row) | near | (np.isnan(rows) & np.isnan(row))).all(axis=1))


def _are_equal(one: float | Fraction, other: float | Fraction) -> bool:
    """Return whether two probabilities are equal: exactly if both are known exactly."""
    if isinstance(one, Fraction) and isinstance(other, Fraction):
        return one == other
    return abs(float(one) - float(other)) <= CHANCE


def outcomes(nodes: Sequence[Node]) -> JointOutcomes | None:
    """Return the joint outcomes of nodes that read nothing; None if there are infinitely many, or too many."""
    found = draws(nodes)
    size = sum(node.type.size for node in (*nodes, *found))
    if not all(map(is_finite, found)) or count(found, {}) > min(MOST_OUTCOMES, MOST_NUMBERS / max(1, size)):
        return None
    try:
        return _enumerated(nodes, ExactProbabilities(Reader(as_written=True)))
    except Inexact:
        return _enumerated(nodes, FLOATS)


def _enumerated(nodes: Sequence[Node], numbers: ProbabilityArithmetic) -> JointOutcomes:
    rows = []
    weights = []
    for values, _, weight in joint_outcomes(nodes, {}, 1, numbers):
        rows.append(np.concatenate([v.reshape(-1, len(weight)) for v in values]).astype(np.float64))
        weights.append(weight)
    columns, total = merge_outcomes(list(np.concatenate(rows, axis=1)), np.concatenate(weights))
    return JointOutcomes(np.array(columns).T.reshape(len(total), -1), total)


def compare(asked: Consequence, collector: Collector) -> None:
    """Report a consequence that is not that of the task."""
    actual = outcomes([asked.actual])
    expected = outcomes([asked.expected])
    if actual is None or expected is None:
        _compare_forms(asked, collector)
        return
    if all(_are_equal(actual.probability(row), p) for row, p in zip(expected.values, expected.weights, strict=True)):
        return
    message = f"{asked.what} is {_in_words(asked.component, actual)}, not {_in_words(asked.component, expected)}"
    collector.add("E611", asked.expr.place, message)


def _compare_forms(asked: Consequence, collector: Collector) -> None:
    """Compare distributions that cannot be enumerated: they are equal if their normal forms are."""
    forms = NormalForms()
    if forms.all([asked.actual]) == forms.all([asked.expected]):
        return
    if not draws([asked.expected]):
        message = f"{asked.what} is drawn from a distribution with infinitely many outcomes, so it is not always {_value(asked)}"
        collector.add("E611", asked.expr.place, message, "write the distribution")
        return
    message = f"{asked.what} is drawn in another way, which may be the same or not"
    collector.add("E612", asked.expr.place, message, "write the distribution as the spec does")


def compare_probability(asked: Sequence[Consequence], chance: Fraction, example: Example, collector: Collector) -> None:
    """Report joint values whose probability is not that of the example."""
    actual = outcomes([a.actual for a in asked])
    expected = outcomes([a.expected for a in asked])
    if actual is None:
        message = "the probability cannot be computed: the draws have infinitely many, or too many, outcomes"
        collector.add("E612", example.place, message)
    elif expected is None or len(expected.values) > 1:
        collector.add("E613", example.place, "with a probability, give one value for each name")
    elif not _are_equal(actual.probability(expected.values[0]), chance):
        message = f"this has a probability of {_number(actual.probability(expected.values[0]))}, not {_number(chance)}"
        collector.add("E611", example.probability.place if example.probability else example.place, message)


# -- words ----------------------------------------------------------------------------------------


def _in_words(c: Component, found: JointOutcomes) -> str:
    """Return a value in words, or a few of many with their probabilities."""
    order = np.argsort(-found.weights, kind="stable")
    shown = [_one(c, found.values[i]) for i in order[:4]]
    if len(order) == 1:
        return shown[0]
    probabilities = [_number(found.weights[i]) for i in order[:4]]
    parts = [f"{value} ({p})" for value, p in zip(shown, probabilities, strict=True)]
    return ", ".join(parts) + (", ..." if len(order) > 4 else "")


def _one(c: Component, row: Array) -> str:
    kind = {0: np.bool_, 1: np.int64, 2: np.float64}[int(c.type.kind)]
    return words(plain(c, row.reshape(c.type.shape).astype(kind)))


def _value(asked: Consequence) -> str:
    found = outcomes([asked.expected])
    return "this" if found is None else _in_words(asked.component, found)


def _number(p: float | Fraction) -> str:
    ratio = Fraction(p).limit_denominator(1000)
    return str(ratio) if abs(ratio - Fraction(p)) <= 1e-12 else f"{float(p):.6g}"


# -- examples -------------------------------------------------------------------------------------

REWARD = Component("reward", REAL, (-INF,), (INF,))
ENDS = {"terminal": Component("terminal", BOOL, (0,), (1,)), "truncated": Component("truncated", BOOL, (0,), (1,))}


def wrong_examples(task: TaskLike) -> Iterator[tuple[int, Diagnostic]]:
    """Yield every problem with the examples of a task, with the number of its example."""
    task = load(task)
    known: dict[str, Task | SpecError] = {}
    for i, example in enumerate(task.examples):
        for case in example.cases or ({},):
            key = repr(case)
            found = known[key] = known.get(key) or _for(task, case)
            problems = (
                (wrong_setting(task, "examples", i, case, found),)
                if isinstance(found, SpecError)
                else _Trial(found, found.examples[i]).problems()
            )
            for problem in problems:
                yield i, _with_case(problem, case)


def _for(task: Task, case: Mapping[str, Any]) -> Task | SpecError:
    """Return the task for the parameter values of an example."""
    try:
        return build(task.document, task.variant, task.given | dict(case), task.suite) if case else task
    except SpecError as error:
        return error


def _with_case(problem: Diagnostic, case: Mapping[str, Any]) -> Diagnostic:
    note = f"for {', '.join(f'{k} = {words(v)}' for k, v in case.items())}"
    return Diagnostic(
        problem.code, problem.span, problem.message, problem.hint, (*problem.notes, *([note] if case else []))
    )


@dataclass
class _Trial:
    """One example of a task whose parameters are those of the example."""

    task: Task
    example: Example

    def __post_init__(self) -> None:
        self.collector = Collector()
        self.builder = self.task.new_builder()
        self.checker = Checker(self.builder, self.collector)
        self.scope = self.task.surface.scopes[SCOPE]
        self.fixed = Scope({}, parent=self.scope)
        self.fixed.draws = "what an example begins with is fixed"

    def problems(self) -> tuple[Diagnostic, ...]:
        try:
            self._run()
        except Refused as refused:
            self.collector.add(refused.code, self.example.place, refused.message, refused.hint)
        return self.collector.diagnostics

    def _run(self) -> None:
        self._check_time()
        asked = [found for follows in self.example.follows if (found := self._consequence(follows)) is not None]
        chance = self._chance()
        if self.collector.diagnostics:
            return
        if chance is None:
            for one in asked:
                compare(one, self.collector)
        else:
            compare_probability(asked, chance, self.example, self.collector)

    def _check_time(self) -> None:
        horizon = self.task.horizon
        if horizon is not None and self.example.t >= horizon + (not self.example.steps):
            message = f"no step is taken after {self.example.t} others: the horizon is {horizon}"
            self.collector.add("E613", self.example.place, message)

    # -- what is given ----------------------------------------------------------------------------

    @cached_property
    def given(self) -> dict[tuple[Role, str], Node | None]:
        """State, action and time as constants; None for those that are wrong, which is reported."""
        components = {(Role.STATE, c.name): c for c in self.task.remembering().state}
        components |= {(Role.ACTION, c.name): c for c in self.task.action}
        found: dict[tuple[Role, str], Node | None] = {
            key: self._value(components[key], expr) for key, expr in self.example.given.items()
        }
        found[Role.TIME, "t"] = self.builder.scalar(self.example.t)
        return found

    def _value(self, c: Component, expr: Any) -> Node | None:
        node = assign(self.checker, expr, self.fixed, c)
        if not isinstance(node, Const):
            return None
        if not all(low <= v <= high for v, low, high in zip(node.flat, c.low, c.high, strict=True)):
            value = words(node.flat[0]) if c.type.is_scalar else "what it is here"
            self.collector.add("E613", expr.place, f"{c.name} cannot be {value}; it must be {domain(c)}")
            return None
        return node

    def _substituted(self, node: Node, what: str) -> Node | None:
        """Return a node with the given values substituted; None if some are missing, which is reported."""
        lacking = sorted({name for role, name in reads([node]) if (role, name) not in self.given})
        if lacking:
            names = " and ".join(f"'{name}'" for name in lacking)
            message = f"{what} depends on {names}, which this example does not give"
            self.collector.add("E613", self.example.place, message)
            return None

        def leaf(found: Node) -> Node | None:
            return self.given[found.role, found.name] if isinstance(found, Read) else None

        if any(self.given[key] is None for key in reads([node])):
            return None
        return rewrite([node], leaf, self.builder.remake)[0]

    # -- what follows -----------------------------------------------------------------------------

    def _consequence(self, follows: Followed) -> Consequence | None:
        """Return a consequence in the task and in the example; None if one of them is wrong, which is reported."""
        found = self._in_task(follows)
        if found is None:
            return None
        component, node, what = found
        expected = assign(self.checker, follows.expr, self.scope, component)
        actual = self._substituted(node, what)
        if expected is None or actual is None:
            return None
        return Consequence(what, component, actual, expected, follows.expr)

    def _in_task(self, follows: Followed) -> tuple[Component, Node, str] | None:
        """Return the component of an entry, its node, and words for it."""
        task = self.task
        b = self.builder
        name = follows.name
        match follows.section:
            case "initial":
                return *_named(task.state, task.initial, name), f"the first {name}"
            case "next":
                return *_named(task.state, task.next, name), f"the next {name}"
            case "observation":
                return *_named(task.observation.components, self._seen, name), f"'{name}' in the observation"
            case "expert" if isinstance(task.expert, tuple):
                return *_named(task.action, task.expert, name), f"the expert's {name}"
            case "expert":
                message = "only an expert given by expressions can be checked"
                self.collector.add("E612", follows.expr.place, message)
                return None
            case "reward":
                return REWARD, task.reward, "the reward"
            case "terminal":
                return ENDS["terminal"], task.terminal, "`terminal`"
            case _:
                cut = task.horizon is not None and self.example.t + 1 >= task.horizon
                return ENDS["truncated"], b.scalar(cut), "`truncated`"

    @property
    def _seen(self) -> tuple[Node, ...]:
        if self.example.starts:
            return self.task.first_observation
        return self.task.next_observation if self.example.acts else self.task.observation.nodes

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


def _named(components: tuple[Component, ...], nodes: tuple[Node, ...], name: str | None) -> tuple[Component, Node]:
    return next((c, node) for c, node in zip(components, nodes, strict=True) if c.name == name)
