"""Evaluates the expression of a claim about one task. What claims may say is in `exact.vocabulary`.

Anything made of parameters and constants alone is checked and folded as everywhere in the language.
With `under:` beside the claim, that is the decision model: `probability(condition)` is asked under
it, and `prefers(condition, at=condition)` leaves the model out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Collector, SpecError, suggest
from taskspec.lang import syntax as s
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
from taskspec.rules.vocabulary import RESULTS, RETURNS, Undecidable, Unfit, holds_of_all, refuse_misplaced, rule_named
from taskspec.scores.pomdp_bounds import SEARCHES, best_observing
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
from taskspec.solve.solver import Solver


@dataclass(frozen=True, slots=True)
class Truth:
    """Whether a statement holds (None: that cannot be told), why, and the part that decides it."""

    holds: bool | None
    detail: str = ""
    place: s.Expr | None = None


@dataclass(frozen=True, slots=True)
class Terms:
    """How a claim is looked at: by which reading of floats; how sure, and on how many episodes, where it is simulated.

    With `soundly`, intervals of simulated returns hold whatever their distribution; otherwise they are normal ones.
    """

    as_written: bool = False
    soundly: bool = True
    confidence: float = 0.999
    episodes: int = 1000


class Evaluator:
    """Evaluates claims against one task's results; `simulated` counts the episodes that were needed.

    `rests_on` counts those on which the abstraction was tested that a result comes from.
    `ambiguous` says whether some number would be another one by the other reading of floats.
    """

    def __init__(self, results: Results, options: Mapping[str, Any], terms: Terms) -> None:
        self.results, self.options, self.terms = results, options, terms
        self.reader = Reader(terms.as_written)
        self.simulated = self.rests_on = 0

    @property
    def ambiguous(self) -> bool:
        return self.reader.ambiguous or self.results.is_ambiguous

    # -- statements -------------------------------------------------------------------------------

    def truth(self, expr: s.Expr) -> Truth:
        """Whether a statement holds."""
        match expr:
            case s.Logical(op=op, operands=operands):
                return self._logical(op, operands)
            case s.Unary(op="not", operand=operand):
                inner = self.truth(operand)
                return Truth(None if inner.holds is None else not inner.holds, inner.detail, expr)
            case s.Compare(first=first, rest=rest):
                return self._chain(first, rest, expr)
            case s.Call(function=name) if name in _STATEMENTS:
                return _STATEMENTS[name](self, expr)
            case s.Boolean(value=value):
                return Truth(value, str(value).lower(), expr)
            case _:
                raise Unfit("a claim is a statement that is true or false", expr)

    def _logical(self, op: str, operands: tuple[s.Expr, ...]) -> Truth:
        """Of three values: what decides is a false part of an `and`, a true one of an `or`."""
        found, unknown = Truth(op == "and"), None
        for operand in operands:
            found = self.truth(operand)
            if found.holds is (op == "or"):
                return found
            unknown = found if found.holds is None else unknown
        return unknown or found

    def _chain(self, first: s.Expr, rest: tuple[tuple[str, s.Expr], ...], expr: s.Expr) -> Truth:
        left, left_expr = self.number(first), first
        details, unknown = [], None
        for op, right_expr in rest:
            if op in ("in", "not in"):
                raise Unfit("a claim compares numbers", expr)
            right = self.number(right_expr)
            names = [e.id for e in (left_expr, right_expr) if isinstance(e, s.Name)]
            by_definition = len(names) == 2 and holds_of_all(op, *names)
            holds = by_definition or compare(op, left, right, self._tolerance(expr))
            details.append(_sides(left_expr, left, right_expr, right, holds))
            if holds is False:
                return Truth(False, details[-1], expr)
            unknown = details[-1] if holds is None else unknown
            left, left_expr = right, right_expr
        return Truth(True, "; ".join(details), expr) if unknown is None else Truth(None, unknown, expr)

    def _tolerance(self, expr: s.Expr) -> Fraction | None:
        written = self.options.get("tolerance")
        try:
            return None if written is None else self.reader(float(written))
        except Inexact:
            raise Unfit("a tolerance is a finite number", expr) from None

    # -- numbers ----------------------------------------------------------------------------------

    def number(self, expr: s.Expr) -> Enclosure:
        try:
            return self._number(expr)
        except NoNumber as error:
            raise Unfit(str(error), expr) from None

    def _number(self, expr: s.Expr) -> Enclosure:
        match expr:
            case s.Number(value=value):
                return self._read(value)
            case s.Name(id=name, primed=False) if name in RETURNS:
                return self._return(name, expr)
            case s.Name(id="states", primed=False) if not self._is_bound("states"):
                return Enclosure.exactly(Fraction(int(self._model(expr).entered.sum())))
            case s.Name(id="actions", primed=False) if not self._is_bound("actions"):
                return Enclosure.exactly(Fraction(self._model(expr).n_actions))
            case s.Call(function="probability"):
                return self._probability(expr)
            case s.Binary(op=op, left=left, right=right):
                return arithmetic(op, self.number(left), self.number(right))
            case s.Unary(op="-", operand=operand):
                return negative(self.number(operand))
            case s.Call(function="abs", args=(inner,)):
                return absolute(self.number(inner))
            case _:
                return self._constant(expr)

    def _read(self, value: Any) -> Enclosure:
        """A number as written: a float by the present reading."""
        try:
            return Enclosure.exactly(self.reader(value))
        except Inexact:
            return Enclosure.exactly(value)

    def _is_bound(self, name: str) -> bool:
        scope = self.results.task.surface.scopes.get("claims")
        return scope is not None and scope.lookup(name) is not None

    def _constant(self, expr: s.Expr) -> Enclosure:
        """Anything made of parameters and constants alone, by the language's own rules."""
        task, collector = self.results.task, Collector()
        try:
            value = Checker(task.builder, collector).check(expr, task.surface.scopes["claims"])
        except Refused as refused:
            raise Unfit(refused.message, expr) from None
        if value is None:
            refuse_misplaced(expr, self._is_bound)
            found = collector.diagnostics
            hint = suggest(expr.id, [*RESULTS, *task.values]) if isinstance(expr, s.Name) else found and found[0].hint
            raise Unfit(found[0].message if found else "this is not a number", expr, hint or None)
        if not isinstance(value.node, Const) or not value.node.type.is_scalar:
            raise Unfit("this depends on the state; a claim is about the task as a whole", expr)
        return self._read(value.node.value)

    def _return(self, name: str, expr: s.Expr) -> Enclosure:
        which = name.removesuffix("_return")
        if which == "expert" and self.results.task.expert is None:
            raise Unfit("the spec gives no expert", expr)
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
        """The best return of those who see observations only."""
        try:
            return best_observing(self.results, which, self.terms.as_written)
        except SpecError as error:
            raise Undecidable(f"'{name}' cannot be worked out: {error.diagnostics[0].message}", expr) from None

    def _model(self, expr: s.Expr) -> Model:
        model = self.results.model
        if model is None:
            raise Undecidable(f"this claim needs an exact model, which does not exist: {self.results.why_not}", expr)
        if self.results.faith is not None and self.results.faith.problem is not None:
            raise Undecidable("the abstraction that this would be told from is not faithful", expr)
        self.rests_on = max(self.rests_on, self.results.tested())
        return model

    def _solver(self, rule: Rule) -> Solver:
        return self.results.solvers.of(rule, self.terms.as_written)

    # -- functions of results ---------------------------------------------------------------------

    def arguments(self, expr: s.Call, names: tuple[str, ...]) -> dict[str, s.Expr]:
        """Arguments by name, positional ones in order."""
        found = dict(zip(names, expr.args, strict=False))
        if len(expr.args) > len(names):
            raise Unfit(f"{expr.function}({', '.join(names)}) was given {len(expr.args)} arguments", expr)
        for name, value in expr.keywords:
            if name not in names:
                compared = f"`==` compares: `{name} == {value.place.written}`" if self._is_bound(name) else None
                raise Unfit(f"{expr.function} has no argument '{name}'; it has {', '.join(names)}", value, compared)
            found[name] = value
        return found

    def needed(self, expr: s.Call, names: tuple[str, ...], required: tuple[str, ...]) -> dict[str, s.Expr]:
        found = self.arguments(expr, names)
        for name in required:
            if name not in found:
                raise Unfit(f"{expr.function} needs '{name}': {expr.function}({', '.join(names)})", expr)
        return found

    def under(self, claim: s.Expr) -> s.Expr | None:
        """The decision model written beside the claim."""
        written = self.options.get("under")
        if written is None:
            return None
        text = s.SourceText(str(written), lambda start, end: claim.place.span)
        found = parse_into(text, Collector())
        if found is None:
            raise Unfit(f"`under: {written}` is not a decision model", claim)
        return found

    @contextmanager
    def _acting(self, model: s.Expr | None) -> Iterator[None]:
        """For as long as the expert is the decision model, the results with its memory in the state."""
        own = self.results
        if isinstance(model, s.Name) and model.id == "expert":
            self.results = own.remembering
        try:
            yield
        finally:
            self.results = own

    def rule(self, expr: s.Expr | None) -> Rule:
        if isinstance(expr, s.Name) and expr.id == "expert":
            self.rests_on = max(self.rests_on, self.results.tested("expert"))
        return rule_named(expr, self.results, self.number)

    def reachable(self, expr: s.Call) -> Truth:
        given = self.needed(expr, ("condition",), ("condition",))
        model = self._model(expr)
        states = condition_over_states(given["condition"], model) & model.entered
        if not states.any():
            return Truth(False, "no episode is ever in such a state", expr)
        return Truth(True, f"episodes can be in {model.state_name(int(np.flatnonzero(states)[0]))}", expr)

    def _probability(self, expr: s.Call) -> Enclosure:
        given = self.needed(expr, ("condition", "under"), ("condition",))
        under = given.get("under") or self.under(expr)
        with self._acting(under):
            model = self._model(expr)
            states = condition_over_states(given["condition"], model)
            rule = self.rule(under)
            found = self._solver(rule).probability(rule, states)
        return Enclosure(max(found.low, Fraction(0)), min(found.high, Fraction(1)))

    def prefers(self, expr: s.Call) -> Truth:
        under = self.under(expr)
        if under is None:
            given = self.needed(expr, ("model", "condition", "at"), ("model", "condition"))
        else:
            given = self.needed(expr, ("condition", "at"), ("condition",))
        chosen = under or given["model"]
        with self._acting(chosen):
            model = self._model(expr)
            rule = self.rule(chosen)
            wanted = condition_over_actions(given["condition"], model)
            at = condition_over_times(given["at"], model) if "at" in given else None
            holds, detail = preferred(model, self._solver(rule), rule, wanted, at)
        return Truth(holds, detail, expr)

    def influences(self, expr: s.Call) -> Truth:
        given = self.needed(expr, ("action", "state"), ("action", "state"))
        holds, detail = influences(given["action"], given["state"], self.results)
        return Truth(holds, detail, expr)


def _sides(left: s.Expr, a: Enclosure, right: s.Expr, b: Enclosure, holds: bool | None) -> str:
    """Both sides with their values, in as many digits as tell them apart."""
    shown = str(a), str(b)
    if not holds and shown[0] == shown[1]:
        shown = _closely(a), _closely(b)
    return f"{_side(left, shown[0])}, {_side(right, shown[1])}".strip(", ")


def _closely(a: Enclosure) -> str:
    return digits(a.low, 17) if a.is_exact else f"between {digits(a.low, 17)} and {digits(a.high, 17)}"


def _side(expr: s.Expr, value: str) -> str:
    """A side of a comparison with its value; a number as written says so itself."""
    if isinstance(expr, s.Number):
        return ""
    text = expr.place.written
    return "" if not text or text == value else f"{text} is {value}"


_STATEMENTS: dict[str, Callable[[Evaluator, s.Call], Truth]] = {
    "reachable": Evaluator.reachable,
    "prefers": Evaluator.prefers,
    "influences": Evaluator.influences,
}
