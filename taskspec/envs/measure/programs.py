"""What is measured of ours: the scalar environment, the vector environment of a backend, and the JAX program in `scan`."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import Any, cast

import numpy as np

from taskspec.backends.table import BackendName
from taskspec.envs.env import Environment
from taskspec.envs.measure.race import Clock, Contestant, Drive
from taskspec.task.task import Task

ACTIONS, SCALAR_ACTIONS = 16, 4096
"""Actions drawn beforehand, for lanes and for one environment; they are taken again and again."""


def label(task: Task) -> str:
    """The id of a task, and the parameters that differ from their defaults."""
    changed = [f"{p.name}={p.value}" for p in task.parameters if p.value != p.default]
    return " ".join([task.id, *changed])


def ours(
    task: Task,
    program: str,
    lanes: int = 1,
    *,
    name: str | None = None,
    num_threads: int = 1,
    target: float | None = None,
) -> Contestant:
    """One of `taskspec.backends.table.PROGRAMS`; a task goes by its `label` unless another name is given."""

    def make() -> Drive:
        match program:
            case "scalar":
                return scalar(Environment(task))
            case "jax-scan":
                from taskspec.backends.jax.measure import scan

                return scan(task, lanes)
            case backend:
                return vector(task, backend, lanes, num_threads)

    return Contestant(name or label(task), program, lanes, make, target)


def scalar(env: Any) -> Drive:
    """Steps of a Gymnasium environment, and the resets that they need."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SCALAR_ACTIONS)]
    step, reset = env.step, env.reset

    def drive() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = step(action)
            if terminated or truncated:
                reset()
        return SCALAR_ACTIONS

    return drive


def vector(task: Task, backend: str, lanes: int, num_threads: int = 1) -> Drive:
    """Steps of a vector environment that reuses its arrays and resets within the step."""
    from taskspec.envs.vector import VectorEnvironment

    env = VectorEnvironment(
        task, lanes, backend=cast(BackendName, backend), autoreset_mode="SameStep", reuse=True, num_threads=num_threads
    )
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(ACTIONS)]
    _out_of_phase(env, actions, task.horizon)
    return stepped(env, actions)


def stepped(env: Any, actions: Sequence[Any], lanes: int | None = None) -> Drive:
    """Steps of any vector environment that has been reset; `lanes`, for those that do not say themselves."""
    step, count = env.step, (lanes or int(env.num_envs)) * len(actions)

    def drive() -> int:
        for action in actions:
            step(action)
        return count

    return drive


def _out_of_phase(env: Any, actions: Sequence[Any], horizon: int | None) -> None:
    """Start a share of the lanes at every step, so that about as many end at each."""
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for k in range(min(2 * horizon, 64) if horizon else 0):
        env.step(actions[k % ACTIONS])
        mask = rng.random(env.num_envs) < 1 / (horizon or 1)
        if mask.any():
            env.reset(options={"reset_mask": mask})


def jax_device(programs: Iterable[str]) -> str | None:
    """The platform that JAX runs on, where it is among the programs: cpu, gpu or tpu."""
    if not any(program.startswith("jax") for program in programs):
        return None
    from taskspec.backends.jax.measure import device

    return device()


def clock_for(device: str | None, num_threads: int = 1) -> tuple[str, Clock]:
    """The clock that is fair to all: processor time, which others on the machine do not lengthen.

    Several threads, and accelerators, are measured by time as it passes.
    """
    if num_threads > 1 or device not in (None, "cpu"):
        return "wall", time.perf_counter
    return "processor", time.process_time
