"""What the names in generated scalar code mean."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Any

from taskspec import draws
from taskspec.lang.operators import OPERATORS


def namespace() -> dict[str, Any]:
    """Names and what they are: numbers, the functions of the operator table, and draws."""
    return {
        "nan": math.nan,
        "inf": math.inf,
        **{name: function for operator in OPERATORS.values() for name, function in operator.scalar.names.items()},
        "bisect_right": bisect_right,
        "bernoulli": draws.bernoulli,
        "weighted_categorical": draws.weighted_categorical,
    }
