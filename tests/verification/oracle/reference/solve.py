"""Returns by brute force: backward induction over the steps that are left, in fractions."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from fractions import Fraction
from functools import cache

from tests.verification.oracle.reference.chance import Endless
from tests.verification.oracle.reference.model import Key, Model, expert_shares

Choose = Callable[[dict[int, Fraction], Key, int], Fraction]
"""From the gains of the legal actions, by number, to a value."""


def value_of(model: Model, choose: Choose) -> Fraction:
    """Expected discounted return from the start, where `choose` makes one value of those of the actions."""
    task = model.task
    assert task.horizon is not None
    horizon = task.horizon
    discount = Fraction(task.discount)

    @cache
    def value(key: Key, t: int) -> Fraction:
        if t == horizon:
            return Fraction(0)
        return choose({a: gain(key, a, t) for a in model.legal(key)}, key, t)

    def gain(key: Key, action: int, t: int) -> Fraction:
        total = Fraction(0)
        for o in model.row(key, action, t):
            later = Fraction(0) if o.terminated else discount * value(o.state, t + 1)
            total += o.probability * (Fraction(o.reward) + later)
        return total

    return sum((p * value(key, 0) for key, p in model.start().items()), Fraction(0))


def optimal(gains: dict[int, Fraction], key: Key, t: int) -> Fraction:
    return max(gains.values())


def worst(gains: dict[int, Fraction], key: Key, t: int) -> Fraction:
    return min(gains.values())


def uniform(gains: dict[int, Fraction], key: Key, t: int) -> Fraction:
    return sum(gains.values(), Fraction(0)) / len(gains)


def by_expert(model: Model) -> Choose:
    def choose(gains: dict[int, Fraction], key: Key, t: int) -> Fraction:
        return sum((p * gains[a] for a, p in expert_shares(model, key, t).items()), Fraction(0))

    return choose


def returns(model: Model) -> dict[str, Fraction]:
    """The returns that claims speak of, by name."""
    found = {
        "optimal_return": value_of(model, optimal),
        "random_return": value_of(model, uniform),
        "worst_return": value_of(model, worst),
    }
    expert = model.task.sections.get("expert")
    if expert is not None and expert != "optimal" and not str(expert).startswith("soft("):
        with suppress(Endless):  # an expert that draws more than anybody lists
            found["expert_return"] = value_of(model, by_expert(model))
    return found
