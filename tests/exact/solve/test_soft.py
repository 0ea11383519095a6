"""What is said of soft policies, beside closed forms."""

import math

import pytest

from taskspec.exact.rules.claim_verdicts import verdicts
from tests.shared.sections import build_text

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


def status(claim: str, paid: int) -> str:
    (found,) = verdicts(build_text(f"{FORK}claims:\n  - {claim}\n", R=paid))
    return found.status


@pytest.mark.parametrize("paid", [0, 1000, 2**30, 2**40, 2**50], ids="paid {}".format)
@pytest.mark.parametrize("off", [0.1, 1e-3, 1e-6, 1e-9, 1e-12])
def test_whole_rewards_far_above_what_decides_leave_it_open(paid: int, off: float) -> None:
    """Behind one side of a fork wait log 2, behind the other log(1 + e); both are added to what is paid at the fork."""
    share = (1 + math.e) / (3 + math.e)
    for sign, below, above in ((1, "proved", "false"), (-1, "false", "proved")):
        for word, expected in (("<", below), (">", above)):
            claim = f"{{claim: 'probability(side == 1) {word} {share + sign * off!r}', under: soft(1)}}"
            found = status(claim, paid)
            assert found == expected if paid <= 1000 and off > 1e-10 else found in (expected, "undecided"), claim
