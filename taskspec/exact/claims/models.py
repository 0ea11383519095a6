"""Decision models by the names that claims give them."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

from taskspec.exact.claims.refusals import Unfit
from taskspec.exact.claims.vocabulary import MODELS
from taskspec.exact.planning.certified.enclosure import Enclosure
from taskspec.exact.planning.certified.rule import Rule
from taskspec.exact.planning.maxent import MaxEnt
from taskspec.exact.planning.plans import Boltzmann, Greedy, Uniform
from taskspec.exact.scoring.returns import Results
from taskspec.lang import syntax as s

_PLAIN: dict[str, Callable[[], Rule]] = {
    "uniform": Uniform,
    "optimal": Greedy,
    "maxent": MaxEnt,
    "zero_terminal_value": Greedy,
}
_WITH_NUMBER: dict[str, Callable[[Fraction, s.Expr], Rule]] = {
    "soft": lambda beta, expr: Boltzmann(_temperature(beta, expr)),
    "maxent": lambda beta, expr: MaxEnt(_temperature(beta, expr)),
    "zero_terminal_value": lambda shift, expr: Greedy(shift),
}


def rule_named(expr: s.Expr | None, results: Results, number: Callable[[s.Expr], Enclosure]) -> Rule:
    """The rule of the decision model that an expression names; uniformly random actions for None.

    Raises:
        Unfit: when there is no such model.
    """
    match expr:
        case None:
            return Uniform()
        case s.Name(id="expert"):
            if results.expert_rule is None:
                raise Unfit("the spec gives no expert", expr)
            return results.expert_rule
        case s.Name(id=name) if name in _PLAIN:
            return _PLAIN[name]()
        case s.Call(function=name, args=(argument,)) if name in _WITH_NUMBER:
            found = number(argument)
            if not (found.is_exact and isinstance(found.low, Fraction)):
                raise Unfit("a decision model takes a number that is known exactly", argument)
            return _WITH_NUMBER[name](found.low, argument)
        case _:
            raise Unfit(
                f"a decision model is one of {', '.join(w.written.split(', ')[0] for w in MODELS.values())}", expr
            )


def _temperature(beta: Fraction, expr: s.Expr) -> float:
    """An inverse temperature as a float."""
    if not 1e-9 <= beta <= 1e9:
        raise Unfit("beta is a number between 1e-9 and 1e9", expr)
    found = float(beta)
    assert math.isfinite(found)
    return found
