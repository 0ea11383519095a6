"""Many environments of a task, stepped by compiled kernels over their memory (see `taskspec.programs.vector_program.Engine`)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.task.task import Task
from taskspec.programs.numba.loading import LoadedKernel, Run, load
from taskspec.programs.numba.loops import BAD, CHECK, CHECKED_STEP, GAP, RESET, STEP, WHAT, Program, generate
from taskspec.programs.vector_program import (
    BadActionError,
    Buffers,
    Episodes,
    LanesNotRunningError,
    Mode,
    Options,
    action_array,
)


@lru_cache(maxsize=64)
def compile_numba(task: Task, mode: Mode, actions: str) -> tuple[str, Program, LoadedKernel]:
    """Source, memory and kernel of a task, for actions of a type: "i" (int64), "f" (float32) or "d" (float64)."""
    source, program = generate(task, task.observation_layout, task.action_layout, mode, actions)
    return source, program, load(source)


class NumbaEngine:
    """Lanes of a task; with several threads, each steps a range of them."""

    def __init__(self, task: Task, lanes: int, options: Options) -> None:
        self._task = task
        self._mode = options.mode
        whole = task.action_layout.parts[0].is_whole
        self._dtype = np.dtype(np.int64 if whole else np.float32)
        self.source, program, kernel = compile_numba(task, options.mode, "i" if whole else "f")
        self._kernels = [kernel]  # their functions do not keep them
        self.observation = program.observation
        self.action = program.action
        self.buffers = Buffers.of(task, program.observation, lanes, GAP)
        self._shape = (lanes, *self.action.shape)
        self._program = program
        self._keys = np.zeros((2, lanes), np.uint32)
        self._chosen = np.zeros(lanes, np.bool_)
        threads = max(1, min(options.num_threads, -(-lanes // program.block)))
        blocks = -(-lanes // program.block)
        size = -(-blocks // threads) * program.block  # of the range of a thread
        ranges = [(first, min(first + size, lanes)) for first in range(0, lanes, size)]
        self._scratch: list[dict[str, Array]] = []
        self._memory = [self._addresses(*place) for place in ranges]
        self._runs = list(map(kernel.bound, self._memory))
        self._lanes = lanes
        self._episodes = Episodes(self.buffers, options.mode)
        self._waits = options.mode == "disabled"
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def _addresses(self, start: int, stop: int) -> Array:
        """Return the numbers of `Memory.fields`, and where every array begins: uint64."""
        p = self._program
        scratch: dict[str, Array] = {
            "lanes": np.zeros(p.block + 1, np.int64),
            "words": np.zeros((p.rows, p.width), np.uint32),
            "reals": np.zeros((p.rows, p.width), np.float32),
        }
        self._scratch.append(scratch)
        b = self.buffers
        arrays = {
            "k0": self._keys[0], "k1": self._keys[1], "steps": b.steps, "episodes": b.episodes, "time": b.time,
            "reward": b.reward, "terminated": b.terminated, "truncated": b.truncated, "ended": b.ended,
            "chosen": self._chosen, **scratch,
        }  # fmt: skip
        arrays |= {f"s{i}": array for i, array in enumerate(b.state)}
        arrays |= {f"measure{i}": array for i, array in enumerate(b.measures)}
        arrays |= {f"seen{i}": array for i, array in enumerate(b.seen.parts)}
        arrays |= {f"final{i}": array for i, array in enumerate(b.final.parts)}
        places = [arrays[name].ctypes.data for name in self._program.memory.fields[4:]]
        return np.array([start, stop, len(b.seeds) + GAP, CHECKED_STEP, *places], np.uint64)

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        self._episodes.seed(seeds, lanes)
        b = self.buffers
        self._keys[0] = b.seeds.astype(np.uint32)
        self._keys[1] = (b.seeds >> np.uint64(32)).astype(np.uint32)

    def reset(self, lanes: Array | None = None) -> None:
        chosen = self._chosen
        chosen[:] = lanes is None
        if lanes is not None:
            chosen[lanes] = True
        self._each(RESET, self._runs, chosen)
        self._episodes.reset(chosen)

    def _each(self, what: int, runs: list[Run], data: Array) -> int:
        """Return something in every range, one after the other; gives what they give, added up."""
        total = 0
        for memory, run in zip(self._memory, runs, strict=True):
            memory[WHAT] = what
            total += run(data)
            memory[WHAT] = CHECKED_STEP
        return total

    def step(self, actions: Any) -> int:
        if not self._episodes.ready:
            raise LanesNotRunningError
        if (
            actions.__class__ is not np.ndarray
            or actions.dtype is not self._dtype
            or actions.shape != self._shape
            or not actions.flags.c_contiguous
        ):
            actions = self._read(actions)
        runs = self._runs if actions.dtype is self._dtype else self._other
        if self._pool is None:
            ended = runs[0](actions)
        else:
            ended = self._step_threads(runs, actions)
        if ended == BAD:
            raise BadActionError
        if self._waits:
            self._episodes.step(ended)
        return ended

    def _read(self, actions: Any) -> Array:
        """Return actions as an array of the kernel's type: int64, or float32 (float64 where they come so)."""
        array = action_array(actions, self.action, self._lanes)
        if self._dtype.kind == "i":
            return np.ascontiguousarray(array, np.int64)
        return np.ascontiguousarray(array, np.float32 if array.dtype == np.float32 else np.float64)

    @cached_property
    def _other(self) -> list[Run]:
        """The kernel for actions in float64."""
        kernel = compile_numba(self._task, self._mode, "d")[2]
        self._kernels.append(kernel)
        return list(map(kernel.bound, self._memory))

    def _step_threads(self, runs: list[Run], actions: Array) -> int:
        assert self._pool is not None
        if self._each(CHECK, runs, actions):
            return BAD
        for memory in self._memory:
            memory[WHAT] = STEP
        jobs = [self._pool.submit(run, actions) for run in runs]
        total = sum(job.result() for job in jobs)
        for memory in self._memory:
            memory[WHAT] = CHECKED_STEP
        return total

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        self._episodes.place(values, lanes)
