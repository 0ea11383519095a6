"""The rate that no program can exceed: an empty step of one environment, or a copy of the bytes that a step moves."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from taskspec.envs.vector import VectorEnvironment
from taskspec.language.task.task import Task
from taskspec.learn.experiments.speed import ACTIONS, Drive

SOME_LANES = 64


def limit(task: Task, program: str, lanes: int) -> Drive:
    """Return a function that does the least that a program of a task can do, for as many steps."""
    match program:
        case "scalar":
            from tests.benchmarks.peers import empty_scalar

            return empty_scalar()
        case "jax-scan":
            from tests.benchmarks.scan import copying_scan

            return copying_scan(task, lanes)
        case _:
            return _copied(round(bytes_of_step(task) * lanes), lanes)


def bytes_of_step(task: Task) -> float:
    """Return the least number of bytes that a step moves: action, observation, reward, flags; state and time in and out."""
    env = VectorEnvironment(task, SOME_LANES, backend="numpy")
    env.reset(seed=0)
    actions = env.action_space.sample()
    results = env.step(actions)[:4]
    buffers = env._engine.buffers
    return (_size(actions) + _size(results) + 2 * _size((*buffers.state, buffers.time))) / SOME_LANES


def _size(values: Any) -> int:
    """Return the bytes of an array, or of those in a tuple or dictionary."""
    if isinstance(values, dict):
        values = tuple(values.values())
    if isinstance(values, tuple):
        return sum(map(_size, values))
    return int(values.nbytes)


def copying(moved: int) -> partial[None]:
    """Return a function that moves so many bytes: half of them are read, and half written."""
    source = np.ones(max(1, moved // 16))
    return partial(np.copyto, np.zeros_like(source), source)


def _copied(moved: int, lanes: int) -> Drive:
    copy = copying(moved)

    def drive() -> int:
        for _ in range(ACTIONS):
            copy()
        return lanes * ACTIONS

    return drive
