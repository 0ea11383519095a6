"""What the names in generated lane code mean in plain Python: total functions, as the operator table fixes them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from itertools import accumulate
from typing import Any

from taskspec import draws
from taskspec.lang import reference
from taskspec.lang.types import INT_MAX

_NAN, _INF = math.nan, math.inf


def _total(function: Callable[[float], float]) -> Callable[[float], float]:
    """The function with nan where it is not defined."""

    def total(x: float) -> float:
        try:
            return function(x)
        except ValueError:
            return _NAN

    return total


def floor(x: float) -> int:
    return math.floor(x) if -INT_MAX <= x <= INT_MAX else reference.floor(x)


def ceil(x: float) -> int:
    return math.ceil(x) if -INT_MAX <= x <= INT_MAX else reference.ceil(x)


def round_(x: float) -> int:
    return round(x) if -INT_MAX <= x <= INT_MAX else reference.round_(x)


def log(x: float) -> float:
    return math.log(x) if x > 0 else (-_INF if x == 0 else _NAN)


def sort(x: Any) -> list[Any]:
    """Of reals, with nan last and zeros without a sign."""
    ordered = sorted(v + 0.0 for v in x)
    return list(reference.sort(x)) if any(v != v for v in ordered) else ordered


def argsort(x: Any) -> Any:
    if any(v != v for v in x):
        return reference.argsort(x)
    return sorted(range(len(x)), key=x.__getitem__)


def cumsum(x: Any) -> list[Any]:
    return list(accumulate(x))


NAMESPACE: dict[str, Any] = {
    "nan": _NAN,
    "inf": _INF,
    "sqrt": _total(math.sqrt),
    "sin": _total(math.sin),
    "cos": _total(math.cos),
    "tan": _total(math.tan),
    "tanh": math.tanh,
    "atan2": math.atan2,
    "exp": reference.exp,
    "log": log,
    "div": reference.div,
    "floordiv": reference.floordiv,
    "pow_": reference.pow_,
    "sign": reference.sign,
    "floor": floor,
    "ceil": ceil,
    "round_": round_,
    "sum_": reference.sum_,
    "count": reference.sum_,
    "prod": math.prod,
    "min_": reference.min_,
    "max_": reference.max_,
    "argmin": reference.argmin,
    "argmax": reference.argmax,
    "sort": sort,
    "argsort": argsort,
    "cumsum": cumsum,
    "bisect_right": bisect_right,
    "bernoulli": draws.bernoulli,
    "poisson": draws.poisson,
    "dirichlet": draws.dirichlet,
    "weighted_categorical": draws.weighted_categorical,
}
