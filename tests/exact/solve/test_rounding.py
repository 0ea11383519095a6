"""Claims whose truth rounding could hide: chances that no float holds, signs that cancel, and sums of many outcomes."""

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy import sparse

from taskspec.exact import extract
from taskspec.exact.check.report import check
from taskspec.exact.model.model import NoModel
from taskspec.exact.solve import infinite_horizon, rational
from taskspec.exact.solve.backward import Uniform
from taskspec.exact.solve.bounded import Bound, Bounded
from taskspec.exact.solve.infinite_horizon import InfiniteHorizon
from taskspec.exact.solve.plans import _LogOutcomes
from tests.shared.diagnostics import status
from tests.shared.sections import build_text

LURE = """
parameters: {C: {type: int, default: 1}}
state: {k: {type: int, low: 0, high: 2}}
action: {a: {type: int, low: 0, high: 1}}
horizon: none
discount: 1/2
initial: {k: 0}
dynamics: {k': "1 if k == 0 and a == 1 else 2 if k == 1 else k"}
reward: "-C if k == 0 and a == 1 else 0"
"""


@pytest.mark.parametrize(("cost", "expected"), [(1, "proved"), (1000, "undecided"), (10**6, "undecided")])
def test_what_is_hardly_ever_done_is_done_in_the_end(cost: int, expected: str) -> None:
    """A soft agent pays each time with a chance of exp(-C) about, which is more than 0; so it is there one day."""
    assert status(LURE, "{claim: probability(k == 2) == 1, under: soft(1)}", C=cost) == expected
    assert status(LURE, "{claim: probability(k == 2) == 0, under: soft(1)}", C=cost) != "proved"


CANCELS = """
state: {k: {type: int, low: 0, high: 3}}
action: {a: {type: int, low: 0, high: 0}}
horizon: none
discount: 1/2
initial: {k: 0}
dynamics: {k': "UniformInt(1, 3)"}
reward: {by: k', rows: {1: PAID, 2: SIGN * 2**-60, 3: -PAID, else: 0}}
"""


@pytest.mark.parametrize(("sign", "truth"), [("-1", "<"), ("1", ">")])
def test_a_sign_that_rounding_hides_is_not_taken_for_granted(sign: str, truth: str) -> None:
    """Every step pays a third of 2**-60 in the end, of which nothing is left beside the other outcomes."""
    for word in ("<", ">", "==", "<=", ">="):
        found = status(CANCELS.replace("PAID", "1").replace("SIGN", sign), f"random_return {word} 0")
        assert found in ({"proved", "undecided"} if truth in word else {"false", "undecided"}), word


RARE = """
state: {k: {type: int, low: 0, high: 2}}
action: {a: {type: int, low: 0, high: 0}}
horizon: 2
initial: {k: START}
dynamics: {k': STEP}
reward: PAID
"""


@pytest.mark.parametrize(
    ("step", "paid"), [("1 if Bernoulli(1e-200) else 0", "0"), ("0", "1e-200"), ("0", "1e200 * k")]
)
@pytest.mark.parametrize("without_horizon", [False, True])
def test_numbers_outside_of_the_domain_are_refused(step: str, paid: str, without_horizon: bool) -> None:
    text = RARE.replace("START", "0").replace("STEP", f'"{step}"').replace("PAID", paid)
    if without_horizon:
        text = text.replace("horizon: 2", "horizon: none\ndiscount: 1/4")
    task = build_text(text)
    assert [d.code for d in check(task).diagnostics if d.code.startswith("E4")] == ["E411"]
    with pytest.raises(NoModel, match="E411"):
        extract(task)


SUMS = """
parameters: {N: {type: int, default: 9999, low: 1}}
state: {k: {type: int, low: 0, high: 1}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 1
initial: {k: "START"}
dynamics: {k': k}
reward: PAID
expert: {a: "UniformInt(0, N - 1) < N // 3"}
"""


