"""Warnings: each on a small task that has the fault, at its place; none on a task that has not."""

from pathlib import Path
from typing import Any

import pytest

from taskspec.exact.check.report import warnings
from taskspec.exact.scores import returns
from taskspec.language.task.task import Task
from tests.shared.diagnostics import codes, with_code
from tests.shared.sections import build_text
from tests.shared.sparse import sparse
from tests.shared.specs import SHIPPED, specs, tasks_of

ROOT = Path(__file__).parents[3]

PARTS = {
    "parameters": "{n: {type: int, default: 3, low: 1, high: 9}}",
    "state": "{s: {type: int, low: 0, high: n}}",
    "action": "{a: {type: choice, values: [stay, go]}}",
    "horizon": "2 * n",
    "initial": "{s: 0}",
    "dynamics": "{s': 'min(s + (a == go), n)'}",
    "reward": "s' == n and s < n",
    "expert": "{a: go}",
}


def task(**parts: str) -> Task:
    lines = ["taskspec: 1", "name: Path"]
    for name, value in (PARTS | parts).items():
        lines.append(f"{name}: {value}")
    return build_text("\n".join(lines) + "\n")


FAULTS = [
    ("W501", "state", {"state": "{s: {type: int, low: 0, high: n + 1}}"}, "s = 4"),
    ("W501", "state", {"dynamics": "{s': 's + 3 * (a == go and s == 0)'}"}, "s = 1, 2"),
    ("W502", "horizon", {"horizon": "n - 1"}, "within 2 steps every reward is 0"),
    ("W503", "reward", {"reward": "1"}, "every possible step has reward 1"),
    ("W504", "reward", {"reward": "t == 2"}, "both return 1"),
    ("W505", "action", {"dynamics": "{s': 'min(s + 1, n)'}"}, "the action 'a' is read nowhere"),
    ("W505", "action", {"action": "{a: {type: choice, values: [stay, go]}, b: {type: int, low: 0, high: 2}}",
                        "expert": "{a: go, b: 0}", "reward": "s' == n and s < n and b * 0 == 0"}, "the action 'b' changes"),
    ("W506", "parameters", {"parameters": "{n: {type: int, default: 3, low: 1, high: 9}, m: {type: int, default: 1}}"},
     "the parameter 'm'"),
    ("W506", "definitions", {"definitions": "{far: s == n}"}, "the definition 'far'"),
    ("W506", "definitions", {"definitions": "{\"f(x)\": x + 1}"}, "the definition 'f(x)'"),
    ("W506", "constants", {"constants": "{k: [1, 2, 3]}"}, "the constant 'k'"),
    ("W507", "expert", {"expert": "{a: stay}"}, "the expert returns 0, which is 1 below the optimum of 1"),
    ("W507", "expert", {"expert": "{a: stay}", "parameters": "{}", "state": "{s: {type: real}}",
                        "initial": "{s: 'Uniform(0, 1)'}", "dynamics": "{s': s + (a == go)}", "horizon": "7",
                        "reward": "(s' > 7) - 1"},
     "the expert returns -7 on average, and random actions -6.99"),
    ("W518", "observation", {"state": "{s: {type: int, low: 0, high: n}, side: {type: bool}}",
                             "initial": "{s: 0, side: Bernoulli(1/2)}", "observation": "{s: s}",
                             "dynamics": "{s': 'min(s + ((a == go) == side), n)'}", "horizon": "n",
                             "expert": "optimal"}, "rewards depend on 'side'"),
]  # fmt: skip


@pytest.mark.parametrize(("code", "section", "parts", "message"), FAULTS, ids=lambda x: str(x)[:30])
def test_each_fault(code: str, section: str, parts: dict[str, str], message: str) -> None:
    made = task(**parts)
    found = with_code(warnings(made), code)
    assert len(found) == 1, warnings(made)
    assert message in found[0].message
    assert found[0].severity == "warning"
    assert found[0].span is not None
    assert found[0].span.line == made.source.document.key_span((section,)).line


@pytest.mark.parametrize(
    ("ends", "mean"),
    [("", 1.0), (", low: 2", 2 * 2 + 2 * 2 + 2), (", high: -1", 1 + 2 + 2), (", low: -3, high: 3", 3.0)],
    ids=["no end", "low", "high", "both ends"],
)
def test_random_actions_are_sampled_as_gymnasium_does(ends: str, mean: float) -> None:
    """The mean square: 1 of a normal action, `b**2 + 2 * b + 2` of `b` and an exponential, `b**2 / 3` of a uniform one."""
    made = task(
        action=f"{{a: {{type: real{ends}}}}}", dynamics="{s': s}", reward="-a * a", horizon="1", expert="{a: 9}"
    )
    [found] = with_code(warnings(made), "W507")
    random = float(found.message.split()[-1])
    assert random == pytest.approx(-mean, abs=0.35 * mean)
    assert abs(random) < 81


def test_a_sensible_task_has_no_warnings() -> None:
    assert warnings(task()) == ()


def test_a_constant_reward_makes_sense_where_episodes_may_end() -> None:
    parts = {"reward": "1", "terminal": "s' == n", "expert": "{a: stay}"}
    assert warnings(task(**parts)) == ()


def test_a_claim_about_the_expert_is_intent() -> None:
    parts = {"expert": "{a: stay}", "claims": "[expert_return < optimal_return]"}
    assert warnings(task(**parts)) == ()


def test_noise_tells_nothing_and_a_named_goal_tells_all() -> None:
    two = {
        "state": "{s: {type: int, low: 0, high: n}, side: {type: bool}}",
        "initial": "{s: 0, side: Bernoulli(1/2)}",
        "dynamics": "{s': 'min(s + ((a == go) == side), n)'}",
        "expert": "optimal",
        "horizon": "n",
    }
    assert "W518" in codes(warnings(task(**two, observation="{s: s, z: 'Normal(mean=0, std=1)'}")))
    assert "W518" not in codes(warnings(task(**two, observation="{s: s, side: side}")))
    assert "W518" not in codes(warnings(task(**two, observation="{s: s, z: 'Normal(mean=side, std=1)'}")))


@pytest.mark.parametrize("path", sparse(specs(SHIPPED), 8), ids=lambda path: path.stem)
def test_shipped_tasks_make_no_warnings(path: Path) -> None:
    for made in tasks_of(path):
        assert set(codes(warnings(made))) <= set(made.spec.accept)


def test_random_actions_that_do_not_end_are_not_simulated_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    simulate = returns.simulate
    made = []

    def counted(*args: Any) -> Any:
        made.append(args)
        return simulate(*args)

    monkeypatch.setattr(returns, "simulate", counted)
    rarely = {"state": "{s: {type: real, low: 0}}", "dynamics": "{s': s + 1 if a == go else 0}", "terminal": "s' > 30"}
    warnings(task(**rarely, horizon="none", reward="s > 30"))
    assert len(made) == 2  # the expert, and random actions once
