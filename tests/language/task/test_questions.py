"""Questions about the expressions of a task, answered by hand for a small one."""

import math

import pytest

from taskspec.language.expressions.types import Role
from taskspec.language.task import questions
from tests.shared.sections import build_text

TASK = build_text("""
state:
  s: {type: int, low: 0, high: 9}
  angle: {type: int, low: 0, high: 4}
  goal: {type: int, low: 0, high: 9}
  hidden: {type: int, low: 0, high: 9}
action:
  a: {type: int, low: 0, high: 1}
definitions:
  twice: 2 * s
horizon: 5
initial: {s: 0, angle: 0, goal: "UniformInt(0, 9)", hidden: 0}
dynamics:
  s': clip(s + (a if Bernoulli(1/2) else 0), 0, 9)
  angle': (angle + 1) % 5
  hidden': hidden + t - t
observation:
  seen: s
  pair: [angle, 3]
  fixed: 7
  late: "t > 2"
reward: s' == goal
""")
NEXT = dict(zip((c.name for c in TASK.state), TASK.process.next, strict=True))
SEEN = dict(zip((c.name for c in TASK.observation.components), TASK.observation.nodes, strict=True))


@pytest.mark.parametrize(("name", "random", "timed", "states", "actions"), [
    ("s", True, False, {"s"}, {"a"}), ("angle", False, False, {"angle"}, set()),
    ("goal", False, False, {"goal"}, set()), ("hidden", False, True, {"hidden"}, set()),
])  # fmt: skip
def test_draws_and_reads_of_next_values(
    name: str, random: bool, timed: bool, states: set[str], actions: set[str]
) -> None:
    asked = [NEXT[name]]
    assert (questions.is_random(asked), questions.reads_time(asked)) == (random, timed)
    assert questions.components_read(asked) == states
    assert questions.components_read(asked, Role.ACTION) == actions


def test_the_kinds_of_expressions() -> None:
    for name, component in (("seen", "s"), ("pair", None), ("fixed", None), ("late", None)):
        assert questions.component(SEEN[name]) == component
    for name, constant in (("seen", None), ("fixed", 7), ("late", None)):
        assert questions.constant(SEEN[name]) == constant
    first, second = questions.elements(SEEN["pair"]) or ()
    assert (questions.component(first), questions.constant(second)) == ("angle", 3)
    assert questions.elements(SEEN["seen"]) is None


def test_components_over_time() -> None:
    assert questions.unchanged(TASK) == {"goal"}
    assert [questions.period(TASK, c.value) for c in TASK.state] == [math.inf, 4, math.inf, math.inf]
    assert questions.components_followed([TASK.process.reward], NEXT) == {"s", "goal"}


def test_sections_as_written() -> None:
    assert questions.written_in(TASK, "dynamics").keys() == {"s'", "angle'", "hidden'"}
    assert questions.written_in(TASK, "reward").place.written == "s' == goal"
    assert questions.written_in(TASK, "terminal") is None
    assert questions.scope(TASK, "reward").lookup("twice") is not None
    assert questions.scope(TASK, "reward").lookup("thrice") is None


def test_parts_answer_for_themselves() -> None:
    assert (TASK.process.never_ends, TASK.process.always_ends) == (True, False)
    assert not TASK.observation.is_random