@pytest.mark.parametrize(
    ("which", "start", "paid"), [("expert", "0", "a"), ("optimal", "UniformInt(0, N - 1) < N // 3", "k")]
)
@pytest.mark.parametrize("n", [99, 999, 3000, 9999])
def test_a_sum_of_thousands_of_chances_counts_its_rounding(
    monkeypatch: pytest.MonkeyPatch, which: str, start: str, paid: str, n: int
) -> None:
    """A third of all outcomes, each as likely as any other, weigh a third together; added up as floats, nearly."""
    monkeypatch.setattr(rational, "MOST_WORK", 0)
    text = SUMS.replace("START", start).replace("PAID", paid)
    assert status(text, f"{which}_return == 1/3", N=n) == "proved"
    for word in ("<", ">"):
        assert status(text, f"{which}_return {word} 1/3", N=n) in ("false", "undecided")


@pytest.mark.parametrize(
    "claim",
    [
        "(2**-2000)**0.5 == 0",
        "(2**-2000)**0.5 < 2**-1001",
        "2**-1000 > (2**-2000)**0.5",
        "1e-300**1.5 == 0",
        "(10**400)**0.5 < 10**199",
    ],
)
def test_powers_beyond_floats_are_refused_rather_than_rounded_to_nothing(claim: str) -> None:
    text = RARE.replace("START", "0").replace("STEP", "k").replace("PAID", "0")
    assert status(text, claim) == "broken"


@pytest.mark.parametrize("chance", ["1e-9", "1e-13", "1e-20", "1e-99"])
def test_an_action_that_hardly_ever_matters_matters(chance: str) -> None:
    text = (
        RARE.replace("START", "0").replace("STEP", f'"1 if Bernoulli({chance}) and a == 1 else 0"').replace("PAID", "0")
    )
    text = text.replace("high: 0}", "high: 1}")
    assert status(text, "influences(a, k)") == "proved"
    assert status(text, "not influences(a, k)") == "false"


@pytest.mark.parametrize(("more", "expected"), [("0", "proved"), ("1e-13", "undecided"), ("1e-9", "false")])
def test_an_action_that_changes_a_chance_by_little_is_not_said_to_change_none(more: str, expected: str) -> None:
    step = f'"1 if Bernoulli(0.5 + (a * {more})) else 0"'
    text = RARE.replace("START", "0").replace("STEP", step).replace("PAID", "0").replace("high: 0}", "high: 1}")
    assert status(text, "not influences(a, k)") == expected


RARELY_NOT = '"0 if Bernoulli(1 - 1/10**20) else 1"'
COUNTED = '"1 if sum(Bernoulli([1 - 1/10**20, 1])) < 2 else 0"'


@pytest.mark.parametrize("step", [RARELY_NOT, COUNTED], ids=["alone", "counted"])
@pytest.mark.parametrize("at_the_start", [False, True])
def test_what_is_not_quite_certain_leaves_something_else_possible(step: str, at_the_start: bool) -> None:
    """1 - 1/10**20 is written as a fraction, and not 1, although no float is nearer to it."""
    text = RARE.replace("horizon: 2", "horizon: 1")
    if at_the_start:
        text = text.replace("START", step).replace("STEP", "k")
    else:
        text = text.replace("START", "0").replace("STEP", step)
    text = text.replace("PAID", '"1e30 * k\'"')
    for claim in ("reachable(k == 1)", "states == 2", "random_return == 10**10", "probability(k == 1) == 10**-20"):
        assert status(text, claim) == "proved", claim


@pytest.mark.parametrize(
    "step",
    [
        "min(sum(Bernoulli([1e-90, 1e-90, 1e-90, 1e-90])), 2)",
        "2 if all(Bernoulli([1e-90, 1e-90, 1e-90, 1e-90])) else 0",
        "2 if all(Categorical([1 - 1e-90, 1e-90], shape=4) == 1) else 0",
    ],
)
def test_unlikely_events_may_happen_together(step: str) -> None:
    """Four do with a probability of 1e-360, which no float tells from 0."""
    text = RARE.replace("START", "0").replace("STEP", f'"{step}"').replace("PAID", "0")
    assert status(text, "reachable(k == 2)") == "proved"
    assert status(text, "probability(k == 2) < 1e-100") == "proved"


