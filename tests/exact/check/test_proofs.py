"""What is called proved is true: claims that rounding, slow chains or rare outcomes used to get wrong."""

from fractions import Fraction

import numpy as np
import pytest

from taskspec.exact.model.probabilities import Reader, written
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve import rational
from taskspec.exact.solve.bounded import Bounded
from taskspec.exact.solve.rational import Rational
from tests.shared.diagnostics import status
from tests.shared.for_each import for_each
from tests.shared.sections import build_text

LADDER = """
parameters:
  L: {type: int, default: 40, low: 1, high: 100}
state:
  s: {type: int, low: 0, high: L}
action:
  a: {type: int, low: 0, high: 1}
horizon: L
initial: {s: 0}
dynamics:
  s': s + 1 if a == 1 and s == t else 0
reward: s' == L
"""


def test_numbers_below_one_are_compared_by_their_size() -> None:
    assert status(LADDER, "random_return == 2**-L") == "proved"
    assert status(LADDER, "random_return == 500 * 2**-L") == "false"
    assert status(LADDER, "random_return == 0") == "false"
    assert status(LADDER, "random_return > 0") == "proved"
    assert status(LADDER, "{claim: random_return == 0, tolerance: 1e-9}") == "proved"


CANCELS = """
state:
  s: {type: int, low: 0, high: 3}
action:
  a: {type: int, low: 0, high: 0}
horizon: 3
initial: {s: 0}
dynamics: {s': s + 1}
reward: {by: s, rows: {0: FIRST, 1: 1, 2: -FIRST, else: 0}}
"""


def test_large_rewards_that_cancel() -> None:
    text = CANCELS.replace("FIRST", "1e17")
    assert status(text, "optimal_return == 1") == "proved"
    assert status(text, "optimal_return == 0") == "false"
    assert (
        status(text.replace("horizon: 3", "horizon: 3\ndiscount: 1/2"), "optimal_return == 75 * 10**15 + 1/2")
        == "proved"
    )


