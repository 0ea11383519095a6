"""Plans and returns of large tasks: how much memory they take."""

import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.exact.model.points import BYTES, Cost
from taskspec.exact.rules.claim_verdicts import verdicts
from taskspec.exact.scores.returns import Results, Return
from taskspec.exact.solve import plans
from tests.shared.diagnostics import statuses
from tests.shared.sections import build_text

HANOI = """
parameters:
  n: {type: int, default: 7, low: 1, high: 10, doc: disks}
state:
  on: {type: int, shape: [n], low: 0, high: 2, doc: peg of each disk}
action:
  source: {type: int, low: 0, high: 2}
  target: {type: int, low: 0, high: 2}
definitions:
  top: "argmax(concat([on[i] == source for i in range(n)], True))"
  other: "argmax(concat([on[i] == target for i in range(n)], True))"
horizon: 2**n - 1
initial: {on: "[0 for i in range(n)]"}
dynamics:
  on': "[target if i == top and top < other else on[i] for i in range(n)]"
reward: all(on' == 2)
terminal: all(on' == 2)
expert: optimal
"""


def peak(act: Callable[[], Any]) -> float:
    """Megabytes that a computation takes at most."""
    tracemalloc.start()
    try:
        act()
        return tracemalloc.get_traced_memory()[1] / 2**20
    finally:
        tracemalloc.stop()


def test_the_return_of_a_planned_expert_keeps_no_policy_for_each_time() -> None:
    """127 tables of 9 actions in 2,187 states would take 19 MB."""
    results = Results(build_text(HANOI))
    assert results.model is not None and results.model.n_states == 3**7
    assert peak(lambda: results.expert) < 3
    assert results.expert == Return(1.0)
    assert peak(lambda: statuses(verdicts(build_text(HANOI + "claims: ['prefers(optimal, source != target)']")))) < 12


def test_plans_for_any_time_keep_a_few_of_them() -> None:
    model = Results(build_text(HANOI)).model
    assert model is not None
    plan = plans.optimal_plan(model)
    assert peak(lambda: [plan(t).sum() for t in range(127)]) < 3
    late = plans.optimal_plan(model)
    for t in (126, 0, 63, 64, 5):
        assert (plan(t) == late(t)).all()
    assert (plan(500) == plan(126)).all()


def test_a_plan_too_large_to_keep_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plans, "MEMORY", 1000)
    results = Results(build_text(HANOI, n=3))
    assert results.model is not None
    with pytest.raises(SpecError, match=r"E712.*a plan for every time would take"):
        plans.optimal_plan(results.model)
    assert results.expert == Return(1.0)


@pytest.mark.parametrize("megabytes", [10, 1000])
def test_points_that_are_taken_at_once_fit_into_the_memory_that_is_allowed(
    set_limits: Callable[..., None], megabytes: int
) -> None:
    set_limits(megabytes=megabytes)
    cost = Cost(build_text(HANOI).process.next)
    assert cost.batch(7) == 7
    assert 1e6 * megabytes / 2 < cost.batch(1e18) * cost.numbers * BYTES <= 1e6 * megabytes
