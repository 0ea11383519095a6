"""How fast vector environments are: ours on each backend, and others beside them. Returns data; prints nothing.

Everything to be compared runs in one process and takes turns, round after round, so that a slow moment of the machine
meets all of them; rates are steps per second of processor time, of which medians and spreads are reported. Lanes are out
of phase, episodes that end are reset within the step, and actions are drawn beforehand.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from taskspec.envs.vector import VectorEnvironment
from taskspec.spec.task import Task

ACTIONS = 16
Drive = Callable[[], int]
"""Takes a good many steps in all lanes; gives their number."""


@dataclass(frozen=True, slots=True)
class Contestant:
    """Something that steps lanes: what it is called, and how it is made."""

    name: str
    lanes: int
    make: Callable[[], Drive]
    target: float | None = None  # steps per second that it has to reach


@dataclass(frozen=True, slots=True)
class Rate:
    """Steps per second of a contestant, round by round."""

    name: str
    lanes: int
    rounds: tuple[float, ...]
    target: float | None = None

    @property
    def median(self) -> float:
        return statistics.median(self.rounds)

    @property
    def met(self) -> bool:
        return self.target is None or self.median >= self.target

    def data(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "name": self.name,
            "lanes": self.lanes,
            "steps_per_second": self.median,
            "rounds": list(self.rounds),
            "target": self.target,
            "met": self.met,
        }


def race(contestants: Iterable[Contestant], rounds: int = 7, seconds: float = 0.2) -> list[Rate]:
    """Measure contestants in turns."""
    drives = [(c, c.make()) for c in contestants]
    passes = [_calibrated(drive, seconds) for _, drive in drives]
    found: list[list[float]] = [[] for _ in drives]
    for _ in range(rounds):
        for rates, (_, drive), count in zip(found, drives, passes, strict=True):
            rates.append(_rate(drive, count))
    return [Rate(c.name, c.lanes, tuple(rates), c.target) for (c, _), rates in zip(drives, found, strict=True)]


def _calibrated(drive: Drive, seconds: float) -> int:
    """How many passes take so long, after two to warm up."""
    drive()
    start = time.process_time()
    drive()
    return max(1, round(seconds / max(1e-6, time.process_time() - start)))


def _rate(drive: Drive, passes: int) -> float:
    start = time.process_time()
    steps = sum(drive() for _ in range(passes))
    return steps / max(1e-9, time.process_time() - start)


# -- ours ---------------------------------------------------------------------------------------------------------


def vector(task: Task, backend: str, lanes: int, num_threads: int = 1) -> Drive:
    """Steps of a vector environment that reuses its arrays and resets within the step."""
    env = VectorEnvironment(
        task, lanes, backend=backend, autoreset_mode="SameStep", reuse=True, num_threads=num_threads
    )
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(ACTIONS)]
    _out_of_phase(env, actions, task.horizon)
    step = env.step

    def drive() -> int:
        for action in actions:
            step(action)
        return lanes * ACTIONS

    return drive


def _out_of_phase(env: VectorEnvironment, actions: Sequence[Any], horizon: int | None) -> None:
    """Start a share of the lanes at every step, so that about as many end at each."""
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for k in range(min(2 * horizon, 64) if horizon else 0):
        env.step(actions[k % ACTIONS])
        mask = rng.random(env.num_envs) < 1 / (horizon or 1)
        if mask.any():
            env.reset(options={"reset_mask": mask})


def ours(task: Task, backend: str, lanes: int, target: float | None = None) -> Contestant:
    return Contestant(f"{task.name} on {backend}", lanes, lambda: vector(task, backend, lanes), target)


def scanned(task: Task, lanes: int, target: float | None = None) -> Contestant:
    """The JAX program inside `scan`, on whatever device JAX uses."""

    def make() -> Drive:
        from taskspec.backends.jax.measure import scan

        return scan(task, lanes)

    return Contestant(f"{task.name} on jax in scan", lanes, make, target)


# -- others -------------------------------------------------------------------------------------------------------


def gymnasium_cart_pole(lanes: int) -> Contestant:
    """Gymnasium's own vector environment of CartPole."""

    def make() -> Drive:
        import gymnasium as gym

        return _gymnasium(gym.make_vec("CartPole-v1", num_envs=lanes, vectorization_mode="vector_entry_point"), lanes)

    return Contestant("CartPole of gymnasium", lanes, make)