def test_large_rewards_that_cancel_in_floats(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where rationals are too many, the sum is withheld rather than wrong."""
    monkeypatch.setattr(rational, "MOST_WORK", 0)
    text = CANCELS.replace("FIRST", "1e17")
    assert status(text, "optimal_return == 0") == "undecided"
    assert status(text, "optimal_return == 1") == "undecided"


CHAIN = """
state:
  s: {type: choice, values: [here, goal]}
action:
  a: {type: int, low: 0, high: 1}
horizon: none
initial: {s: here}
dynamics:
  s': {by: s, rows: {here: {goal: P, here: 1 - P}, goal: goal}}
reward: PAID
terminal: s' == goal
"""


def chain(p: str, paid: str = "1") -> str:
    return (
        CHAIN.replace("1 - P", f"1 - {p}")
        .replace("P}", f"{p}}}")
        .replace("goal: P", f"goal: {p}")
        .replace("PAID", paid)
    )


@pytest.mark.parametrize("p", ["1/3", "1e-3", "1e-7", "1e-9"])
def test_slow_chains_reach_what_they_reach(p: str) -> None:
    assert status(chain(p), "probability(s == goal) < 1/2") != "proved"
    assert status(chain(p), "{claim: probability(s == goal) == 1, tolerance: 1e-5}") == "proved"


@pytest.mark.parametrize(("p", "steps"), [("1/3", "3"), ("1/1001", "1001"), ("1e-5", "10**5")])
def test_slow_ends_are_waited_for(p: str, steps: str) -> None:
    assert status(chain(p), "optimal_return == 1") == "false"
    assert status(chain(p), f"optimal_return == {steps}") == "proved"
    assert status(chain(p), f"random_return == {steps}") == "proved"
    assert status(chain(p, "-1"), f"worst_return == -{steps}") == "proved"


def test_what_never_ends_has_no_value() -> None:
    text = chain("0").replace("{goal: 0, here: 1 - 0}", "here")
    assert status(text, "optimal_return > 10") == "undecided"
    assert status(text.replace("reward: 1", "reward: 0"), "optimal_return == 0") == "proved"


def test_what_pays_for_ever_is_given_up_soon() -> None:
    """No sum is ever reached where an action stays and pays: that is noticed long before 300 million additions."""
    text = chain("1/3").replace("{by: s, rows: {here: {goal", "{by: [s, a], rows: {here: {0: here, 1: {goal")
    text = text.replace("here: 1 - 1/3}", "here: 1 - 1/3}}")
    assert status(text, "optimal_return > 10") == "undecided"
    assert status(text, "prefers(optimal, a == 0)") == "undecided"
    assert status(text, "random_return == 6") == "proved"


RARE = """
state:
  x: {type: real, low: 0, high: 1}
action:
  a: {type: int, low: 0, high: 1}
horizon: 1
initial: {x: "Uniform(0, 1)"}
dynamics: {x': x}
reward: 1e6 * (x < 1e-6)
"""


def test_what_is_rare_does_not_contradict() -> None:
    assert status(RARE, "random_return == 1") != "contradicted"
    assert status(RARE, "random_return > 1e6") == "contradicted"
    assert status(RARE.replace("1e6 * (x < 1e-6)", "x < 1/4"), "random_return > 1/2") == "contradicted"
    assert status(RARE.replace("1e6 * (x < 1e-6)", "x < 1/4"), "random_return < 1/2") == "tested"


ODDS = """
state:
  s: {type: int, low: 0, high: 2}
action:
  a: {type: int, low: 0, high: 1}
horizon: 4
initial: {s: 0}
dynamics: {s': {0: 1/3, 1: 1/3, 2: 1/3}}
reward: {by: s', rows: {0: DOWN, 1: 0, 2: UP}}
"""


@pytest.mark.parametrize(("up", "down"), [("1", "-1"), ("0.1", "-0.1"), ("1/3", "-1/3"), ("1e90", "-1e90")])
def test_symmetric_rewards_sum_to_nothing(up: str, down: str) -> None:
    text = ODDS.replace("UP", up).replace("DOWN", down)
    assert status(text, "random_return == 0") == "proved"
    assert status(text, "random_return < 0") == "false"
    assert status(text, "random_return > -1e-300") == "proved"


def test_what_depends_on_the_rounding_of_decimals_is_withheld() -> None:
    """Ten tenths are a little more than 1 in floats: whether that is at most 1 nobody can say."""
    text = (
        ODDS.replace("UP", "0.1").replace("DOWN", "0.1").replace("1: 0", "1: 0.1").replace("horizon: 4", "horizon: 10")
    )
    assert status(text, "optimal_return == 1") == "proved"
    assert status(text, "optimal_return <= 1") == "undecided"
    assert status(text, "optimal_return > 1") == "undecided"
    assert status(text, "{claim: optimal_return <= 1, tolerance: 1e-9}") == "proved"


def test_ties_are_ties_however_small_the_rewards() -> None:
    text = LADDER.replace("reward: s' == L", "reward: 1e-12 * (s' == L)").replace("default: 40", "default: 3")
    assert status(text, "probability(s == L, under=optimal) == 1") == "proved"
    assert status(text, "prefers(optimal, a == 1, at=s == t)") == "proved"


@for_each(
    ("claim", "expected"),
    [
        ("optimal_return < inf", "proved"),
        ("optimal_return == inf", "false"),
        ("optimal_return > 0 / 0", "broken"),
        ("1 / 0 > 0", "broken"),
        ("1 // 0 == 0", "broken"),
        ("1 % 0 == 0", "broken"),
        ("inf - inf == 0", "broken"),
        ("9**9**9 > 1", "broken"),
        ("2.0**2000 > 1", "proved"),
        ("((9**9999)**9999)**9999 > 1", "broken"),
        ("(-8)**(1/2) == 0", "broken"),
        ("2**(1/2) < 1.4142135623", "false"),
        ("2**(1/2) < 1.4142135624", "proved"),
        ("0.1 + 0.2 == 0.3", "proved"),
        ("1/3 + 1/3 + 1/3 == 1", "proved"),
        ("7 // 2 == 3 and -7 // 2 == -4 and -7 % 2 == 1", "proved"),
        ("prefers(soft(0), a == 1)", "broken"),
        ("prefers(soft(inf), a == 1)", "broken"),
    ],
)
def test_arithmetic_of_claims(claim: str, expected: str) -> None:
    assert status(LADDER, claim, L=3) == expected


@pytest.mark.parametrize(
    ("value", "short"),
    [
        (0.1, Fraction(1, 10)), (1 / 3, Fraction(1, 3)), (0.1 + 0.2, Fraction(3, 10)),
        (0.5, Fraction(1, 2)), (-2.5, Fraction(-5, 2)),
        (1e-9, Fraction(1, 10**9)), (0.000123, Fraction(123, 10**6)), (2.0**-40, Fraction(1, 2**40)), (1e17, Fraction(10**17)),
        (22 / 7, Fraction(22, 7)), (0.30000000000000016, Fraction(0.30000000000000016)),
    ],
)  # fmt: skip
def test_floats_are_read_as_what_was_written(value: float, short: Fraction) -> None:
    assert written(value) == short


def test_both_arithmetics_enclose_one_another() -> None:
    """Random chains by rationals and by floats: the bounds of the floats hold the rationals."""
    rng = np.random.default_rng(0)
    for seed in range(10):
        p = rng.dirichlet(np.ones(4), (4, 2)).round(3).tolist()
        r = rng.normal(0, 10.0 ** rng.integers(-9, 9), (4, 2)).tolist()
        text = f"""
constants: {{P: {p}, R: {r}}}
state: {{s: {{type: int, low: 0, high: 3}}}}
action: {{a: {{type: int, low: 0, high: 1}}}}
horizon: 20
discount: {rng.choice([1, 0.9])}
initial: {{s: {seed % 4}}}
dynamics: {{s': "Categorical(P[s, a])"}}
reward: R[s, a]
"""
        model = Results(build_text(text)).model
        assert model is not None
        numbers = Rational(model, Reader())
        bounded = Bounded(model)
        true = numbers.zero()
        value = bounded.zero()
        for t in range(19, -1, -1):
            q = numbers.backup(t, true)
            found = bounded.backup(t, value)
            if t % 2:
                true = numbers.top(q)
                value = bounded.top(found)
            else:
                true = numbers.bottom(q)
                value = bounded.bottom(found)
        for s in range(4):
            assert abs(true.at(s) - Fraction(value.value[s])) <= Fraction(value.error[s])
            assert value.error[s] <= 1e-11 * max(abs(value.value[s]), np.abs(r).max())