LOCK = """
parameters: {N: {type: int, default: 9, low: 1}}
state: {k: {type: int, low: 0, high: N}}
action: {a: {type: int, low: 0, high: 1}}
horizon: N
initial: {k: 0}
dynamics: {k': "k + 1 if a == 1 and k == t else k"}
reward: "1 if k' == N else 0"
expert: {a: "1 if Bernoulli(1e-40) else 0"}
"""


@pytest.mark.parametrize(("who", "n"), [("expert", 9), ("random", 1100)])
def test_a_policy_that_hardly_ever_opens_a_lock_opens_it(monkeypatch: pytest.MonkeyPatch, who: str, n: int) -> None:
    """Both returns are above 0, and smaller than any float."""
    monkeypatch.setattr(rational, "MOST_WORK", 0)
    assert status(LOCK, f"{who}_return > 0", N=n) == "undecided"
    assert status(LOCK, f"{who}_return < 1e-290", N=n) == "proved"


@pytest.mark.parametrize("claim", ["random_return == 0", "probability(k == 2) == 0"])
@pytest.mark.parametrize("horizon", ["2", "none\ndiscount: 1/2"])
def test_products_that_no_float_holds_are_not_taken_to_be_0(
    monkeypatch: pytest.MonkeyPatch, claim: str, horizon: str
) -> None:
    monkeypatch.setattr(rational, "MOST_WORK", 0)
    step = "2 if all(Bernoulli([1e-90, 1e-90, 1e-90, 1e-90])) else 0"
    text = RARE.replace("START", "0").replace("STEP", f'"{step}"').replace("PAID", '"1e-9 * (k\' == 2)"')
    assert status(text.replace("horizon: 2", f"horizon: {horizon}"), claim) != "proved"


def test_a_start_outside_of_the_state_space_is_refused_however_unlikely() -> None:
    text = RARE.replace("START", '"5 if Bernoulli(1e-10) else 0"').replace("STEP", "k").replace("PAID", "1")
    assert status(text, "states == 1") == "undecided"
    assert status(text, "optimal_return < 2") == "undecided"


@pytest.mark.parametrize(("more", "expected"), [(0.0, "false"), (1e-11, "false"), (1e-8, "proved")])
def test_what_is_preferred_is_the_same_in_rationals_and_in_floats(
    monkeypatch: pytest.MonkeyPatch, more: float, expected: str
) -> None:
    """By a part of 1e-11 it is indifferent, and nothing is preferred."""
    text = (
        SUMS.replace("START", "0")
        .replace("PAID", "a")
        .replace("UniformInt(0, N - 1) < N // 3", f"Bernoulli({0.5 + more!r})")
    )
    assert status(text, "prefers(expert, a == 1)") == expected
    monkeypatch.setattr(rational, "MOST_WORK", 0)
    assert status(text, "prefers(expert, a == 1)") == expected


THIRDS = """
state: {k: {type: int, low: 0, high: 2}}
action: {a: {type: int, low: 0, high: 1}}
horizon: none
discount: 1/2
initial: {k: 0}
dynamics: {k': "UniformInt(0, 2)"}
reward: 1/3
"""


def test_a_return_without_a_horizon_leaves_room_for_its_rounding() -> None:
    """A third in every step is two thirds in all, which no float is."""
    found = InfiniteHorizon(extract(build_text(THIRDS))).value(Uniform())
    assert found.low < Fraction(2, 3) < found.high
    assert found.high - found.low < 1e-12


def test_ends_of_episodes_take_nothing_off_the_error_of_maximum_entropy() -> None:
    text = THIRDS.replace("horizon: none\ndiscount: 1/2", "horizon: 3\nterminal: k' >= 0")
    model = extract(build_text(text))
    zero = np.zeros(model.n_states)
    found = _LogOutcomes(Bounded(model), 0, 1.0).log_q(Bound(zero), 0)
    value = found.value[:, 0]
    error = found.error[:, 0]
    assert (error > 0).all() and (error >= np.abs(value - 1 / 3)).all()


