"""Warnings about what is written: each on a spec that has the fault, none on one that only looks like it."""

import json
from typing import Any

import pytest

from taskspec.exact import check
from tests.shared.sections import build_text

V = "Uniform(0, 1, shape=6)"
R = "r + dx * v[0]"
PARTS: dict[str, Any] = {
    "parameters": {
        "n": {"type": "int", "default": 3, "low": 1, "high": 9},
        "dx": {"type": "real", "default": 1, "low": 0.5, "high": 2},
    },
    "state": {
        "s": {"type": "int", "low": 0, "high": "n"},
        "v": {"type": "real", "shape": 6, "low": 0, "high": 1},
        "r": {"type": "real"},
    },
    "action": {"a": {"type": "choice", "values": {"stay": 0, "go": 1, "back": -1}}},
    "horizon": "2 * n",
    "initial": {"s": 0, "v": V, "r": 0},
    "dynamics": {"s'": "clip(s + a, 0, n)", "r'": R},
    "reward": "(s' == n and s < n) * v[0] + 0 * r * sum(v)",
}


def pays(extra: str) -> dict[str, Any]:
    return {"reward": f"(s' == n and s < n) * v[0] + 0 * r * sum(v) + {extra}"}


def starts(s: Any = 0, v: str = V) -> dict[str, Any]:
    return {"initial": {"s": s, "v": v, "r": 0}}


def moves(r: str, s: Any = "clip(s + a, 0, n)") -> dict[str, Any]:
    return {"dynamics": {"s'": s, "r'": r}}


def vector(**keys: Any) -> dict[str, Any]:
    return {"state": PARTS["state"] | {"v": {"type": "real", "shape": 6, **keys}}}


def knobs(**keys: Any) -> dict[str, Any]:
    return {"parameters": PARTS["parameters"] | keys}


def codes(parts: dict[str, Any]) -> list[str]:
    text = json.dumps({"taskspec": 1, "name": "Path", **(PARTS | parts)})  # which is YAML
    report = check(build_text(text), claims=False)
    assert not report.errors
    return report.codes


def test_the_spec_that_is_changed_has_no_fault() -> None:
    assert codes({}) == []


FAULTS: dict[str, tuple[str, dict[str, Any]]] = {
    "constant observed": ("W516", {"observation": {"s": "s", "v": "v", "n": "n"}}),
    "hidden from the observation": ("W518", {"observation": {"s": "s", "r": "r"}}),
    "neither seen nor used": ("W519", {"observation": {"s": "s", "v": "v"}, "reward": "(s' == n and s < n) * v[0]"}),
    "drawn for nothing": ("W519", {"reward": "s' == n and s < n"} | moves("r + dx * s / 2")),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults(name: str) -> None:
    code, parts = FAULTS[name]
    assert code in codes(parts)


LOOKALIKES: dict[str, dict[str, Any]] = {
    "noise that is observed": {"observation": {"s": "s", "v": "v", "r": "r", "z": "Normal()", "y": "Normal()"}},
    "time that is observed": {"observation": {"s": "s", "v": "v", "r": "r", "left": "T - t"}},
    "seen through a function": {"observation": {"s": "s", "half": "v[0] > 1/2", "r": "r"}},
    "no range at all": vector(),
    "a range that longer episodes use": {"state": PARTS["state"] | {"r": {"type": "real", "low": 0, "high": 50}}}
    | moves("min(r + dx * v[0], 50)"),
}


@pytest.mark.parametrize("name", LOOKALIKES)
def test_what_only_looks_like_a_fault_is_not_warned_about(name: str) -> None:
    assert codes(LOOKALIKES[name]) == []


@pytest.mark.parametrize("observed", ["", "observation: {o: k}\n"])
def test_a_next_value_that_is_paid_is_used(observed: str) -> None:
    """Nothing reads `hit`, but the reward reads `hit'`."""
    text = f"""
state: {{hit: {{type: bool}}, k: {{type: int, low: 0, high: 3}}}}
action: {{a: {{type: bool}}}}
horizon: 3
initial: {{hit: false, k: 0}}
dynamics: {{hit': Bernoulli(1/2), k': "min(k + a, 3)"}}
{observed}reward: hit' + k
"""
    report = check(build_text(text))
    assert "W519" not in report.codes


GOLD = """
state:
  s: {type: int, low: 0, high: 2}
  gold: {type: bool}
action:
  a: {type: choice, values: [go, grab]}
horizon: 9
observation: {s: s}
initial: {s: 0, gold: FIRST}
dynamics:
  s': min(s + (a == go), 2)
  gold': gold or (a == grab and s == 2)
reward: gold' and not gold
terminal: gold'
"""


@pytest.mark.parametrize(("first", "is_hidden"), [("false", False), ("Bernoulli(1/2)", True)])
def test_what_is_the_same_wherever_an_episode_acts_is_not_hidden(first: str, is_hidden: bool) -> None:
    report = check(build_text(GOLD.replace("FIRST", first)))
    assert ("W518" in report.codes) == is_hidden
