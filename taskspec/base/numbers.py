"""Numbers as text for people: with a real minus sign, `∞` for infinity, and no negative zero."""

from __future__ import annotations

import math
from typing import Any


def number(value: float, digits: int = 6) -> str:
    """Return a number with significant digits: `0.333333`, `−2`, `1e+20`."""
    return _signed(f"{value:.{digits}g}")


def decimal(value: float, places: int = 4) -> str:
    """Return a number in decimals without trailing zeros, thousands apart: `12,345.5`; three digits of very small ones."""
    text = f"{value:,.{places}f}" if abs(value) < 1e15 else f"{value:.4g}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if value != 0 and not text.strip("-0."):
        text = f"{value:.3g}"
    return _signed(text)


def fixed(value: float, places: int) -> str:
    """Return a number with so many decimals, thousands apart: `0.50`."""
    return _signed(f"{value:,.{places}f}")


def estimate(value: float, half: float) -> tuple[str, str]:
    """Return a mean and half its confidence interval, to the digits that the interval allows."""
    if not half > 0:
        return decimal(value), "0"
    if not 1e-9 < half < 1e15:
        return number(value, 3), number(half, 2)
    places = max(0, 1 - math.floor(math.log10(half)))
    return fixed(value, places), fixed(half, places)


def setting(value: Any) -> str:
    """Return the value of a parameter: `true`, `0.5`, `left`."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def plural(count: int, noun: str) -> str:
    """Return a count with its noun: `1 task`, `1,200 tasks`."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def _signed(text: str) -> str:
    if not text.strip("-0.,"):
        text = text.removeprefix("-")
    return text.replace("inf", "∞").replace("-", "−")
