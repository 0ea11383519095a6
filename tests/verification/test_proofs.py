"""Random models and claims beside brute force and Storm: dozens here, any number by `python -m tests.verification.proofs`."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from taskspec.exact.rules.claim_rules import ClaimEvaluator
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve import enclosure
from taskspec.exact.solve.enclosure import Enclosure
from tests.verification.oracle.compare.cases import Case
from tests.verification.oracle.reference.merging import read
from tests.verification.oracle.reference.model import Model
from tests.verification.proofs import storm
from tests.verification.proofs.brute import Solved, Unsettled, greedy, uniform
from tests.verification.proofs.claims import Claim
from tests.verification.proofs.process import Key, Outcome, Process, of_model
from tests.verification.proofs.subjects import subject
from tests.verification.proofs.worker import Outcome as Examined
from tests.verification.proofs.worker import examined, judged

MODELS = 20
CHUNK = 5
CLAIMS = 10
RISKY = Path(__file__).parents[2] / "tasks" / "derail" / "risky_path.yaml"


@pytest.mark.parametrize("first", range(0, MODELS, CHUNK))
def test_models_and_claims(first: int) -> None:
    """Rows, returns and verdicts agree with brute force, and brute force with Storm where it is installed."""
    made: Counter[str] = Counter()
    for number in range(first, first + CHUNK):
        outcome = examined(number, CLAIMS)
        assert not outcome.found, (number, outcome.found)
        made.update(outcome.made)
    assert made["returns"] > CHUNK
    assert made["claims"] >= CHUNK * CLAIMS * 9 // 10
    for decided in ("true, proved", "false, false"):
        assert sum(n for name, n in made.items() if name.endswith(decided)) > CHUNK // 2


def test_a_wrong_verdict_is_a_fault() -> None:
    """The same claim, taken to be true and to be false: one of the two is a fault."""
    about = next(found for found in map(subject, range(100)) if found.family == "plain")
    claim = {"claim": "actions >= 1"}
    for truth, faults in ((True, 0), (False, 1), (None, 1)):
        outcome = Examined()
        judged(about, [Claim("comparison", claim, [truth])], outcome)
        assert len(outcome.found) == faults


def nearly(a: Enclosure, b: Enclosure, tolerance: Fraction | None) -> bool:
    """Equality by the same measure at every size."""
    return abs(a.value - b.value) <= (1e-9 if tolerance is None else tolerance)


MISTAKES: dict[str, Any] = {
    "equality is absolute": (5051, enclosure, "_equal", nearly),
    "errors are forgotten": (5004, Enclosure, "around", classmethod(lambda cls, value, error: cls.exactly(value))),
    "abstractions are believed": (5011, Results, "abstraction_check", property(lambda results: None)),
    "decimals are read in one way": (5045, ClaimEvaluator, "ambiguous", property(lambda evaluator: False)),
}
"""With the number of a model that shows it."""


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_prover_that_errs_is_noticed(mistake: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of these once was how claims were decided, or might have been."""
    number, *patch = MISTAKES[mistake]
    assert not examined(number, CLAIMS).found
    monkeypatch.setattr(*patch)
    found = [f["what"] for f in examined(number, CLAIMS).found]
    assert any(what.startswith(("false claim", "true claim", "decimals decide")) for what in found)


def test_brute_force_on_a_task_that_is_known() -> None:
    """The returns of RiskyPath, as the README has them."""
    solved = Solved(of_model(Model(Case(read(RISKY)).reference)))
    assert solved.returns == {
        "optimal_return": 4, "worst_return": Fraction(-495, 2), "random_return": Fraction(-3911, 32), "expert_return": 4,
    }  # fmt: skip


def coin(p: Fraction, pay: int = 1, rest: int = 0, discount: Fraction = Fraction(1)) -> Solved:
    """Action 0 pays, and ends the episode with probability p; action 1 stays where it is."""

    def row(key: Key, action: int, t: int) -> list[Outcome]:
        if action:
            return [Outcome(Fraction(1), key, Fraction(rest), False)]
        return [Outcome(p, ("end",), Fraction(pay), True), Outcome(1 - p, key, Fraction(pay), False)]

    return Solved(Process(2, None, discount, {("start",): Fraction(1)}, row))


def test_brute_force_without_a_horizon() -> None:
    """Geometric sums: 1/p steps, half of them paid where half of the actions rest."""
    p = Fraction(1, 1000)
    assert coin(p).returns == {"optimal_return": 1000, "worst_return": 0, "random_return": 1000}
    assert coin(p, -1).returns == {"optimal_return": 0, "worst_return": -1000, "random_return": -1000}
    assert set(coin(p, 1, 1).returns) == {"worst_return", "random_return"}  # resting pays for ever
    assert coin(p, 1, 1).returns["random_return"] == 2000
    half = coin(Fraction(1, 2), discount=Fraction(1, 2)).returns
    assert half == {"optimal_return": Fraction(4, 3), "worst_return": 0, "random_return": Fraction(4, 5)}
    assert coin(p).probability(uniform(2), lambda key: key == ("end",)) == 1
    assert coin(p, -1).probability(greedy(), lambda key: key == ("end",)) == 0
    with pytest.raises(Unsettled):
        coin(p, 1, 1).probability(greedy(), lambda key: key == ("end",))


@pytest.mark.skipif(not storm.is_installed(), reason="stormpy is not installed")
def test_storm_on_a_task_that_is_known() -> None:
    solved = Solved(of_model(Model(Case(read(RISKY)).reference)))
    assert storm.returns(solved) == solved.returns
    assert storm.returns(coin(Fraction(1, 7), discount=Fraction(9, 10)))["optimal_return"] == Fraction(70, 16)