WAITS = """
state: {k: {type: int, low: 0, high: 1}}
action: {a: {type: int, low: 0, high: 1}}
horizon: none
initial: {k: 0}
dynamics: {k': k}
terminal: a == 1
reward: PAID
expert: {a: 0}
"""


@pytest.mark.parametrize("paid", ["a", "1 - a"])
def test_what_may_go_on_for_ever_is_not_decided(paid: str) -> None:
    assert status(WAITS.replace("PAID", paid), "optimal_return >= 0") == "undecided"


@pytest.mark.parametrize(("shift", "expected"), [(-1, "proved"), (10, "false")])
def test_waiting_is_no_rest_where_every_step_is_paid(shift: int, expected: str) -> None:
    """With more for each step, an episode had better wait; with less, it had better end."""
    text = WAITS.replace("PAID", "a").replace("horizon: none", "horizon: none\ndiscount: 1/2")
    assert status(text, f"prefers(zero_terminal_value({shift}), a == 1)") == expected


def test_long_chains_are_solved_by_substitution(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond some thousands of equations there is no direct solution; a candidate may be off by rounding, and is checked."""
    monkeypatch.setattr(infinite_horizon, "DIRECT", 0)
    found = infinite_horizon.chain_values(
        sparse.csr_array(np.diag([0.5, 0.75])), np.array([1.0, 3.0]), np.ones(2, np.bool_)
    )
    np.testing.assert_allclose(found, [2, 12], rtol=1e-14)


EPIDEMIC = """
state: {s: {type: int, low: 0, high: 5}, i: {type: int, low: 0, high: 6}}
action: {v: {type: int, low: 0, high: 2}}
noise:
  more: count([Bernoulli(1 - 0.8 ** i) and k < s - v for k in range(6)])
  fewer: count([Bernoulli(0.5) and k < i for k in range(6)])
horizon: 12
initial: {s: 5, i: 1}
dynamics: {s': "max(s - v - more, 0)", i': "min(i + more - fewer, 6)"}
reward: -i' - 0.3 * min(v, s)
terminal: i' == 0
expert: {v: 2 if i > 0 else 0}
"""


@pytest.mark.parametrize(
    ("claim", "expected"),
    [
        ("expert_return <= optimal_return", "proved"), ("optimal_return >= expert_return", "proved"),
        ("worst_return <= random_return", "proved"), ("expert_return == optimal_return", "proved"),
        ("optimal_return <= expert_return", "undecided"), ("expert_return + 0 <= optimal_return", "undecided"),
        ("expert_return <= worst_return", "false"),
    ],
)  # fmt: skip
def test_no_return_is_above_the_optimal_one(claim: str, expected: str) -> None:
    """Of two sums of floats that are equal, or nearly, neither is known to be the larger."""
    assert status(EPIDEMIC, claim) == expected


FORK = """
parameters:
  R: {type: int, default: 1}
state:
  k: {type: int, low: 0, high: 2}
  side: {type: int, low: 0, high: 1}
action:
  a: {type: int, low: 0, high: 1}
horizon: 2
initial: {k: 0, side: 0}
dynamics: {k': "min(k + 1, 2)", side': "side if k > 0 else a"}
reward: "R if k == 0 else a * side"
"""


@pytest.mark.parametrize("paid", [0, 1000, 2**30, 2**40, 2**50], ids="paid {}".format)
@pytest.mark.parametrize("off", [0.1, 1e-3, 1e-6, 1e-9, 1e-12])
def test_whole_rewards_far_above_what_decides_leave_it_open(paid: int, off: float) -> None:
    """Behind one side of a fork wait log 2, behind the other log(1 + e); both are added to what is paid at the fork."""
    share = (1 + math.e) / (3 + math.e)
    for sign, below, above in ((1, "proved", "false"), (-1, "false", "proved")):
        for word, expected in (("<", below), (">", above)):
            claim = f"{{claim: 'probability(side == 1) {word} {share + sign * off!r}', under: soft(1)}}"
            found = status(FORK, claim, R=paid)
            assert found == expected if paid <= 1000 and off > 1e-10 else found in (expected, "undecided"), claim
