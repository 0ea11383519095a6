"""Numbers beyond what an observation, an int or a float can hold."""

from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.exact import soundness
from taskspec.language.task.task import Task
from taskspec.programs.reference import ReferenceProgram
from tests.shared.diagnostics import codes
from tests.shared.walks import written

# -- observations outside their space ---------------------------------------------------------------------------------


def test_what_a_one_hot_vector_cannot_show_shows_nothing() -> None:
    observation = "\n  o: {value: s, low: 1, high: 3}\n  b: s > 4\n  space: one_hot"
    task = written(observation=observation)
    env = taskspec.make(task)
    env.reset(seed=0, options={"state": {"s": 0}})
    for place in range(3):
        assert env.step(1)[0].argmax() == place
    assert env.step(1)[0].tolist() == [0, 0, 0, 1, 0]
    assert set(codes(soundness(task))) == {"E405"}


@pytest.mark.parametrize(
    "observation", ["{o: x, space: box}", "{o: x, p: v, space: dict}", "{p: v}", "{o: x, u: 0}", "{o: x, p: v}"]
)
def test_reals_beyond_float32_are_seen_as_infinite(observation: str) -> None:
    task = written(state="\n  x: {type: real}\n  v: {type: real, shape: [2]}", initial=' {x: 1e30, v: "(1, 1e30)"}',
                   dynamics='\n  x\': x * 1e30\n  v\': v * 1e20', observation=f" {observation}", reward=" 1")  # fmt: skip
    env: Any = taskspec.make(task)
    env.reset(seed=0, options={"state": {"x": 1e300}})
    seen = env.step(0)[0]
    assert np.isinf(np.hstack([*seen.values()] if isinstance(seen, dict) else [seen])).any()


# -- large numbers ----------------------------------------------------------------------------------------------------


def steps(task: Task, count: int) -> list[Any]:
    """Rewards, the same in the interpreter."""
    env = taskspec.make(task)
    reference = ReferenceProgram(task, 0)
    env.reset(seed=0)
    reference.reset()
    rewards = []
    for _ in range(count):
        rewards.append(env.step(1)[1])
        assert np.array_equal(rewards[-1], reference.step([(1,)])[1], equal_nan=True)
    return rewards


def test_ints_without_bounds_stop() -> None:
    task = written(state="\n  s: {type: int}", dynamics=" {s': 's * s + 3'}", horizon=" none")
    assert steps(task, 50)[-1] == 2**31 - 1
    assert soundness(task) == []


def test_a_counter_that_cannot_get_far_is_not_stopped() -> None:
    task = written(state="\n  s: {type: int}", dynamics=" {s': s + a}", horizon=" 200")
    assert str(2**31 - 1) not in taskspec.make(task)._program.source  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "reward",
    ["(s + 2**62) * 4", "(s + 2**200) // 2**199", "(s * 6364136223846793005 + 1) % 10",
     "prod([s + 10 for k in range(40)])",
     "sum((s + 2**62, 2**62, 2**62))", "(s + 3)**16 * (s + 100)**10", "(2**70, 1)[a] // 2**69"],
)  # fmt: skip
def test_ints_that_may_leave_64_bits_are_refused(reward: str) -> None:
    with pytest.raises(SpecError, match="E318"):
        written(reward=f" {reward}")


def test_reals_go_to_infinity_and_soundness_says_so() -> None:
    task = written(
        state="\n  s: {type: real}", dynamics=" {s': 's * s + 3'}", observation=" {o: [s, 0]}", horizon=" 200"
    )
    assert steps(task, 20)[-1] == float("inf")
    assert set(codes(soundness(task))) >= {"E403", "E406"}