def seals_sync(env_id: str, lanes: int = 64) -> Contestant:
    """An environment of seals in Gymnasium's SyncVectorEnv."""

    def make() -> Drive:
        import gymnasium as gym
        import seals  # noqa: F401  # registers its environments

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _gymnasium(gym.make_vec(env_id, num_envs=lanes, vectorization_mode="sync"), lanes)

    return Contestant(f"{env_id} in SyncVectorEnv", lanes, make)


def envpool_cart_pole(lanes: int) -> Contestant:
    def make() -> Drive:
        import envpool

        return _gymnasium(envpool.make("CartPole-v1", env_type="gymnasium", num_envs=lanes, num_threads=1), lanes)

    return Contestant("CartPole of envpool", lanes, make)


def _gymnasium(env: Any, lanes: int) -> Drive:
    actions = [np.random.default_rng(k).integers(0, env.single_action_space.n, lanes) for k in range(ACTIONS)] if hasattr(
        getattr(env, "single_action_space", None), "n"
    ) else [env.action_space.sample() for _ in range(ACTIONS)]  # fmt: skip
    env.reset()

    def drive() -> int:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for action in actions:
                env.step(action)
        return lanes * ACTIONS

    return drive


def gymnax(name: str, lanes: int) -> Contestant:
    """An environment of gymnax inside `scan`."""

    def make() -> Drive:
        from taskspec.backends.jax.measure import gymnax_scan

        return gymnax_scan(name, lanes)

    return Contestant(f"{name} of gymnax", lanes, make)


def installed(*packages: str) -> bool:
    return all(find_spec(package) is not None for package in packages)


# -- the table ----------------------------------------------------------------------------------------------------

GROUPS = {
    "tabular": ("RiskyPath", "Branching", "EarlyTermPos", "InitShiftExpert"),
    "plain": ("Parabola", "ProcGoal"),
    "sort": ("Sort",),
    "noisy": ("NoisyObs",),
}
TARGETS: dict[tuple[str, int], dict[str, float]] = {
    ("numba", 4096): {"tabular": 300e6, "plain": 200e6, "sort": 100e6, "noisy": 15e6},
    ("numba", 64): {"tabular": 30e6, "plain": 30e6, "sort": 25e6, "noisy": 10e6},
    ("numpy", 1024): {"tabular": 40e6, "plain": 10e6, "sort": 8e6, "noisy": 1.2e6},
    ("jax", 4096): {"tabular": 150e6, "plain": 50e6, "sort": 12e6, "noisy": 2.5e6},
}
"""Steps per second on one core, by backend and lanes; JAX inside `scan`."""


def table(load: Callable[[str], Task], names: Sequence[str] = ()) -> list[Contestant]:
    """The contestants of the project's own table, for the backends that are installed."""
    found = []
    for (backend, lanes), targets in TARGETS.items():
        if backend != "numpy" and not installed(backend):
            continue
        for group, tasks in GROUPS.items():
            for name in tasks:
                if not names or name in names:
                    make = scanned if backend == "jax" else None
                    task, target = load(f"derail/{name}-v0"), targets[group]
                    found.append(make(task, lanes, target) if make else ours(task, backend, lanes, target))
    return found


# -- starting and memory ------------------------------------------------------------------------------------------

_START = """
import time
start = time.perf_counter()
import taskspec
env = taskspec.make_vec({task!r}, num_envs=1024, backend={backend!r}, autoreset_mode="SameStep")
env.reset(seed=0)
env.step(env.action_space.sample())
print(time.perf_counter() - start)
"""


def start_times(task_id: str, backend: str = "numba", repeats: int = 3) -> tuple[float, float]:
    """Seconds from the start of a process to its first step: with nothing compiled yet, and after that (the best)."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "TASKSPEC_CACHE": folder}
        code = _START.format(task=task_id, backend=backend)
        times = [_seconds(code, environment) for _ in range(1 + repeats)]
    return times[0], min(times[1:])


def _seconds(code: str, environment: dict[str, str]) -> float:
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)


def bytes_per_lane(task: Task, backend: str, lanes: int = 100_000) -> float:
    """Memory that a vector environment holds for each lane, as the arrays of its program count it."""
    return VectorEnvironment(task, lanes, backend=backend).nbytes / lanes
