"""Claims: the vocabulary of results of a task.

Anything made of parameters and constants alone is checked and folded as everywhere in the language.
With `under:` beside the claim, that is the decision model: `probability(condition)` is evaluated under
it, and `prefers(condition, at=condition)` leaves the model out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Advice, Collector, SpecError, suggest
from taskspec.exact.model.model import Model
from taskspec.exact.model.probabilities import TAIL, Inexact, Reader, Slack
from taskspec.exact.model.transitions import Steps
from taskspec.exact.rules.evaluator import (
    Evaluator,
    InvalidClaim,
    Truth,
    Undecidable,
    Word,
    checked,
    condition_over_actions,
    condition_over_states,
    influences,
    preferred,
)
from taskspec.exact.scores.difficulty import SEARCHES, best_observing
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.backward import Boltzmann, Greedy, Rule, Uniform
from taskspec.exact.solve.enclosure import Enclosure, NoNumber, absolute, arithmetic, compare, digits, negative
from taskspec.exact.solve.plans import MaxEnt
from taskspec.exact.solve.solve import Solver
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import parse_into
from taskspec.language.task.questions import constant, scope


def _vocabulary(*rows: tuple[str, ...]) -> dict[str, Word]:
    return {row[0]: Word(*row) for row in rows}


RESULTS = _vocabulary(
    ("optimal_return", "optimal_return", "Expected return of the best policy, which knows the state.", "optimal return"),
    ("random_return", "random_return", "Expected return of uniformly random actions.", "random return"),
    ("worst_return", "worst_return", "Expected return of the worst policy.", "worst return"),
    ("expert_return", "expert_return", "Expected return of the expert.", "expert return"),
    ("remembering_return", "remembering_return",
     "Expected return of the best policy that sees observations only, and remembers all that it saw and did.",
     "return of the best policy with memory"),
    ("memoryless_return", "memoryless_return",
     "Expected return of the best policy that always does the same when it sees the same.",
     "return of the best memoryless policy"),
    ("states", "states", "The number of reachable states, the last one of an episode included.", "number of states"),
    ("actions", "actions", "How many actions there are.", "number of actions"),
)  # fmt: skip
RETURNS = tuple(name for name in RESULTS if name.endswith("_return"))
FUNCTIONS = _vocabulary(
    ("reachable", "reachable(condition)", "Some episode visits a state that fulfils the condition."),
    ("probability", "probability(condition, under=model)",
     "How likely an episode visits such a state; under uniformly random actions unless `under` says otherwise."),
    ("measure", "measure(name, under=model)",
     "Expected sum of a measure over an episode, discounted like the return; `under` as of `probability`."),
    ("prefers", "prefers(model, condition, at=condition)",
     "In every state that fulfils `at` and in which an action is taken, the actions that the model takes most often fulfil the "
     "condition. Times at which it is indifferent (within 10⁻⁹) are left out, but it must have a preference in each such "
     "state at some time. Both conditions may use `t`."),
    ("influences", "influences(action, state)", "The action component can change the next value of the state component."),
    ("abs", "abs(number)", "Absolute value of a number made of results."),
)  # fmt: skip
MODELS = _vocabulary(
    ("optimal", "optimal", "Takes the best actions, each equally often where several are best.", "an optimal agent"),
    ("soft", "soft(beta)", "Causal maximum entropy: actions in proportion to exp(beta Q), where Q includes the entropy.",
     "a causal maximum-entropy agent", "with inverse temperature"),
    ("maxent", "maxent, maxent(beta)",
     "Non-causal maximum entropy: whole trajectories in proportion to their probability times exp(beta return), "
     "as if the outcomes of chance could be chosen. beta is 1 unless given.",
     "a non-causal maximum-entropy learner", "with inverse temperature"),
    ("zero_terminal_value", "zero_terminal_value, zero_terminal_value(shift)",
     "Optimal for the reward plus a constant, with a value of 0 after a terminal state. A learner that knows "
     "rewards up to a constant cannot tell the shifts apart.",
     "a learner that values every terminal state at zero", "with rewards shifted by"),
    ("uniform", "uniform", "Uniformly random actions.", "a random agent"),
    ("expert", "expert", "The expert of the spec.", "the expert"),
)  # fmt: skip
PLAIN_MODELS: Mapping[str, Callable[[], Rule]] = {
    "uniform": Uniform, "optimal": Greedy, "maxent": MaxEnt, "zero_terminal_value": Greedy,
}  # fmt: skip
NO_FUNCTION = "of the results in a claim, `abs` and the operators of arithmetic can be taken, and no other function"


def holds_of_all(op: str, left: str, right: str) -> bool:
    """Return whether a comparison of two returns holds in every task: none is above the optimal one, nor below the worst."""
    if op == "<=":
        low, high = (left, right)
    else:
        low, high = (right, left)
    are_returns = op in ("<=", ">=") and {low, high} <= {*RETURNS}
    return are_returns and (high == "optimal_return" or low == "worst_return")


def rule_named(expr: s.Expr | None, results: Results, number: Callable[[s.Expr], Enclosure]) -> Rule:
    """Return the policy rule of the decision model that an expression names; uniformly random actions for None."""
    match expr:
        case None:
            return Uniform()
        case s.Name(id="expert"):
            if results.expert_rule is None:
                raise InvalidClaim("the spec gives no expert", expr)
            return results.expert_rule
        case s.Name(id=name) if name in PLAIN_MODELS:
            return PLAIN_MODELS[name]()
        case s.Call(function="soft" | "maxent" | "zero_terminal_value" as name, args=(argument,)):
            parameter = number(argument)
            value = parameter.low
            if not (parameter.is_exact and isinstance(value, Fraction)):
                raise InvalidClaim("a decision model takes a number that is known exactly", argument)
            if name == "zero_terminal_value":
                return Greedy(value)
            if not 1e-9 <= value <= 1e9:
                raise InvalidClaim("beta is a number between 1e-9 and 1e9", argument)
            if name == "soft":
                return Boltzmann(float(value))
            return MaxEnt(float(value))
        case _:
            names = ", ".join(w.written.split(", ")[0] for w in MODELS.values())
            raise InvalidClaim(f"a decision model is one of {names}", expr)


@dataclass(frozen=True, slots=True)
class Reason:
    """Evidence for or against a claim: a sentence, and the part of the claim that it is about."""

    text: str
    place: s.Expr


@dataclass(frozen=True, slots=True)
class Terms:
    """Settings of an evaluation: the reading of floats; confidence and episodes of simulations.

    With `soundly`, intervals of simulated returns hold for any distribution; otherwise they are normal ones.
    """

    as_written: bool = False
    soundly: bool = True
    confidence: float = 0.999
    episodes: int = 1000


class ClaimEvaluator(Evaluator[Enclosure, Reason]):
    """Evaluate claims on the results of one task; the last reason is the one that decides.

    `simulated` counts the episodes that were needed. `ambiguous` says whether some number would be another one by the other
    reading of floats.
    """

    operators = frozenset(("+", "-", "*", "/", "//", "%", "**"))
    stops_early = True

    def __init__(self, results: Results, options: Mapping[str, Any], terms: Terms) -> None:
        self.results = results
        self.options = options
        self.terms = terms
        self.reader = Reader(terms.as_written)
        self.simulated = 0
        self._numbers: dict[int, tuple[s.Expr, Enclosure]] = {}  # by id of the expression, which is kept alive

    @property
    def ambiguous(self) -> bool:
        return self.reader.ambiguous or self.results.is_ambiguous

    def negated(self, operand: s.Expr, expr: s.Expr) -> Truth[Reason]:
        truth = super().negated(operand, expr)
        return Truth(truth.holds, (Reason(truth.evidence[-1].text, expr),))

    def statement(self, expr: s.Expr) -> Truth[Reason]:
        holds: bool | None
        match expr:
            case s.Boolean(value=value):
                return Truth(value, (Reason(str(value).lower(), expr),))
            case s.Call(function="reachable"):
                holds, text = self._reachable(expr)
            case s.Call(function="prefers"):
                holds, text = self._prefers(expr)
            case s.Call(function="influences"):
                given = self._arguments(expr, ("action", "state"), ("action", "state"))
                holds, text = influences(given["action"], given["state"], self.results)
            case _:
                raise InvalidClaim("a claim is a statement that is true or false", expr)
        return Truth(holds, (Reason(text, expr),))

    def comparison(self, expr: s.Compare) -> Truth[Reason]:
        """Return one reason for the whole chain: all of its parts if it holds, otherwise the part that decides."""
        truth = super().comparison(expr)
        text = truth.evidence[-1].text
        if truth.holds:
            text = "; ".join(reason.text for reason in truth.evidence)
        return Truth(truth.holds, (Reason(text, expr),))

    def compared(self, left: s.Expr, op: str, right: s.Expr, chain: s.Compare) -> Truth[Reason]:
        a = self.number(left)
        if op in ("in", "not in"):
            raise InvalidClaim("a claim compares numbers", chain)
        b = self.number(right)
        names = [side.id for side in (left, right) if isinstance(side, s.Name)]
        by_definition = len(names) == 2 and holds_of_all(op, *names)
        holds = by_definition or compare(op, a, b, self._tolerance(chain))
        return Truth(holds, (Reason(_sides(left, a, right, b, holds), chain),))

    def _tolerance(self, expr: s.Expr) -> Fraction | None:
        written = self.options.get("tolerance")
        if written is None:
            return None
        try:
            return self.reader(float(written))
        except Inexact:
            raise InvalidClaim("a tolerance is a finite number", expr) from None

    def number(self, expr: s.Expr) -> Enclosure:
        if id(expr) not in self._numbers:
            try:
                self._numbers[id(expr)] = (expr, super().number(expr))
            except NoNumber as error:
                raise InvalidClaim(str(error), expr) from None
        return self._numbers[id(expr)][1]

    def constant(self, value: Any) -> Enclosure:
        """Return a number as written: a float by the present reading."""
        try:
            return Enclosure.exactly(self.reader(value))
        except Inexact:
            return Enclosure.exactly(value)

    def arithmetic(self, op: str, *numbers: Enclosure) -> Enclosure:
        if op == "neg":
            return negative(*numbers)
        return arithmetic(op, *numbers)

    def quantity(self, expr: s.Expr) -> Enclosure:
        match expr:
            case s.Name(id=name, primed=False) if name in RETURNS:
                return self._return(name, expr)
            case s.Name(id="states", primed=False) if not self._is_bound("states"):
                return self._states(self._model(expr))
            case s.Name(id="actions", primed=False) if not self._is_bound("actions"):
                return Enclosure.exactly(Fraction(self._model(expr).n_actions))
            case s.Call(function="probability"):
                return self._probability(expr)
            case s.Call(function="measure"):
                return self._measure(expr)
            case s.Call(function="abs", args=(inner,)):
                return absolute(self.number(inner))
            case _:
                return self._folded(expr)

    def _is_bound(self, name: str) -> bool:
        return scope(self.results.task, "claims").lookup(name) is not None

    def _folded(self, expr: s.Expr) -> Enclosure:
        task = self.results.task
        try:
            node = checked(expr, task)
        except InvalidClaim as error:
            self._refuse_misplaced(expr)
            if isinstance(expr, s.Name):
                error.hint = suggest(expr.id, [*RESULTS, *task.values])
            raise
        value = constant(node)
        if value is None or not node.type.is_scalar:
            raise InvalidClaim("this depends on the state; a claim is about the task as a whole", expr)
        return self.constant(value)

    def _refuse_misplaced(self, expr: s.Expr) -> None:
        """Raise InvalidClaim for results inside functions of the language, and conditions used as numbers."""
        for part in s.below(expr):
            if not isinstance(part, s.Name | s.Call):
                continue
            if isinstance(part, s.Name):
                name = part.id
            else:
                name = part.function
            if self._is_bound(name) or name not in (*RESULTS, *FUNCTIONS):
                continue
            if isinstance(part, s.Call) and name in ("reachable", "prefers", "influences"):
                hint = f"write `{part.place.written}`, or `not {part.place.written}`"
                message = f"`{name}(...)` is a condition by itself: it is true or false, and no number"
                raise InvalidClaim(message, part, hint)
            if isinstance(part, s.Call) and name in RESULTS:
                hint = Advice(f"write `{name}`, without brackets", part.place.written, name)
                raise InvalidClaim(f"'{name}' is a number, not a function", part, hint)
            if part is not expr:
                raise InvalidClaim(NO_FUNCTION, part, "for `max` and `min`, compare each part in a claim of its own")

    def _return(self, name: str, expr: s.Expr) -> Enclosure:
        which = name.removesuffix("_return")
        if which == "expert" and self.results.task.annotations.expert is None:
            raise InvalidClaim("the spec gives no expert", expr)
        if which in SEARCHES:  # of policies that see observations only
            try:
                return best_observing(self.results, which, self.terms.as_written)
            except SpecError as error:
                raise Undecidable(f"'{name}' cannot be worked out: {error.diagnostics[0].message}", expr) from None
        value = self.results.enclosure(which, self.terms.as_written)
        if value is not None:
            return value
        sample = self.results.sample(which, self.terms.episodes)
        if sample is None:
            why = self.results.why_not or "its range of actions has no end"
            lack = "cannot be computed"
            if self.results.model is None:
                lack = "needs an exact model, which does not exist"
            raise Undecidable(f"'{name}' {lack}: {why}", expr)
        self.simulated = max(self.simulated, sample.episodes)
        return self.results.interval(sample, self.terms.confidence, self.terms.soundly)

    def _model(self, expr: s.Expr, results: Results | None = None) -> Model:
        results = results or self.results
        if results.model is None:
            raise Undecidable(f"this claim needs an exact model, which does not exist: {results.why_not}", expr)
        return results.model

    def _arguments(self, expr: s.Call, names: tuple[str, ...], required: tuple[str, ...]) -> dict[str, s.Expr]:
        written = f"{expr.function}({', '.join(names)})"
        if len(expr.args) > len(names):
            raise InvalidClaim(f"{written} was given {len(expr.args)} arguments", expr)
        given = dict(zip(names, expr.args, strict=False))
        for name, value in expr.keywords:
            if name not in names:
                hint = None
                if self._is_bound(name):
                    hint = f"`==` compares: `{name} == {value.place.written}`"
                raise InvalidClaim(f"{expr.function} has no argument '{name}'; it has {', '.join(names)}", value, hint)
            given[name] = value
        for name in required:
            if name not in given:
                raise InvalidClaim(f"{expr.function} needs '{name}': {written}", expr)
        return given

    def _under(self, claim: s.Expr) -> s.Expr | None:
        written = self.options.get("under")
        if written is None:
            return None
        text = s.SourceText(str(written), lambda start, end: claim.place.span)
        expr = parse_into(text, Collector())
        if expr is None:
            raise InvalidClaim(f"`under: {written}` is not a decision model", claim)
        return expr

    def _under_model(self, expr: s.Expr, decides: s.Expr | None) -> tuple[Model, Rule, Solver]:
        results, rule = self._decided(expr, decides)
        return self._model(expr, results), rule, results.solvers.of(rule, self.terms.as_written)

    def _decided(self, expr: s.Expr, decides: s.Expr | None) -> tuple[Results, Rule]:
        """Return results that have an exact model, and the rule of a decision model; the memory of an expert is in the state."""
        results = self.results
        if isinstance(decides, s.Name) and decides.id == "expert":
            results = results.remembering
        self._model(expr, results)
        return results, rule_named(decides, results, self.number)

    def _states(self, model: Model) -> Enclosure:
        entered = Fraction(int(model.entered.sum()))
        if _leaves_out(model):
            return Enclosure(entered, Fraction(model.states.size))
        return Enclosure.exactly(entered)

    def _reachable(self, expr: s.Call) -> tuple[bool | None, str]:
        given = self._arguments(expr, ("condition",), ("condition",))
        model = self._model(expr)
        states = condition_over_states(given["condition"], model) & model.entered
        if not states.any():
            if _leaves_out(model):
                return None, f"no episode is ever in such a state, unless by draws of a probability below {TAIL}"
            return False, "no episode is ever in such a state"
        return True, f"episodes can be in {model.state_name(int(np.flatnonzero(states)[0]))}"

    def _probability(self, expr: s.Call) -> Enclosure:
        given = self._arguments(expr, ("condition", "under"), ("condition",))
        model, rule, solver = self._under_model(expr, given.get("under") or self._under(expr))
        chance = solver.probability(rule, condition_over_states(given["condition"], model))
        return Enclosure(max(chance.low, Fraction(0)), min(chance.high, Fraction(1)))

    def _measure(self, expr: s.Call) -> Enclosure:
        given = self._arguments(expr, ("name", "under"), ("name",))
        known = self.results.task.process.measures
        written = given["name"]
        if not (isinstance(written, s.Name) and written.id in known):
            hint = "`measures:` declares them"
            if known:
                hint = f"it has {', '.join(known)}"
            raise InvalidClaim("the task has no such measure", written, hint)
        results, rule = self._decided(expr, given.get("under") or self._under(expr))
        try:
            return results.measure_under(written.id, rule, self.terms.as_written)
        except SpecError as error:
            raise Undecidable(f"the measure cannot be worked out: {error.diagnostics[0].message}", expr) from None

    def _prefers(self, expr: s.Call) -> tuple[bool | None, str]:
        under = self._under(expr)
        names: tuple[str, ...] = ("condition", "at")
        if under is None:
            names = ("model", *names)
        given = self._arguments(expr, names, names[:-1])
        model, rule, solver = self._under_model(expr, under or given["model"])
        wanted = condition_over_actions(given["condition"], model)
        at = None
        if "at" in given:
            at = condition_over_actions(given["at"], model, of_states=True)
        return preferred(model, solver, rule, wanted, at)


def _leaves_out(model: Model) -> bool:
    """Test whether the model is without the tails of some draws."""
    steps = Steps(model.task)
    return Slack.of([*steps.first, *steps.roots]).missing > 0


def _sides(left: s.Expr, a: Enclosure, right: s.Expr, b: Enclosure, holds: bool | None) -> str:
    """Return both sides with their values, in enough digits to distinguish them; a number as written says so itself."""
    shown = [str(a), str(b)]
    if not holds and shown[0] == shown[1]:
        for i, each in enumerate((a, b)):
            shown[i] = f"between {digits(each.low, 17)} and {digits(each.high, 17)}"
            if each.is_exact:
                shown[i] = digits(each.low, 17)
    sides = []
    for expr, value in zip((left, right), shown, strict=True):
        text = expr.place.written
        if not isinstance(expr, s.Number) and text and text != value:
            sides.append(f"{text} is {value}")
    return ", ".join(sides)
