"""Steps per second of environments.

What is compared runs in one process and takes turns, round after round, so that a slow moment of the machine meets all of it.
Lanes are out of phase, episodes that end are reset within the step, and actions are drawn beforehand.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np

from taskspec.backends.backend_table import BackendName
from taskspec.envs.env import Environment
from taskspec.task.task import Task

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
    (one,), (many,) = race((scalar(Environment(task)), vector(task, "numpy", lanes)), 1, seconds)
    return one, many


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
    from taskspec.envs.vector import VectorEnvironment

    env = VectorEnvironment(
        task, lanes, backend=cast(BackendName, backend), autoreset_mode="SameStep", reuse=True, num_threads=num_threads
    )
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(ACTIONS)]
    _out_of_phase(env, actions, task.horizon)
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


def _out_of_phase(env: Any, actions: Sequence[Any], horizon: int | None) -> None:
    """Reset a share of the lanes at every step, so that about as many episodes end at each."""
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for k in range(min(2 * horizon, 64) if horizon else 0):
        env.step(actions[k % ACTIONS])
        mask = rng.random(env.num_envs) < 1 / (horizon or 1)
        if mask.any():
            env.reset(options={"reset_mask": mask})


def race(
    drives: Sequence[Drive],
    rounds: int,
    seconds: float,
    clock: Clock = time.process_time,
    tick: Callable[[], None] = lambda: None,
) -> list[tuple[float, ...]]:
    """Measure drives in turns.

    Args:
        drives: what is measured.
        rounds: the number of measurements of each drive.
        seconds: the approximate duration of a measurement.
        clock: processor time unless given.
        tick: called after each round.

    Returns:
        The steps per second of each drive, round by round.
    """
    passes = [_calibrated(drive, seconds, clock) for drive in drives]
    found = []
    for _ in range(rounds):
        found.append([_rate(drive, count, clock) for drive, count in zip(drives, passes, strict=True)])
        tick()
    return list(zip(*found, strict=True))


def _calibrated(drive: Drive, seconds: float, clock: Clock) -> int:
    """Return the number of passes that take so long, after one to warm up."""
    drive()
    passes = 1
    while (took := _timed(drive, passes, clock)[1]) < CALIBRATION * seconds:
        passes *= 4
    return max(1, round(passes * seconds / took))


def _rate(drive: Drive, passes: int, clock: Clock) -> float:
    steps, took = _timed(drive, passes, clock)
    return steps / max(1e-9, took)


def _timed(drive: Drive, passes: int, clock: Clock) -> tuple[int, float]:
    start = clock()
    steps = sum(drive() for _ in range(passes))
    return steps, clock() - start
