"""How far components get, as spaces of observations declare it: episodes never leave them, however long they last."""

import pytest

import taskspec
from tests.shared.sections import build_text

TEXT = """
state: {x: {type: int}, y: {type: int}}
action: {a: {type: bool}}
horizon: HORIZON
discount: 0.9
initial: {x: 0, y: 0}
dynamics: {x': "min(x + 1, 2000)", y': "clip(x - 1000, 0, 5)"}
reward: y
observation: {y: y}
"""


@pytest.mark.parametrize("horizon", ["none", "1500"])
def test_what_depends_on_something_that_still_moves_may_move_later(horizon: str) -> None:
    env = taskspec.make(build_text(TEXT.replace("HORIZON", horizon)))
    env.reset(seed=0)
    highest = 0
    for _ in range(1200):
        seen = env.step(0)[0]
        assert env.observation_space.contains(seen)
        highest = max(highest, seen)
    assert highest == 5


def test_what_settles_within_the_horizon_is_bounded() -> None:
    env = taskspec.make(build_text(TEXT.replace("HORIZON", "7")))
    assert env.observation_space.n == 1  # type: ignore[attr-defined]
