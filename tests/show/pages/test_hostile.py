"""Hostile and unlucky input: nothing in a spec, its file name or a call runs code, hangs, crashes or goes wrong in silence."""

import pytest

from taskspec.exact import check, scores
from taskspec.show.figures import scene
from tests.shared.walks import written

LONG = {
    "finite": {"initial": " {s: 'UniformInt(0, 9)'}", "horizon": " 2147483646"},
    "real": {"state": "\n  s: {type: real, low: 0, high: 9}", "dynamics": " {s': 9 - s}", "horizon": " 1000000"},
    "endless": {"state": "\n  s: {type: real, low: 0, high: 9}", "dynamics": " {s': 9 - s}", "horizon": " none"},
    "noisy": {"state": "\n  s: {type: bool, shape: [4, 4]}", "initial": " {s: 'Bernoulli(1/2, shape=[4, 4])'}",
              "dynamics": " {s': 'Bernoulli(1/2, shape=[4, 4])'}", "reward": " s[0, 0]"},
}  # fmt: skip


@pytest.mark.parametrize("case", LONG)
def test_returns_and_figures_that_cost_too_much_are_unknown(case: str) -> None:
    task = written(**LONG[case])
    found = scores(task, episodes=20)
    assert found.why_not_exact is not None
    assert (found.random is None) == (case != "noisy")
    scene(task)
    assert not check(task).errors
