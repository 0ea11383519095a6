"""Words of claims beyond the language: results, functions of results, and decision models."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from taskspec.lang import syntax as s
from taskspec.scores.returns import Results
from taskspec.solve.backward import Boltzmann, Greedy, Rule, Uniform
from taskspec.solve.enclosure import Enclosure
from taskspec.solve.plans import MaxEnt


class InvalidClaim(Exception):
    """An expression that is no claim: a sentence that says why."""

    def __init__(self, message: str, place: s.Expr | None = None, hint: str | None = None) -> None:
        super().__init__(message)
        self.place = place
        self.hint = hint


@dataclass(frozen=True, slots=True)
class Word:
    """A name, how it is written, and its meaning; the language reference is made from these.

    `phrase` is printed for it on pages, followed by `given` and the number in brackets, if any.
    """

    name: str
    written: str
    doc: str
    phrase: str = ""
    given: str = ""


RESULTS: dict[str, Word] = {
    w.name: w
    for w in (
        Word(
            "optimal_return",
            "optimal_return",
            "Expected return of the best policy, which knows the state.",
            "optimal return",
        ),
        Word("random_return", "random_return", "Expected return of uniformly random actions.", "random return"),
        Word("worst_return", "worst_return", "Expected return of the worst policy.", "worst return"),
        Word("expert_return", "expert_return", "Expected return of the expert.", "expert return"),
        Word(
            "remembering_return",
            "remembering_return",
            "Expected return of the best policy that sees observations only, and remembers all that it saw and did.",
            "return of the best policy with memory",
        ),
        Word(
            "memoryless_return",
            "memoryless_return",
            "Expected return of the best policy that always does the same when it sees the same.",
            "return of the best memoryless policy",
        ),
        Word(
            "states",
            "states",
            "The number of reachable states, the last one of an episode included.",
            "number of states",
        ),
        Word("actions", "actions", "How many actions there are.", "number of actions"),
    )
}

RETURNS = tuple(name for name in RESULTS if name.endswith("_return"))


def holds_of_all(op: str, left: str, right: str) -> bool:
    """Return whether a comparison of two returns holds in every task: none is above the optimal one, nor below the worst."""
    low, high = (left, right) if op == "<=" else (right, left)
    are_returns = op in ("<=", ">=") and {low, high} <= {*RETURNS}
    return are_returns and (high == "optimal_return" or low == "worst_return")


FUNCTIONS: dict[str, Word] = {
    w.name: w
    for w in (
        Word("reachable", "reachable(condition)", "Some episode visits a state that fulfils the condition."),
        Word(
            "probability", "probability(condition, under=model)",
            "How likely an episode visits such a state; under uniformly random actions unless `under` says otherwise.",
        ),
        Word(
            "prefers", "prefers(model, condition, at=condition)",
            "In every state that fulfils `at` and in which an action is taken, the actions that the model takes most often "
            "fulfil the condition. Times at which it is indifferent (within 10⁻⁹) are left out, such as a last action that "
            "changes nothing, but it must have a preference in each such state at some time. Both conditions may use `t`.",
        ),
        Word(
            "influences", "influences(action, state)",
            "The action component can change the next value of the state component.",
        ),
        Word("abs", "abs(number)", "Absolute value of a number made of results."),
    )
}  # fmt: skip

MODELS: dict[str, Word] = {
    w.name: w
    for w in (
        Word(
            "optimal", "optimal", "Takes the best actions, each equally often where several are best.",
            "an optimal agent",
        ),
        Word(
            "soft", "soft(beta)",
            "Causal maximum entropy: actions in proportion to exp(beta Q), where Q includes the entropy.",
            "a causal maximum-entropy agent", "with inverse temperature",
        ),
        Word(
            "maxent", "maxent, maxent(beta)",
            "Non-causal maximum entropy: whole trajectories in proportion to their probability times exp(beta return), "
            "as if the outcomes of chance could be chosen. beta is 1 unless given.",
            "a non-causal maximum-entropy learner", "with inverse temperature",
        ),
        Word(
            "zero_terminal_value", "zero_terminal_value, zero_terminal_value(shift)",
            "Optimal for the reward plus a constant, with a value of 0 after a terminal state. A learner that knows "
            "rewards up to a constant cannot tell the shifts apart.",
            "a learner that values every terminal state at zero", "with rewards shifted by",
        ),
        Word("uniform", "uniform", "Uniformly random actions.", "a random agent"),
        Word("expert", "expert", "The expert of the spec.", "the expert"),
    )
}  # fmt: skip


NUMBERS = ("probability", "abs")
"""Functions of claims that give numbers; the others are conditions."""


def refuse_misplaced(expr: s.Expr, is_bound: Callable[[str], bool]) -> None:
    """Raise InvalidClaim for results inside functions of the language, and conditions used as numbers.

    Args:
        expr: an expression that the language itself refuses.
        is_bound: whether the spec gives a name a meaning of its own.
    """
    for part in s.below(expr):
        match part:
            case s.Call(function=name) if name in FUNCTIONS and name not in NUMBERS and not is_bound(name):
                hint = f"write `{part.place.written}`, or `not {part.place.written}`"
                raise InvalidClaim(
                    f"`{name}(...)` is a condition by itself: it is true or false, and no number", part, hint
                )
            case s.Call(function=name) if name in RESULTS and not is_bound(name):
                raise InvalidClaim(f"'{name}' is a number, not a function", part, f"write `{name}`, without brackets")
            case s.Call(function="probability" as name) | s.Name(id=name) if part is not expr and (
                name in RESULTS or name == "probability"
            ):
                if not is_bound(name):
                    raise InvalidClaim(
                        _NO_FUNCTION, part, "for `max` and `min`, compare each part in a claim of its own"
                    )


_NO_FUNCTION = "of the results in a claim, `abs` and the operators of arithmetic can be taken, and no other function"


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
    """Return the policy rule of the decision model that an expression names; uniformly random actions for None.

    Raises:
        InvalidClaim: when there is no such model.
    """
    match expr:
        case None:
            return Uniform()
        case s.Name(id="expert"):
            if results.expert_rule is None:
                raise InvalidClaim("the spec gives no expert", expr)
            return results.expert_rule
        case s.Name(id=name) if name in _PLAIN:
            return _PLAIN[name]()
        case s.Call(function=name, args=(argument,)) if name in _WITH_NUMBER:
            found = number(argument)
            if not (found.is_exact and isinstance(found.low, Fraction)):
                raise InvalidClaim("a decision model takes a number that is known exactly", argument)
            return _WITH_NUMBER[name](found.low, argument)
        case _:
            raise InvalidClaim(
                f"a decision model is one of {', '.join(w.written.split(', ')[0] for w in MODELS.values())}", expr
            )


def _temperature(beta: Fraction, expr: s.Expr) -> float:
    if not 1e-9 <= beta <= 1e9:
        raise InvalidClaim("beta is a number between 1e-9 and 1e9", expr)
    found = float(beta)
    assert math.isfinite(found)
    return found
