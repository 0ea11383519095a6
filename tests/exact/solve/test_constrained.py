"""Measures beside the reward, and the best return within limits on them, against all policies one by one."""

from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec import exact
from taskspec.exact.solve.constrained import Expectations
from taskspec.language.task.task import Task
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text

TOLL = """
taskspec: 1
name: Toll
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: int, low: 0, high: 2}}
horizon: 3
discount: 0.9
initial: {s: 0}
dynamics: {s': "(s + a) % 4"}
reward: a * (s + 1) % 5
measures: {cost: a ** 2 - t, place: {value: "s' * (t + 1)", doc: where one is}}
"""
DRAWN = """
taskspec: 1
name: Drawn
state: {s: {type: int, low: 0, high: 2}}
action: {a: {type: bool}}
noise: {slip: Bernoulli(1/4)}
horizon: 3
initial: {s: {0: 1/2, 1: 1/2}}
dynamics: {s': "min(s + (a and not slip), 2)"}
reward: 3 * terminal - a
measures: {risk: slip * (s + 1) + Normal(), effort: a}
terminal: s' == 2
expert: {a: s == 0}
"""
SAFETY = Path(__file__).parents[3] / "tasks" / "safety"


@pytest.fixture(params=[TOLL, DRAWN], ids=["toll", "drawn"])
def task(request: pytest.FixtureRequest) -> Task:
    return build_text(request.param)


def steps(task: Task) -> tuple[Any, ...]:
    """What an action does in a state at a time, from the text of the two specs: pairs of probability and result."""
    if task.name == "Toll":

        def outcomes(s: int, a: int, t: int) -> list[tuple[float, int, bool, dict[str, float]]]:
            after = (s + a) % 4
            return [(1.0, after, False, {"": a * (s + 1) % 5, "cost": a**2 - t, "place": after * (t + 1)})]

        return [(1.0, 0)], 3, 0.9, outcomes

    def outcomes(s: int, a: int, t: int) -> list[tuple[float, int, bool, dict[str, float]]]:
        found = []
        for slip, p in ((1, 0.25), (0, 0.75)):
            after = min(s + (a and not slip), 2)
            found.append((p, after, after == 2, {"": 3 * (after == 2) - a, "risk": slip * (s + 1), "effort": a}))
        return found

    return [(0.5, 0), (0.5, 1)], 2, 1.0, outcomes


def expectation(task: Task, policy: Any) -> dict[str, float]:
    """The expected sums under probabilities of actions, policy(t, s, a), by walking all episodes."""
    starts, actions, gamma, outcomes = steps(task)
    total = dict.fromkeys(["", *task.process.measures], 0.0)

    def walk(p: float, s: int, t: int) -> None:
        if t == task.horizon:
            return
        for a in range(actions):
            chosen = policy(t, s, a)
            for q, after, ended, paid in outcomes(s, a, t) if chosen else ():
                for name, value in paid.items():
                    total[name] += p * chosen * q * gamma**t * value
                if not ended:
                    walk(p * chosen * q, after, t + 1)

    for p, s in starts:
        walk(p, s, 0)
    return total


def all_policies(task: Task) -> dict[str, np.ndarray]:
    """The expected sums of all deterministic policies of state and time, by measure."""
    starts, actions, _, outcomes = steps(task)
    places = [(0, s) for _, s in starts]
    for t, s in places:
        if t + 1 == task.horizon:
            continue
        for a in range(actions):
            for _, after, ended, _ in outcomes(s, a, t):
                if not ended and (t + 1, after) not in places:
                    places.append((t + 1, after))
    sums = []
    for chosen in product(range(actions), repeat=len(places)):
        table = dict(zip(places, chosen, strict=True))
        sums.append(expectation(task, lambda t, s, a, table=table: float(table[t, s] == a)))
    return {name: np.array([each[name] for each in sums]) for name in sums[0]}


def points(front: Iterable[Expectations], measure: str) -> Any:
    """The measure and the value at each corner of a front, approximately."""
    return pytest.approx(np.array([(corner.measures[measure], corner.value) for corner in front]), abs=1e-6)


def upper_hull(points: set[tuple[float, float]]) -> list[tuple[float, float]]:
    """The corners of the upper border of points, from left to right."""
    best: dict[float, float] = {}
    for x, y in points:
        best[x] = max(y, best.get(x, y))
    hull: list[tuple[float, float]] = []
    for x, y in sorted(best.items()):
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) < -1e-9:
                break
            hull.pop()
        hull.append((x, y))
    return hull


def test_front_and_constrained_optimum_are_those_of_all_policies(task: Task) -> None:
    sums = all_policies(task)
    for measure in task.process.measures:
        hull = upper_hull(set(zip(sums[measure].round(9), sums[""].round(9), strict=True)))
        assert np.array(hull) == points(exact.pareto_front(task, measure), measure)
        bound = (hull[0][0] + hull[-1][0]) / 2
        top = max(hull, key=lambda corner: corner[1])
        limited = exact.constrained_optimum(task, [f"{measure} <= {bound}"])
        expected = top[1] if top[0] <= bound else float(np.interp(bound, *zip(*hull, strict=True)))
        assert limited.value == pytest.approx(expected, abs=1e-6)
        assert limited.measures[measure] <= bound + 1e-6


def test_measures_under_each_policy_are_sums_over_all_episodes(task: Task) -> None:
    found = exact.scores(task).measures
    actions = 3 if task.name == "Toll" else 2
    uniform = expectation(task, lambda t, s, a: 1 / actions)
    policies = all_policies(task)
    for name, under in found.items():
        assert under["random"].value == pytest.approx(uniform[name])
        for which, choose in (("optimal", max), ("worst", min)):
            among = policies[name][np.isclose(policies[""], choose(policies[""]))]
            assert among.min() - 1e-9 <= under[which].value <= among.max() + 1e-9
        if task.name == "Drawn":
            expert = expectation(task, lambda t, s, a: float(a == (s == 0)))
            assert under["expert"].value == pytest.approx(expert[name])


def test_two_safety_tasks_trade_reward_for_what_was_meant() -> None:
    """Their best policies are few: breaking the vase or going around, the short way or the long one."""
    vases = exact.pareto_front(SAFETY / "vases.yaml", "broken")
    assert np.array([(0, 4), (1, 8)]) == points(vases, "broken")
    assert exact.constrained_optimum(SAFETY / "vases.yaml", ["broken <= 0.5"]).value == pytest.approx(6)
    supervised = exact.pareto_front(SAFETY / "absent_supervisor.yaml", "performance")
    positive = [corner for corner in supervised if corner.measures["performance"] > 0]
    assert np.array([(29, 44), (41, 41)]) == points(positive, "performance")


@pytest.mark.parametrize(
    ("limit", "code", "message"),
    [
        ("cost <= -99", "E712", "no policy keeps cost <= -99"),
        ("costs <= 1", "E713", "has no measure 'costs'"),
        ("cost < 1", "E713", "'cost < 1' is not a limit on a measure"),
    ],
)
def test_limits_that_cannot_be_kept_or_read(limit: str, code: str, message: str) -> None:
    error = refusal(exact.constrained_optimum, build_text(TOLL), [limit])
    assert error.diagnostics[0].code == code
    assert message in error.diagnostics[0].message
