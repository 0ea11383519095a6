"""One evaluator of conditions with three-valued (Kleene) logic, for every vocabulary of rules.

Claims are about the results of a task (`claim_rules`), diagnoses and findings about the scores of learners (`score_rules`). A
vocabulary is a subclass: it gives names, calls and comparisons their meaning. Conditions over all states and actions of a model
say where they hold, and who prefers such actions.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector
from taskspec.base.named import all_names, entries_by_name
from taskspec.exact.model.model import Model, differs, refuse
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.backward import Rule
from taskspec.exact.solve.bounded import UNKNOWN
from taskspec.exact.solve.solve import Solver
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.types import BOOL, TIME, Expression, Refused, Role
from taskspec.language.task.questions import components_read, is_random, reads_time, scope
from taskspec.language.task.task import Task

Evidence = TypeVar("Evidence")
Number = TypeVar("Number")


class Undecidable(Exception):
    """A rule needs something that is not known: a sentence that says what."""

    def __init__(self, message: str, place: s.Expr | None = None) -> None:
        super().__init__(message)
        self.place = place


class InvalidClaim(Exception):
    """An expression that is no claim: a sentence that says why."""

    def __init__(self, message: str, place: s.Expr | None = None, hint: str | None = None) -> None:
        super().__init__(message)
        self.place = place
        self.hint = hint


@dataclass(frozen=True, slots=True)
class Word:
    """A name, how it is written, and its meaning; the language reference is made from these.

    `phrase` is printed for it on pages, followed by `given` and the number in brackets, if any.
    """

    name: str
    written: str
    doc: str
    phrase: str = ""
    given: str = ""


@dataclass(frozen=True, slots=True)
class Truth(Generic[Evidence]):
    """The truth of a condition (None: undecided), and the evidence that decides it, or leaves it open."""

    holds: bool | None
    evidence: tuple[Evidence, ...] = ()


def combine(op: str, parts: Iterable[Truth[Evidence]], stops_early: bool = False) -> Truth[Evidence]:
    """Return the Kleene `and` or `or` of some parts, with the evidence of those that came out as the whole.

    Args:
        stops_early: whether parts after one that decides are left out; otherwise all of them are evidence.
    """
    deciding = op == "or"
    truths = []
    for part in parts:
        truths.append(part)
        if stops_early and part.holds is deciding:
            break
    holds: bool | None = not deciding
    values = [part.holds for part in truths]
    if deciding in values:
        holds = deciding
    elif None in values:
        holds = None
    return Truth(holds, evidence_for(holds, truths))


def evidence_for(holds: bool | None, parts: Iterable[Truth[Evidence]]) -> tuple[Evidence, ...]:
    """Return the evidence of the parts with one value."""
    return tuple(each for part in parts if part.holds is holds for each in part.evidence)


class Evaluator(ABC, Generic[Number, Evidence]):
    """Evaluate the syntax of conditions and numbers; a subclass is a vocabulary, with its `operators` of arithmetic."""

    operators: ClassVar[frozenset[str]] = frozenset("+-*/")
    stops_early: ClassVar[bool] = False

    def truth(self, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition holds."""
        match expr:
            case s.Logical(op=op, operands=operands):
                return combine(op, map(self.truth, operands), self.stops_early)
            case s.Unary(op="not", operand=operand):
                return self.negated(operand, expr)
            case s.Compare():
                return self.comparison(expr)
            case _:
                return self.statement(expr)

    def comparison(self, expr: s.Compare) -> Truth[Evidence]:
        """Return whether each side of a chain of comparisons compares with the next."""
        pairs = itertools.pairwise([("", expr.first), *expr.rest])
        truths = (self.compared(left, op, right, expr) for (_, left), (op, right) in pairs)
        return combine("and", truths, self.stops_early)

    def negated(self, operand: s.Expr, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition does not hold; `expr` is the whole, with `not`."""
        truth = self.truth(operand)
        return Truth(None if truth.holds is None else not truth.holds, truth.evidence)

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
    def statement(self, expr: s.Expr) -> Truth[Evidence]:
        """Return whether a condition of the vocabulary's own holds."""

    @abstractmethod
    def compared(self, left: s.Expr, op: str, right: s.Expr, chain: s.Compare) -> Truth[Evidence]:
        """Return whether two sides of a chain compare as written."""

    @abstractmethod
    def constant(self, value: int | float) -> Number:
        """Return a number as written."""

    @abstractmethod
    def arithmetic(self, op: str, *numbers: Number) -> Number:
        """Return the result of one of the `operators`, or of `neg`."""

    @abstractmethod
    def quantity(self, expr: s.Expr) -> Number:
        """Return a number of the vocabulary's own."""


Timed = Callable[[int], Array]
MOST_LEVELS = 2**32
"""States times steps for which a bit is kept, in half a gigabyte."""


def checked(expr: s.Expr, task: Task) -> Expression:
    """Return an expression of a claim with its type.

    Raises:
        InvalidClaim: with the first mistake in it.
    """
    collector = Collector()
    try:
        value = Checker(Builder(), collector).check(expr, scope(task, "claims"))
    except Refused as refused:
        raise InvalidClaim(refused.message, expr) from None
    if value is None:
        for mistake in collector.diagnostics:
            raise InvalidClaim(mistake.message, expr, mistake.hint)
        raise InvalidClaim("this cannot be understood", expr)
    return value.node


def condition(expr: s.Expr, task: Task) -> Expression:
    node = checked(expr, task)
    if node.type != BOOL or is_random([node]):
        raise InvalidClaim("a condition on states and actions is needed here", expr)
    return node


def condition_over_states(expr: s.Expr, model: Model) -> Array:
    """Return the states (S,) in which a condition holds."""
    about = [condition(expr, model.task)]
    if components_read(about, Role.ACTION) or reads_time(about):
        raise InvalidClaim("this condition is about states alone", expr)
    (value,) = evaluate(about, model.reads())
    return np.broadcast_to(value, (model.n_states,))


def condition_over_actions(expr: s.Expr, model: Model, of_states: bool = False) -> Timed:
    """Return a function from time to where (A, S) a condition on state, action and time holds; `of_states`: not on action."""
    about = [condition(expr, model.task)]
    if of_states and components_read(about, Role.ACTION):
        raise InvalidClaim("it says where, so it cannot depend on the action", expr)
    actions = model.actions.decode(np.arange(model.n_actions))
    repeated = {key: np.repeat(value, model.n_states, axis=-1) for key, value in actions.items()}

    def at(t: int) -> Array:
        states = {k: v if k == TIME else np.tile(v, model.n_actions) for k, v in model.reads(t).items()}
        (value,) = evaluate(about, states | repeated)
        size = model.n_actions * model.n_states
        return np.broadcast_to(value, (size,)).reshape(model.n_actions, model.n_states)

    if reads_time(about):
        if model.horizon is None:
            raise Undecidable("this condition depends on the time, and there is no horizon", expr)
        return at
    fixed = at(0)
    return lambda t: fixed


def preferred(model: Model, solver: Solver, rule: Rule, wanted: Timed, at: Timed | None) -> tuple[bool | None, str]:
    """Return whether the most frequent actions of a policy are wanted ones in states in which episodes act and `at` holds.

    Returns:
        None if rounding errors of the values leave it open; and the reason.
    """
    asked = np.zeros(model.n_states, np.bool_)
    settled = np.zeros_like(asked)
    unknown = np.zeros_like(asked)
    problem: str | None = None
    levels = _levels(model)
    for t, policy in solver.policies(rule):
        if t >= len(levels):
            continue
        here = np.unpackbits(levels[t], count=model.n_states).astype(np.bool_)
        if at is not None:
            here &= at(t)[0]
        if not here.any():
            continue
        preference = solver.numbers.preference(policy, wanted(t))
        asked |= here
        settled |= here & (preference == 1)
        unknown |= here & (preference == UNKNOWN)
        wrong = np.flatnonzero(here & (preference == -1))
        if len(wrong):
            state = int(wrong[0])
            column = solver.numbers.table(policy)[:, state]
            action = int(column.argmax())
            did = f"it takes {model.action_name(action)} with probability {column[action]:.6g}"
            problem = f"in {model.state_name(state)} at t = {t} {did}"
    if problem is not None:
        return False, problem
    if unknown.any():
        return None, f"its values are too close to tell in {model.state_name(int(np.flatnonzero(unknown)[0]))}"
    if not asked.any():
        return False, "no episode acts where this is asked"
    undecided = asked & ~settled
    if undecided.any():
        return False, f"it is indifferent in {model.state_name(int(np.flatnonzero(undecided)[0]))}"
    return True, f"in {int(asked.sum())} state{'s' if asked.sum() > 1 else ''}"


def _levels(model: Model) -> list[Array]:
    """Return the states in which episodes act at each time, as bits; a single entry without a horizon."""
    if model.horizon is None:
        return [np.packbits(model.acting)]
    if model.horizon * model.n_states > MOST_LEVELS:
        refuse("there are too many states and times to look at each", "choose smaller parameters")
    return [np.packbits(level) for _, level in model.levels()]


def influences(action: s.Expr, state: s.Expr, results: Results) -> tuple[bool | None, str]:
    """Return whether an action component can change the next value of a state component, and the reason.

    It cannot if the dynamics of the state do not read the action; otherwise an exact model is needed.
    """
    task = results.task
    actions = entries_by_name(task.action)
    states = all_names(task.state)
    if not (isinstance(action, s.Name) and action.id in actions):
        raise InvalidClaim(f"an action component is needed here: {', '.join(actions)}", action)
    if not (isinstance(state, s.Name) and state.id in states):
        raise InvalidClaim(f"a state component is needed here: {', '.join(states)}", state)
    following = task.process.next[states.index(state.id)]
    if action.id not in components_read([following], Role.ACTION):
        return False, f"the next {state.id} does not depend on {action.id}"
    if results.model is None or results.model.task is not task:
        raise Undecidable("whether the action matters can only be told from an exact model", action)
    return differs(results.model, action.id, state.id)
