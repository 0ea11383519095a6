"""Claims: the vocabulary of results of a task.

Anything made of parameters and constants alone is checked and folded as everywhere in the language.
With `under:` beside the claim, that is the decision model: `probability(condition)` is evaluated under
it, and `prefers(condition, at=condition)` leaves the model out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Collector, SpecError, suggest
from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.check import Checker
from taskspec.lang.ir import Const
from taskspec.lang.parse import parse_into
from taskspec.lang.types import Refused
from taskspec.model.model import Model
from taskspec.rules.conditions import (
    condition_over_actions,
    condition_over_states,
    condition_over_times,
    influences,
    preferred,
)
from taskspec.rules.evaluator import Evaluator, Truth, Undecidable
from taskspec.rules.vocabulary import RESULTS, RETURNS, InvalidClaim, holds_of_all, refuse_misplaced, rule_named
from taskspec.scores.partial_observability import SEARCHES, best_observing
from taskspec.scores.returns import Results
from taskspec.solve.backward import Rule
from taskspec.solve.enclosure import (
    Enclosure,
    Inexact,
    NoNumber,
    Reader,
    absolute,
    arithmetic,
    compare,
    digits,
    negative,
)
from taskspec.solve.solve import Solver


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

    `simulated` counts the episodes that were needed, and `rests_on` those on which the abstraction that a result comes
    from was tested. `ambiguous` says whether some number would be another one by the other reading of floats.
    """

    operators = frozenset(("+", "-", "*", "/", "//", "%", "**"))
    stops_early = True

    def __init__(self, results: Results, options: Mapping[str, Any], terms: Terms) -> None:
        self.results = results
        self.options = options
        self.terms = terms
        self.reader = Reader(terms.as_written)
        self.simulated = 0
        self.rests_on = 0
        self._numbers: dict[int, tuple[s.Expr, Enclosure]] = {}  # by id of the expression, which is kept alive

    @property
    def ambiguous(self) -> bool:
        return self.reader.ambiguous or self.results.is_ambiguous

    # -- statements -------------------------------------------------------------------------------

    def negated(self, operand: s.Expr, expr: s.Expr) -> Truth[Reason]:
        found = super().negated(operand, expr)
        return Truth(found.holds, (Reason(found.evidence[-1].text, expr),))

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
                holds, text = self._influences(expr)
            case _:
                raise InvalidClaim("a claim is a statement that is true or false", expr)
        return Truth(holds, (Reason(text, expr),))

    def comparison(self, expr: s.Compare) -> Truth[Reason]:
        """Return one reason for the whole chain: all of its parts if it holds, otherwise the part that decides."""
        found = super().comparison(expr)
        texts = [reason.text for reason in found.evidence]
        return Truth(found.holds, (Reason("; ".join(texts) if found.holds else texts[-1], expr),))

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
        try:
            return None if written is None else self.reader(float(written))
        except Inexact:
            raise InvalidClaim("a tolerance is a finite number", expr) from None

    # -- numbers ----------------------------------------------------------------------------------

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
        return negative(*numbers) if op == "neg" else arithmetic(op, *numbers)

    def quantity(self, expr: s.Expr) -> Enclosure:
        match expr:
            case s.Name(id=name, primed=False) if name in RETURNS:
                return self._return(name, expr)
            case s.Name(id="states", primed=False) if not self._is_bound("states"):
                return Enclosure.exactly(Fraction(int(self._model(expr).entered.sum())))
            case s.Name(id="actions", primed=False) if not self._is_bound("actions"):
                return Enclosure.exactly(Fraction(self._model(expr).n_actions))
            case s.Call(function="probability"):
                return self._probability(expr)
            case s.Call(function="abs", args=(inner,)):
                return absolute(self.number(inner))
            case _:
                return self._folded(expr)

    def _is_bound(self, name: str) -> bool:
        scope = self.results.task.surface.scopes.get("claims")
        return scope is not None and scope.lookup(name) is not None

    def _folded(self, expr: s.Expr) -> Enclosure:
        """Return the value of anything made of parameters and constants alone, by the language's own rules."""
        task = self.results.task
        collector = Collector()
        try:
            value = Checker(Builder(), collector).check(expr, task.surface.scopes["claims"])
        except Refused as refused:
            raise InvalidClaim(refused.message, expr) from None
        if value is None:
            refuse_misplaced(expr, self._is_bound)
            found = collector.diagnostics
            hint = suggest(expr.id, [*RESULTS, *task.values]) if isinstance(expr, s.Name) else found and found[0].hint
            raise InvalidClaim(found[0].message if found else "this is not a number", expr, hint or None)
        if not isinstance(value.node, Const) or not value.node.type.is_scalar:
            raise InvalidClaim("this depends on the state; a claim is about the task as a whole", expr)
        return self.constant(value.node.value)

    def _return(self, name: str, expr: s.Expr) -> Enclosure:
        which = name.removesuffix("_return")
        if which == "expert" and self.results.task.expert is None:
            raise InvalidClaim("the spec gives no expert", expr)
        if which in SEARCHES:
            return self._observed(which, name, expr)
        found = self.results.enclosure(which, self.terms.as_written)
        if found is not None:
            self.rests_on = max(self.rests_on, self.results.tested(which))
            return found
        sample = self.results.sample(which, self.terms.episodes)
        if sample is None:
            why = self.results.why_not or "its range of actions has no end"
            lack = "cannot be computed" if self.results.model else "needs an exact model, which does not exist"
            raise Undecidable(f"'{name}' {lack}: {why}", expr)
        self.simulated = max(self.simulated, sample.episodes)
        return self.results.interval(sample, self.terms.confidence, self.terms.soundly)

    def _observed(self, which: str, name: str, expr: s.Expr) -> Enclosure:
        """Return bounds on the best return of policies that see observations only."""
        try:
            return best_observing(self.results, which, self.terms.as_written)
        except SpecError as error:
            raise Undecidable(f"'{name}' cannot be worked out: {error.diagnostics[0].message}", expr) from None

    def _model(self, expr: s.Expr) -> Model:
        model = self.results.model
        if model is None:
            raise Undecidable(f"this claim needs an exact model, which does not exist: {self.results.why_not}", expr)
        if self.results.abstraction_check is not None and self.results.abstraction_check.problem is not None:
            raise Undecidable("the abstraction that this would be told from is not faithful", expr)
        self.rests_on = max(self.rests_on, self.results.tested())
        return model

    def _solver(self, rule: Rule) -> Solver:
        return self.results.solvers.of(rule, self.terms.as_written)

    # -- functions of results ---------------------------------------------------------------------

    def _arguments(self, expr: s.Call, names: tuple[str, ...], required: tuple[str, ...]) -> dict[str, s.Expr]:
        """Return arguments by name, positional ones in order."""
        written = f"{expr.function}({', '.join(names)})"
        if len(expr.args) > len(names):
            raise InvalidClaim(f"{written} was given {len(expr.args)} arguments", expr)
        found = dict(zip(names, expr.args, strict=False))
        for name, value in expr.keywords:
            if name not in names:
                hint = f"`==` compares: `{name} == {value.place.written}`" if self._is_bound(name) else None
                raise InvalidClaim(f"{expr.function} has no argument '{name}'; it has {', '.join(names)}", value, hint)
            found[name] = value
        for name in required:
            if name not in found:
                raise InvalidClaim(f"{expr.function} needs '{name}': {written}", expr)
        return found

    def _under(self, claim: s.Expr) -> s.Expr | None:
        """Return the decision model written beside the claim."""
        written = self.options.get("under")
        if written is None:
            return None
        text = s.SourceText(str(written), lambda start, end: claim.place.span)
        found = parse_into(text, Collector())
        if found is None:
            raise InvalidClaim(f"`under: {written}` is not a decision model", claim)
        return found

    @contextmanager
    def _under_model(self, model: s.Expr | None) -> Iterator[None]:
        """Use results with the memory in the state while the expert is the decision model."""
        own = self.results
        if isinstance(model, s.Name) and model.id == "expert":
            self.results = own.remembering
        try:
            yield
        finally:
            self.results = own

    def _rule(self, expr: s.Expr | None) -> Rule:
        if isinstance(expr, s.Name) and expr.id == "expert":
            self.rests_on = max(self.rests_on, self.results.tested("expert"))
        return rule_named(expr, self.results, self.number)

    def _reachable(self, expr: s.Call) -> tuple[bool, str]:
        given = self._arguments(expr, ("condition",), ("condition",))
        model = self._model(expr)
        states = condition_over_states(given["condition"], model) & model.entered
        if not states.any():
            return False, "no episode is ever in such a state"
        return True, f"episodes can be in {model.state_name(int(np.flatnonzero(states)[0]))}"

    def _probability(self, expr: s.Call) -> Enclosure:
        given = self._arguments(expr, ("condition", "under"), ("condition",))
        under = given.get("under") or self._under(expr)
        with self._under_model(under):
            model = self._model(expr)
            states = condition_over_states(given["condition"], model)
            rule = self._rule(under)
            found = self._solver(rule).probability(rule, states)
        return Enclosure(max(found.low, Fraction(0)), min(found.high, Fraction(1)))

    def _prefers(self, expr: s.Call) -> tuple[bool | None, str]:
        under = self._under(expr)
        if under is None:
            given = self._arguments(expr, ("model", "condition", "at"), ("model", "condition"))
        else:
            given = self._arguments(expr, ("condition", "at"), ("condition",))
        chosen = under or given["model"]
        with self._under_model(chosen):
            model = self._model(expr)
            rule = self._rule(chosen)
            wanted = condition_over_actions(given["condition"], model)
            at = condition_over_times(given["at"], model) if "at" in given else None
            return preferred(model, self._solver(rule), rule, wanted, at)

    def _influences(self, expr: s.Call) -> tuple[bool | None, str]:
        given = self._arguments(expr, ("action", "state"), ("action", "state"))
        return influences(given["action"], given["state"], self.results)


def _sides(left: s.Expr, a: Enclosure, right: s.Expr, b: Enclosure, holds: bool | None) -> str:
    """Return both sides with their values, in enough digits to distinguish them."""
    shown = str(a), str(b)
    if not holds and shown[0] == shown[1]:
        shown = _closely(a), _closely(b)
    return f"{_side(left, shown[0])}, {_side(right, shown[1])}".strip(", ")


def _closely(a: Enclosure) -> str:
    return digits(a.low, 17) if a.is_exact else f"between {digits(a.low, 17)} and {digits(a.high, 17)}"


def _side(expr: s.Expr, value: str) -> str:
    """Return a side of a comparison with its value; a number as written says so itself."""
    if isinstance(expr, s.Number):
        return ""
    text = expr.place.written
    return "" if not text or text == value else f"{text} is {value}"
