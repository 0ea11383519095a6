"""Poisson draws whose counts come to the same from some count on: few outcomes, and the values of a plain program."""

import math
from collections.abc import Callable
from functools import cache
from itertools import product

import pytest
from scipy.stats import poisson

from taskspec.exact import extract
from taskspec.exact.model.transitions import Steps
from taskspec.exact.scores.returns import Results
from taskspec.language.task.task import Task
from tests.shared.sections import build_text

LOTS = 3
HORIZON = 3
RATES = (3.0, 4.0, 3.0, 2.0)
RENTAL = f"""
state: {{first: {{type: int, low: 0, high: {LOTS}}}, second: {{type: int, low: 0, high: {LOTS}}}}}
action: {{a: {{type: int, low: -1, high: 1}}}}
horizon: {HORIZON}
discount: 0.9
definitions:
  moved: clip(a, -min(second, {LOTS} - first), min(first, {LOTS} - second))
  here: first - moved
  there: second + moved
noise: {{asked: Poisson(3), wanted: Poisson(4), back: Poisson(3), returned: Poisson(2)}}
initial: {{first: {LOTS}, second: 0}}
dynamics:
  first': min(max(here - asked, 0) + back, {LOTS})
  second': min(there - min(there, wanted) + returned, {LOTS})
reward: 10 * (min(here, asked) + min(there, wanted)) - 2 * abs(moved)
"""


def test_car_rental_is_solved_as_by_a_plain_program() -> None:
    found = Results(build_text(RENTAL)).optimal
    assert found is not None and found.exact
    assert found.value == pytest.approx(best(LOTS, 0, HORIZON), abs=1e-12)
    assert abs(found.value - best(LOTS, 0, HORIZON)) <= found.bound + 1e-12


@cache
def chances(rate: float, most: int) -> list[float]:
    """Of 0, 1, ..., and the last of `most` or more."""
    return [*poisson.pmf(range(most), rate), poisson.sf(most - 1, rate)]


def best(first: int, second: int, left: int, known: dict[tuple[int, int, int], float] | None = None) -> float:
    known = {} if known is None else known
    if left == 0 or (first, second, left) in known:
        return known.get((first, second, left), 0.0)
    values = []
    for a in (-1, 0, 1):
        moved = max(min(a, min(first, LOTS - second)), -min(second, LOTS - first))
        here = first - moved
        there = second + moved
        terms = [-2.0 * abs(moved)]
        for drawn in product(range(LOTS + 1), repeat=4):
            p = math.prod(chances(rate, LOTS)[k] for rate, k in zip(RATES, drawn, strict=True))
            asked, wanted, back, returned = drawn
            gone = min(here, asked)
            away = min(there, wanted)
            after = min(here - gone + back, LOTS), min(there - away + returned, LOTS)
            terms.append(p * (10 * (gone + away) + 0.9 * best(*after, left - 1, known)))
        values.append(math.fsum(terms))
    known[first, second, left] = max(values)
    return max(values)


def line(expression: str) -> Task:
    return build_text(
        "state: {s: {type: int, low: 0, high: 5}}\naction: {a: {type: int, low: 0, high: 2}}\n"
        f"horizon: 2\ninitial: {{s: 2}}\ndynamics:\n  s': {expression}\nreward: s'\n"
    )


WAYS: list[tuple[str, int, Callable[[int, int, int], int]]] = [
    ("min(Poisson(2), 5)", 6, lambda s, a, n: min(n, 5)),
    ("clip(s + a - Poisson(2), 0, 5)", 8, lambda s, a, n: min(max(s + a - n, 0), 5)),
    ("clip(s - a + Poisson(2), 0, 5)", 8, lambda s, a, n: min(max(s - a + n, 0), 5)),
    ("s if Poisson(2) > a else a", 4, lambda s, a, n: s if n > a else a),
    ("2 + (Poisson(2) == 3)", 5, lambda s, a, n: 2 + (n == 3)),
    ("max(min(Poisson(2), s), 5 - max(Poisson(0), a))", -1, lambda s, a, n: max(min(n, s), 5 - a)),
    ("Poisson(2) % 3", -1, lambda s, a, n: n % 3),
]


@pytest.mark.parametrize(("expression", "outcomes", "plain"), WAYS)
def test_steps_have_the_chances_of_all_counts(
    expression: str, outcomes: int, plain: Callable[[int, int, int], int]
) -> None:
    task = line(expression)
    assert outcomes < 0 or Steps(task).branching == outcomes
    model = extract(task, reachable=False)
    going = model.step(0).P.toarray()
    for s, a in product(range(6), range(3)):
        wanted = [0.0] * 6
        for n in range(60):
            wanted[plain(s, a, n)] += math.exp(-2.0) * 2.0**n / math.factorial(n)
        assert going[a * 6 + s].tolist() == pytest.approx(wanted, abs=1e-14)


@pytest.mark.parametrize("expression", ["Poisson(2) % 3", "floor(min(Poisson(2) / 2, 5.0))"])
def test_counts_that_are_told_apart_are_all_gone_through(expression: str) -> None:
    assert Steps(line(expression)).branching > 30


def test_a_count_that_is_paid_as_it_is_drawn_pays_its_mean() -> None:
    text = (
        "taskspec: 1\nname: Paid\nstate: {s: {type: int, low: 0, high: 5}}\naction: {a: {type: int, low: 0, high: 2}}\n"
        "horizon: 2\ninitial: {s: 2}\ndynamics: {s': s}\nreward: Poisson(2)\n"
    )
    found = Results(build_text(text)).random
    assert found is not None and found.value == pytest.approx(4)
