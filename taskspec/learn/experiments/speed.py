"""Steps per second of environments.

Lanes are out of phase, episodes that end are reset within the step, and actions are drawn beforehand.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np

from taskspec.envs.env import Environment
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.task.task import Task
from taskspec.programs.backend_table import BackendName

Drive = Callable[[], int]
"""A function that takes many steps in all lanes and returns their number."""
Clock = Callable[[], float]
"""A function that returns seconds of processor time or of wall-clock time."""
ACTIONS = 16
"""Actions of each lane, drawn beforehand and repeated."""
SCALAR_ACTIONS = 4096
"""Actions of one environment, drawn beforehand and repeated."""
CALIBRATION = 0.25
"""A measurement is planned from one that takes at least this share of its time."""


def steps_per_second(task: Task, lanes: int, seconds: float) -> tuple[float, float]:
    """Return the steps per second, in processor time, of one environment and of `lanes` environments on NumPy.

    Args:
        task: the task to step.
        lanes: the number of environments that are stepped together.
        seconds: the approximate duration of each of both measurements.
    """
    one = scalar(Environment(task))
    many = vector(task, "numpy", lanes)
    return rate(one, passes_in(one, seconds)), rate(many, passes_in(many, seconds))


def scalar(env: Any) -> Drive:
    """Return a function that steps a Gymnasium environment, and resets it where episodes end."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SCALAR_ACTIONS)]
    step = env.step
    reset = env.reset

    def drive() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = step(action)
            if terminated or truncated:
                reset()
        return SCALAR_ACTIONS

    return drive


def vector(task: Task, backend: str, lanes: int, num_threads: int = 1) -> Drive:
    """Return a function that steps a vector environment, which reuses its arrays and resets within the step."""
    env = VectorEnvironment(
        task, lanes, backend=cast(BackendName, backend), autoreset_mode="SameStep", reuse=True, num_threads=num_threads
    )
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(ACTIONS)]
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    # About as many episodes are to end at each step: a share of the lanes is reset after each.
    for k in range(min(2 * task.horizon, 64) if task.horizon else 0):
        env.step(actions[k % ACTIONS])
        mask = rng.random(lanes) < 1 / (task.horizon or 1)
        if mask.any():
            env.reset(options={"reset_mask": mask})
    return stepped(env, actions)


def stepped(env: Any, actions: Sequence[Any], lanes: int | None = None) -> Drive:
    """Return a function that steps a vector environment that has been reset; `lanes` is for those without `num_envs`."""
    step = env.step
    count = (lanes or int(env.num_envs)) * len(actions)

    def drive() -> int:
        for action in actions:
            step(action)
        return count

    return drive


def passes_in(drive: Drive, seconds: float, clock: Clock = time.process_time) -> int:
    """Return the number of passes of a drive that take so long, after one to warm up."""
    drive()
    passes = 1
    while (took := _timed(drive, passes, clock)[1]) < CALIBRATION * seconds:
        passes *= 4
    return max(1, round(passes * seconds / took))


def rate(drive: Drive, passes: int, clock: Clock = time.process_time) -> float:
    """Return the steps per second of so many passes."""
    steps, took = _timed(drive, passes, clock)
    return steps / max(1e-9, took)


def _timed(drive: Drive, passes: int, clock: Clock) -> tuple[int, float]:
    start = clock()
    steps = sum(drive() for _ in range(passes))
    return steps, clock() - start
