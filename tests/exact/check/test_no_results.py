"""Why there are no exact results, and what would give some."""

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.exact import Results, extract
from tests.shared.sections import build_text

WALK = """
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 3
initial: {s: 0}
dynamics:
  s': clip(floor(s + DRAWN), 0, 3)
reward: s
"""


def test_the_draw_with_infinitely_many_outcomes_is_named() -> None:
    """Whichever of the draws of a step it is."""
    for drawn in ("UniformInt(0, 1) + Normal()", "Normal() + UniformInt(0, 1)", "Poisson(2) + Exponential()"):
        text = WALK.replace("DRAWN", drawn)
        with pytest.raises(SpecError, match=r"a step draws from a (normal|exponential) distribution"):
            extract(build_text(text))


def test_a_reward_without_a_bound_in_a_tail_is_named_with_what_would_bound_it() -> None:
    text = (
        "state: {s: {type: int, low: 0, high: 2}}\naction: {a: {type: int, low: 0, high: 2}}\nnoise: {d: Poisson(2)}\n"
        "horizon: 3\ninitial: {s: 1}\ndynamics: {s': 'min(max(s - d, 0) + a, 2)'}\nreward: REWARD\n"
    )
    found = Results(build_text(text.replace("REWARD", "-d")))
    assert found.optimal is None and found.why_not is not None and "`min(draw, 100)`" in found.why_not
    bounded = Results(build_text(text.replace("REWARD", "-min(d, 100)")))
    assert bounded.optimal is not None and abs(bounded.optimal.value + 6) < 1e-9
