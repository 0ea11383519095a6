"""Exams of learners that step one environment, which Gymnasium 0.29 has as well; imitation needs it."""

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exam import Case, examine, learns_from


@learns_from("reward")
def always(case: Case) -> Array:
    """Take one episode, and return the policy that leaves at once."""
    env = case.env()
    env.reset()
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(1)
        over = terminated or truncated
    return np.ones(case.observation_space.n, int)


def test_a_learner_that_steps_one_environment_is_examined_with_any_gymnasium() -> None:
    found = examine(always, tasks=["EarlyTermNeg"], seeds=1, steps=100, twins=0)
    assert [(score["deterministic"], score["error"]) for score in found["scores"]] == [(1.0, None)]
