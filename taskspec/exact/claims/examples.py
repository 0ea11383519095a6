"""Worked examples, held against the equations of a task: what is given is put in, and what follows is compared.

Chance is enumerated. What is drawn from distributions without end can only be told to be the same when it is written alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from taskspec.diagnostics import Collector, Diagnostic, SpecError
from taskspec.exact.claims.follow import Consequence, compare, likely
from taskspec.exact.claims.settings import wrong_setting
from taskspec.exact.model.space import domain, words
from taskspec.exact.planning.certified.readings import Reader
from taskspec.lang.basechecker import Poisoned
from taskspec.lang.check import Checker
from taskspec.lang.ir import Const, Node, Read, Role, reads, rewrite
from taskspec.lang.scope import Scope
from taskspec.lang.types import BOOL, REAL, Refused
from taskspec.registry import load
from taskspec.task.assign import assign
from taskspec.task.build import build
from taskspec.task.examples import SCOPE
from taskspec.task.task import Component, Example, Followed, Task, TaskLike

ENDLESS = float("inf")
REWARD = Component("reward", REAL, (-ENDLESS,), (ENDLESS,))
ENDS = {"terminal": Component("terminal", BOOL, (0,), (1,)), "truncated": Component("truncated", BOOL, (0,), (1,))}


def wrong_examples(task: TaskLike) -> Iterator[tuple[int, Diagnostic]]:
    """Every problem with the examples of a task, each with the number of its example."""
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
    """The task for the parameter values of an example."""
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
        self.checker = Checker(self.task.builder, self.collector)
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
        asked = [found for follows in self.example.follows if (found := self._asked(follows)) is not None]
        chance = self._chance()
        if self.collector.diagnostics:
            return
        if chance is None:
            for one in asked:
                compare(one, self.collector)
        else:
            likely(asked, chance, self.example, self.collector)

    def _check_time(self) -> None:
        horizon = self.task.horizon
        if horizon is not None and self.example.t >= horizon + (not self.example.steps):
            message = f"no step is taken after {self.example.t} others: the horizon is {horizon}"
            self.collector.add("E613", self.example.place, message)

    # -- what is given ----------------------------------------------------------------------------

    @cached_property
    def given(self) -> dict[tuple[Role, str], Node | None]:
        """State, action and time as constants; None for what is broken (and reported)."""
        components = {(Role.STATE, c.name): c for c in self.task.remembering().state}
        components |= {(Role.ACTION, c.name): c for c in self.task.action}
        found: dict[tuple[Role, str], Node | None] = {
            key: self._value(components[key], expr) for key, expr in self.example.given.items()
        }
        found[Role.TIME, "t"] = self.task.builder.scalar(self.example.t)
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

    def _put_in(self, node: Node, what: str) -> Node | None:
        """A node with all that is given put in; None where something is missing (and reported)."""
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
        return rewrite([node], leaf, self.task.builder.remake)[0]

    # -- what follows -----------------------------------------------------------------------------

    def _asked(self, follows: Followed) -> Consequence | None:
        """What the task says and what the example says; None where one of them is broken (and reported)."""
        found = self._said(follows)
        if found is None:
            return None
        component, node, what = found
        expected = assign(self.checker, follows.expr, self.scope, component)
        actual = self._put_in(node, what)
        if expected is None or actual is None:
            return None
        return Consequence(what, component, actual, expected, follows.expr)

    def _said(self, follows: Followed) -> tuple[Component, Node, str] | None:
        """The component that an entry is about, its node, and words for it."""
        task, b, name = self.task, self.task.builder, follows.name
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
