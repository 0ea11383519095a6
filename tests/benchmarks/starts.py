"""What is paid before the first step and beside it: the start of a process, and memory."""

from __future__ import annotations

import gc
import os
import pickle
import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from dataclasses import asdict, dataclass
from typing import Any, cast

from taskspec.base.diagnostics import TaskspecError
from taskspec.language.task.task import Task
from taskspec.programs.backend_table import BackendName
from tests.benchmarks.race import label

LANES = 1024
"""Lanes of the environment that a new process steps."""
FEW_LANES = 1_000
MEMORY_LANES = 100_000
PATIENCE = 600.0
"""Seconds after which a process that has not taken a step is given up."""

_PROCESS = f"""
import pickle, sys, time
sys.path[:] = pickle.load(sys.stdin.buffer)
task, program = pickle.load(sys.stdin.buffer)
if program == "scalar":
    from taskspec.envs import Environment
    env = Environment(task)
else:
    from taskspec.envs.vector import VectorEnvironment
    env = VectorEnvironment(task, {LANES}, backend=program, autoreset_mode="SameStep")
env.reset(seed=0)
env.step(env.action_space.sample())
print(time.time())
"""


@dataclass(frozen=True, slots=True)
class Start:
    """Seconds from the start of a process to its first step: with nothing compiled yet, and then with what was kept."""

    task: str
    program: str
    cold: float
    rounds: tuple[float, ...]

    @property
    def warm(self) -> float:
        return statistics.median(self.rounds)

    def data(self) -> dict[str, Any]:
        """As plain data."""
        return {"task": self.task, "program": self.program, "cold": self.cold, "warm": self.warm,
                "rounds": list(self.rounds)}  # fmt: skip


@dataclass(frozen=True, slots=True)
class MemoryUse:
    """Bytes that a vector environment holds for its lanes: states, results, scratch, and the bounds of its spaces."""

    task: str
    program: str
    lanes: int
    bytes: int

    @property
    def per_lane(self) -> float:
        return self.bytes / self.lanes

    def data(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self) | {"bytes_per_lane": self.per_lane}


def start_times(task: Task, program: str, repeats: int = 3) -> Start:
    """Start processes that import, read and compile a task, and take a step: the first with an empty cache.

    Raises:
        TaskspecError: when a process ends without a step.
    """
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "TASKSPEC_CACHE": folder}
        cold, *warm = [_seconds(task, program, environment) for _ in range(1 + repeats)]
    return Start(label(task), program, cold, tuple(warm))


def _seconds(task: Task, program: str, environment: dict[str, str]) -> float:
    message = pickle.dumps(sys.path) + pickle.dumps((task, program))
    start = time.time()
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", _PROCESS],
            input=message,
            env=environment,
            capture_output=True,
            check=True,
            timeout=PATIENCE,
        )
    except subprocess.SubprocessError as error:
        raise TaskspecError(
            f"no step of {label(task)} on {program} in a process of its own: {_reason(error)}"
        ) from None
    return float(done.stdout) - start


def _reason(error: subprocess.SubprocessError) -> str:
    if isinstance(error, subprocess.CalledProcessError):
        lines = error.stderr.decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit status {error.returncode}"
    return f"it took longer than {PATIENCE:g} seconds"


def memory(task: Task, backend: str, lanes: int = MEMORY_LANES) -> MemoryUse:
    """What many lanes hold beyond what a few do, by Python's own account of memory, and JAX's of its arrays."""
    few, many = (_held(task, backend, n) for n in (FEW_LANES, lanes))
    return MemoryUse(label(task), backend, lanes, round((many - few) * lanes / (lanes - FEW_LANES)))


def _held(task: Task, backend: str, lanes: int) -> int:
    """Bytes that an environment holds after its first step."""
    from taskspec.envs.vector import VectorEnvironment

    tracing = tracemalloc.is_tracing()
    tracemalloc.start()
    try:
        before = _allocated(backend)
        env = VectorEnvironment(task, lanes, backend=cast(BackendName, backend), autoreset_mode="SameStep", reuse=True)
        env.reset(seed=0)
        env.step(env.action_space.sample())
        return _allocated(backend) - before
    finally:
        if not tracing:
            tracemalloc.stop()


def _allocated(backend: str) -> int:
    gc.collect()
    found = tracemalloc.get_traced_memory()[0]
    if backend == "jax":
        from tests.benchmarks.scan import held

        found += held()
    return found
