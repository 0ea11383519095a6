"""Values of parameters as callers give them."""

from __future__ import annotations

import math
import reprlib
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.lang.types import INT_WIDEST


@dataclass(frozen=True)
class Varying:
    """Given for a parameter: it is left open, and read where the task runs. The value stands for it in messages."""

    value: Any


def convert(value: Any, kind: str) -> Any:
    """A value as the kind of a parameter, or None where it is of another kind, no number, or too large."""
    if isinstance(value, np.generic):
        value = value.item()
    if kind == "bool":
        return value if isinstance(value, bool) else None
    is_nan = isinstance(value, float) and math.isnan(value)
    if isinstance(value, bool) or not isinstance(value, int | float | Fraction) or is_nan:
        return None
    if kind == "int":
        return int(value) if -INT_WIDEST <= value <= INT_WIDEST and value == int(value) else None
    try:
        return float(value) if kind == "real" else None
    except OverflowError:
        return None


def article(kind: str) -> str:
    known = {"int": "an int", "real": "a real number", "bool": "true or false"}
    return known.get(kind, f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}")


def brief(value: Any) -> str:
    """A value from Python in a few words; ints may be longer than Python is willing to print."""
    if isinstance(value, int) and abs(value) > INT_WIDEST:
        return f"one of {value.bit_length()} bits"
    return reprlib.repr(value)
