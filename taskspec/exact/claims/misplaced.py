"""Results where they cannot stand: inside functions of the language, or conditions that are compared like numbers."""

from __future__ import annotations

from collections.abc import Callable

from taskspec.exact.claims.refusals import Unfit
from taskspec.exact.claims.vocabulary import FUNCTIONS, RESULTS
from taskspec.lang import syntax as s

NUMBERS = ("probability", "abs")
"""Functions of claims that give numbers; the others are conditions."""


def refuse_misplaced(expr: s.Expr, is_bound: Callable[[str], bool]) -> None:
    """Refuse (`Unfit`) what only claims can say, in an expression that the language itself refuses.

    `is_bound` tells the names that the spec gives a meaning of its own.
    """
    for part in s.below(expr):
        match part:
            case s.Call(function=name) if name in FUNCTIONS and name not in NUMBERS and not is_bound(name):
                hint = f"write `{part.place.written}`, or `not {part.place.written}`"
                raise Unfit(f"`{name}(...)` is a condition by itself: it is true or false, and no number", part, hint)
            case s.Call(function=name) if name in RESULTS and not is_bound(name):
                raise Unfit(f"'{name}' is a number, not a function", part, f"write `{name}`, without brackets")
            case s.Call(function="probability" as name) | s.Name(id=name) if part is not expr and (
                name in RESULTS or name == "probability"
            ):
                if not is_bound(name):
                    raise Unfit(_NO_FUNCTION, part, "for `max` and `min`, compare each part in a claim of its own")


_NO_FUNCTION = "of the results in a claim, `abs` and the operators of arithmetic can be taken, and no other function"
