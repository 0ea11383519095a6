"""Products that no float holds are not taken to be 0: bounds include what they may come to, and nothing false is proved."""

from __future__ import annotations

import pytest

from taskspec.exact import verdicts
from taskspec.source import read_text
from taskspec.task.build import build

SPEC = """\
taskspec: 1
name: Tiny
state: {{s: {{type: int, low: 0, high: {high}}}}}
action: {{a: {{type: choice, values: [left, right]}}}}
horizon: {horizon}
discount: {discount}
initial: {{s: "{initial}"}}
dynamics: {{s': "{dynamics}"}}
reward: "{reward}"
expert: "{expert}"
claims: ["{claim}"]
"""
USUAL = {"high": 9, "horizon": "none", "discount": "1/2", "initial": 3, "dynamics": "s", "reward": 0, "expert": "left"}
LARGE = {"high": 60000, "horizon": 5, "initial": "UniformInt(0, 60000)"}  # too large for rationals
FEW = "1.0e-200 if a == right else 0"
RARELY = "right if Bernoulli(1.0e-200) else left"
FALSE = [
    ({"reward": FEW, "expert": RARELY}, "expert_return == 0"),
    ({"reward": FEW, "expert": RARELY} | LARGE, "expert_return == 0"),
    ({"reward": f"-({FEW})", "expert": RARELY} | LARGE, "expert_return >= 0"),
    ({"reward": f"-({FEW})", "expert": RARELY} | LARGE, "expert_return == optimal_return"),
    ({"reward": "1.0e-200 * Bernoulli(1.0e-200)"}, "optimal_return == 0"),
    ({"reward": "1.0e-200 * Bernoulli(1.0e-200)"}, "random_return == 0"),
    ({"reward": "1.0e-200 if Bernoulli(1.0e-200) else 0"} | LARGE, "random_return == 0"),
    ({"reward": "1.0e-200 * Exponential(rate=1.0e+200)"}, "random_return == 0"),
    ({"reward": "1.0e-200 * Exponential(rate=1.0e+200)", "horizon": 3}, "random_return == 0"),
    ({"dynamics": "1 if a == right and Bernoulli(1.0e-170) else 0", "reward": "1.0e-170 if s' == 1 else 0"},
     "optimal_return == worst_return"),
    ({"dynamics": "1 if a == right and Bernoulli(1.0e-170) else 0", "reward": "1.0e-170 if s' == 1 else 0"},
     "not prefers(optimal, a == right, at=s == 0)"),
    ({"reward": "5.0e-324 if a == right else 0"}, "random_return == 0"),
    ({"reward": "5.0e-324 if a == right else 0"} | LARGE, "random_return == 0"),
    ({"reward": "1 if a == right else 0", "expert": "right if Bernoulli(1.0e-320) else left"} | LARGE, "expert_return == 0"),
    ({"reward": "1 if a == right else 0", "discount": "1.0e-200", "dynamics": "s", "expert": RARELY}, "expert_return == 0"),
]  # fmt: skip
TRUE = [
    ({"reward": 0}, "random_return == 0"),
    ({"reward": 0} | LARGE, "random_return >= 0"),
    ({"reward": "1 if a == right else 0"} | LARGE, "expert_return <= 0"),
    ({"reward": "-1 if a == right and Bernoulli(1/3) else 0"}, "optimal_return >= 0"),
]


def status(changes: dict[str, object], claim: str) -> str:
    (verdict,) = verdicts(build(read_text(SPEC.format(**USUAL | changes, claim=claim))))
    return verdict.status


@pytest.mark.parametrize(("changes", "claim"), FALSE)
def test_what_no_float_holds_is_not_nothing(changes: dict[str, object], claim: str) -> None:
    assert status(changes, claim) in ("false", "undecided")
    opposite = claim.removeprefix("not ") if claim.startswith("not ") else f"not ({claim})"
    assert status(changes, opposite) in ("proved", "undecided")


@pytest.mark.parametrize(("changes", "claim"), TRUE)
def test_what_is_never_paid_is_still_known_to_be_nothing(changes: dict[str, object], claim: str) -> None:
    assert status(changes, claim) == "proved"
