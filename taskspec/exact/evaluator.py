"""Evaluates the expression of a claim about one task. What claims may say is in `exact.vocabulary`.

Anything made of parameters and constants alone is checked and folded as everywhere in the language.
With `under:` beside the claim, that is the decision model: `probability(condition)` is asked under
it, and `prefers(condition, at=condition)` leaves the model out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector, suggest
from taskspec.exact import claim_values as v
from taskspec.exact.claim_values import Number, Undecidable, Unfit
from taskspec.exact.conditions import (
    condition_over_actions,
    condition_over_states,
    condition_over_times,
    influences,
    preferred,
)
from taskspec.exact.models import model_named
from taskspec.exact.plans import Plan
from taskspec.exact.returns import Results, Return
from taskspec.exact.solve import visit_probability
from taskspec.exact.vocabulary import RESULTS
from taskspec.lang import syntax as s
from taskspec.lang.check import Checker
from taskspec.lang.ir import Const
from taskspec.lang.parse import parse_into
from taskspec.lang.types import Refused

Array = np.ndarray[Any, Any]
RETURNS = tuple(name for name in RESULTS if name.endswith("_return"))


@dataclass(frozen=True, slots=True)
class Truth:
    """Whether a statement holds, why, and the part that decides it."""

    holds: bool
    detail: str = ""
    place: s.Expr | None = None


class Evaluator:
    """Evaluates claims against one task's results; `simulated` counts the episodes that were needed."""

    def __init__(self, results: Results, options: Mapping[str, Any], confidence: float, episodes: int) -> None:
        self.results, self.options = results, options
        self.confidence, self.episodes = confidence, episodes
        self.simulated = 0

    # -- statements -------------------------------------------------------------------------------

    def truth(self, expr: s.Expr) -> Truth:
        """Whether a statement holds."""
        match expr:
            case s.Logical(op=op, operands=operands):
                return self._logical(op, operands)
            case s.Unary(op="not", operand=operand):
                inner = self.truth(operand)
                return Truth(not inner.holds, inner.detail, expr)
            case s.Compare(first=first, rest=rest):
                return self._chain(first, rest, expr)
            case s.Call(function=name) if name in _STATEMENTS:
                return _STATEMENTS[name](self, expr)
            case s.Boolean(value=value):
                return Truth(value, str(value).lower(), expr)
            case _:
                raise Unfit("a claim is a statement that is true or false", expr)

    def _logical(self, op: str, operands: tuple[s.Expr, ...]) -> Truth:
        found = Truth(op == "and")
        for operand in operands:
            found = self.truth(operand)
            if found.holds is (op == "or"):
                return found
        return found

    def _chain(self, first: s.Expr, rest: tuple[tuple[str, s.Expr], ...], expr: s.Expr) -> Truth:
        left, left_expr = self.number(first), first
        details = []
        for op, right_expr in rest:
            if op in ("in", "not in"):
                raise Unfit("a claim compares numbers", expr)
            right = self.number(right_expr)
            holds = v.compare(op, left, right, self.options.get("tolerance"))
            details.append(f"{_side(left_expr, left)}, {_side(right_expr, right)}".strip(", "))
            if not holds:
                return Truth(False, details[-1], expr)
            left, left_expr = right, right_expr
        return Truth(True, "; ".join(details), expr)

    # -- numbers ----------------------------------------------------------------------------------

    def number(self, expr: s.Expr) -> Number:
        match expr:
            case s.Number(value=value):
                return Number.exactly(value)
            case s.Name(id=name, primed=False) if name in RETURNS:
                return self._return(name, expr)
            case s.Name(id="states", primed=False) if not self._is_bound("states"):
                return Number.exactly(int(self._model(expr).entered.sum()))
            case s.Name(id="actions", primed=False) if not self._is_bound("actions"):
                return Number.exactly(self._model(expr).n_actions)
            case s.Call(function="probability"):
                return self._probability(expr)
            case s.Binary(op=op, left=left, right=right):
                return v.arithmetic(op, self.number(left), self.number(right))
            case s.Unary(op="-", operand=operand):
                return v.negative(self.number(operand))
            case s.Call(function="abs", args=(inner,)):
                return v.absolute(self.number(inner))
            case _:
                return self._constant(expr)

    def _is_bound(self, name: str) -> bool:
        scope = self.results.task.surface.scopes.get("claims")
        return scope is not None and scope.lookup(name) is not None

    def _constant(self, expr: s.Expr) -> Number:
        """Anything made of parameters and constants alone, by the language's own rules."""
        task, collector = self.results.task, Collector()
        try:
            value = Checker(task.builder, collector).check(expr, task.surface.scopes["claims"])
        except Refused as refused:
            raise Unfit(refused.message, expr) from None
        if value is None:
            found = collector.diagnostics
            hint = suggest(expr.id, [*RESULTS, *task.values]) if isinstance(expr, s.Name) else found and found[0].hint
            raise Unfit(found[0].message if found else "this is not a number", expr, hint or None)
        if not isinstance(value.node, Const) or not value.node.type.is_scalar:
            raise Unfit("this depends on the state; a claim is about the task as a whole", expr)
        return Number.exactly(value.node.value)

    def _return(self, name: str, expr: s.Expr) -> Number:
        found: Return | None = getattr(self.results, name.removesuffix("_return"))
        if found is None:
            if name == "expert_return" and self.results.task.expert is None:
                raise Unfit("the spec gives no expert", expr)
            why = self.results.why_not or "its range of actions has no end"
            lack = "cannot be worked out" if self.results.model else "needs an exact model, and there is none"
            raise Undecidable(f"'{name}' {lack}: {why}", expr)
        if not found.exact and found.episodes < self.episodes:
            self.results = Results(self.results.task, self.episodes)
            return self._return(name, expr)
        self.simulated = max(self.simulated, found.episodes)
        low, high = found.interval(self.confidence)
        return Number(found.value, low, high)

    def _model(self, expr: s.Expr) -> Any:
        model = self.results.model
        if model is None:
            raise Undecidable(f"this claim needs an exact model, and there is none: {self.results.why_not}", expr)
        return model

    # -- functions of results ---------------------------------------------------------------------

    def arguments(self, expr: s.Call, names: tuple[str, ...]) -> dict[str, s.Expr]:
        """Arguments by name, positional ones in order."""
        found = dict(zip(names, expr.args, strict=False))
        if len(expr.args) > len(names):
            raise Unfit(f"{expr.function}({', '.join(names)}) was given {len(expr.args)} arguments", expr)
        for name, value in expr.keywords:
            if name not in names:
                raise Unfit(f"{expr.function} has no argument '{name}'; it has {', '.join(names)}", value)
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
        text = s.Text(str(written), lambda start, end: claim.place.span)
        found = parse_into(text, Collector())
        if found is None:
            raise Unfit(f"`under: {written}` is not a decision model", claim)
        return found

    def plan(self, expr: s.Expr | None) -> Plan:
        return model_named(expr, self.results, self._model, self.number)

    def reachable(self, expr: s.Call) -> Truth:
        given = self.needed(expr, ("condition",), ("condition",))
        model = self._model(expr)
        states = condition_over_states(given["condition"], model) & model.entered
        if not states.any():
            return Truth(False, "no episode is ever in such a state", expr)
        return Truth(True, f"episodes can be in {model.state_name(int(np.flatnonzero(states)[0]))}", expr)

    def _probability(self, expr: s.Call) -> Number:
        given = self.needed(expr, ("condition", "under"), ("condition",))
        model = self._model(expr)
        states = condition_over_states(given["condition"], model)
        return Number.exactly(visit_probability(model, self.plan(given.get("under") or self.under(expr)), states))

    def prefers(self, expr: s.Call) -> Truth:
        under = self.under(expr)
        if under is None:
            given = self.needed(expr, ("model", "condition", "at"), ("model", "condition"))
        else:
            given = self.needed(expr, ("condition", "at"), ("condition",))
        model = self._model(expr)
        plan = self.plan(under or given["model"])
        wanted = condition_over_actions(given["condition"], model)
        at = condition_over_times(given["at"], model) if "at" in given else None
        holds, detail = preferred(model, plan, wanted, at)
        return Truth(holds, detail, expr)

    def influences(self, expr: s.Call) -> Truth:
        given = self.needed(expr, ("action", "state"), ("action", "state"))
        holds, detail = influences(given["action"], given["state"], self.results)
        return Truth(holds, detail, expr)


def _side(expr: s.Expr, value: Number) -> str:
    """A side of a comparison with its value; a number as written says so itself."""
    if isinstance(expr, s.Number):
        return ""
    text = expr.place.text.value[expr.place.start : expr.place.end]
    return "" if not text or text.strip() == v.shown(value.value) else f"{text.strip()} is {value}"


_STATEMENTS: dict[str, Callable[[Evaluator, s.Call], Truth]] = {
    "reachable": Evaluator.reachable,
    "prefers": Evaluator.prefers,
    "influences": Evaluator.influences,
}
