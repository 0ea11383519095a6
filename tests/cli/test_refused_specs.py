"""Specs that once ended in a traceback, or took minutes: each through `check` and `run`, with the code that it gets now."""

from pathlib import Path

import pytest

from tests.shared.commands import Done, spec
from tests.shared.sections import text

CHAIN = ", ".join(["x0: {}", *(f"x{i}: {{base: x{i - 1}, horizon: {i + 1}}}" for i in range(1, 400))])


# The code, or "" for what is right as it is, and the sections.
CASES: dict[str, tuple[str, dict[str, str]]] = {
    "no horizon": ("E218", {"horizon": "null"}),
    "no parameter": ("E218", {"parameters": "{h: null}"}),
    "a choice of symbols": ("E203", {"state": "{s: {type: choice, symbols: [p, q]}}"}),
    "a seed that is real": ("E204", {"parameters": "{instance_seed: {type: real, default: 1.5}}"}),
    "a seed that is a choice": ("E204", {"parameters": "{instance_seed: {type: choice, values: [a, b], default: a}}"}),
    "no end below": ("E407", {"parameters": "{L: {type: int, default: 3, low: 1, high: -.inf}}"}),
    "an end that is no number": ("E407", {"parameters": "{L: {type: int, default: 3, low: 1, high: .nan}}"}),
    "a mixed legend": ("E307", {"constants": "{m: {grid: ['AB'], legend: {A: 1, B: [1, 2]}}}"}),
    "a reward with odds": ("E401", {"reward": "{1: s}"}),
    "a start outside": ("E404", {"initial": "{s: -1}"}),
    "a huge claim": ("E603", {"claims": "['optimal_return == 9**9**9']"}),
    "a huge difference": ("E603", {"claims": "['optimal_return < ((9**9999)**9999)**9999']"}),
    "an endless claim": ("E601", {"claims": "['optimal_return == 2.0**2000']"}),
    "an endless tolerance": ("E204", {"claims": "[{claim: 'optimal_return == 7', tolerance: .inf}]"}),
    "many episodes": ("E314", {"claims": "[{claim: 'optimal_return == 1', episodes: 1000000000}]"}),
    "an empty range": ("E407", {"observation": "{o: {value: s, low: 5, high: 1}}"}),
    "another parameter": ("E219", {"variants": "{x: {parameters: {M: {default: 5}}}}"}),
    "another component": ("E219", {"variants": "{x: {state: {q: {high: 9}}}}"}),
    "a section without a value": ("E107", {"variants": "{x: {state: }}"}),
    "a chain of 400": ("E314", {"variants": f"{{{CHAIN}}}"}),
    "a chain of 99": ("", {"variants": f"{{{CHAIN[: CHAIN.index(', x99')]}}}"}),
    "a large state": ("E314", {"state": "{s: {type: real, low: 0, high: 9, shape: 1000000}}", "reward": "s[0]"}),
    "a long sum": ("E314", {"reward": "'sum([(s + i) % 3 for i in range(1000000)])'"}),
    "a patient task": ("", {"horizon": "none", "discount": "0.999999999", "claims": "['optimal_return > 0']"}),
    "a draw in a branch of a set": ("E306", {"reward": "'s in ({UniformInt(0, 3)} if a else {1})'"}),
    "a draw in a set": ("E312", {"dynamics": "{s': 'Uniform({i if a else UniformInt(0, 3) for i in range(3)})'}"}),
    "an expert of an unknown action": ("E216", {"expert": "{act: true}"}),
    "an expert of some unknown actions": ("E216", {"expert": "{b: right, c: 1}"}),
    "an expert that draws": ("", {"expert": "{true: 1/2, false: 1/2}"}),
    "an expert that surely acts": ("", {"expert": "{s < 3: 1}"}),
    "an expert by rows": ("", {"expert": "{by: [s], rows: {else: true}}"}),
    "a discount above 1": ("E411", {"discount": "1.5"}),
    "a discount below 0": ("E411", {"parameters": "{g: {type: real, default: -0.5}}", "discount": "g"}),
    "a return under a model": ("E603", {"claims": "[{claim: random_return == 1, under: soft(1)}]"}),
    "a sum under a model": ("E603", {"claims": "[{claim: not reachable(s == 3) or states == 2, under: optimal}]"}),
    "a chance under a model": ("", {"claims": "[{claim: 1 - probability(s == 9) == 0, under: optimal}]"}),
    "sets in branches": ("", {"dynamics": "{s': 'Uniform({1, 2}) if a else Uniform({3, 4})'}"}),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_each_gets_its_code(case: str, tmp_path: Path) -> None:
    code, sections = CASES[case]
    place = tmp_path / "walk.yaml"
    place.write_text(text(**sections), encoding="utf-8")
    checked = Done("check", place)
    assert checked.status == (1 if code else 0), checked.out
    assert not code or f"error[{code}" in checked.out + checked.err
    assert Done("run", place, "--episodes", 2).status in (0, 1)


def test_bounds_that_hang_on_parameters_name_their_values(tmp_path: Path) -> None:
    path = spec(
        tmp_path, text(parameters="{K: {type: int, default: 0}}", state="{s: {type: int, low: 2 * K, high: K - 1}}")
    )
    assert "no value lies between low = 0 and high = -1" in (done := Done("check", path)).err + done.out
    assert "note: with K = 0" in done.err + done.out
