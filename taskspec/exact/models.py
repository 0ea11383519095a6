"""Decision models by the names that claims give them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from taskspec.exact import plans
from taskspec.exact.claim_values import Number, Unfit
from taskspec.exact.plans import Plan
from taskspec.exact.returns import Results
from taskspec.exact.vocabulary import MODELS
from taskspec.lang import syntax as s

_PLAIN: dict[str, Callable[[Any], Plan]] = {
    "uniform": plans.uniform_plan,
    "optimal": plans.optimal_plan,
    "maxent": plans.maxent_plan,
    "zero_terminal_value": plans.zero_terminal_value_plan,
}
_WITH_NUMBER: dict[str, Callable[[Any, float], Plan]] = {
    "soft": plans.soft_plan,
    "maxent": plans.maxent_plan,
    "zero_terminal_value": plans.zero_terminal_value_plan,
}


def model_named(
    expr: s.Expr | None,
    results: Results,
    model: Callable[[s.Expr], Any],
    number: Callable[[s.Expr], Number],
) -> Plan:
    """The plan of the decision model that an expression names; uniformly random actions for None.

    Raises:
        Unfit: when there is no such model.
    """
    match expr:
        case None:
            plan = results.random_plan
            assert plan is not None
            return plan
        case s.Name(id="expert"):
            model(expr)
            if results.expert_plan is None:
                raise Unfit("the spec gives no expert", expr)
            return results.expert_plan
        case s.Name(id=name) if name in _PLAIN:
            return _PLAIN[name](model(expr))
        case s.Call(function=name, args=(argument,)) if name in _WITH_NUMBER:
            return _WITH_NUMBER[name](model(expr), float(number(argument).value))
        case _:
            raise Unfit(
                f"a decision model is one of {', '.join(w.written.split(', ')[0] for w in MODELS.values())}", expr
            )
