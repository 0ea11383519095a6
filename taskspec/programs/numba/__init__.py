"""Many environments of a task, stepped by compiled loops over their memory (see `taskspec.programs.vector_program.Engine`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.task.task import Task
from taskspec.programs.numba.loops import Program
from taskspec.programs.numba.module import BAD, compiled, generate, load
from taskspec.programs.vector_program import (
    BadActionError,
    Buffers,
    Episodes,
    LanesNotRunningError,
    Mode,
    Options,
    Values,
    action_array,
)


@lru_cache(maxsize=64)
def compile_numba(task: Task, mode: Mode) -> tuple[str, Program, ModuleType]:
    """Source of a task's module, what it says about memory, and the module."""
    source, program = generate(task, mode)
    return source, program, load(source)


class NumbaEngine:
    """Lanes of a task; with several threads, each steps a range of them."""

    def __init__(self, task: Task, lanes: int, options: Options) -> None:
        self.source, program, self._module = compile_numba(task, options.mode)
        self.observation = program.observation
        self.action = program.action
        blocks = math.ceil(lanes / program.block)
        threads = min(options.num_threads, blocks)
        size = math.ceil(blocks / threads) * program.block  # of the range of a thread
        starts = range(0, lanes, size)
        block = program.memory.block(lanes, len(starts))
        self._ranges = []  # the first arguments of `step` and `reset`, for each thread
        for start, scratch in zip(starts, block.scratch, strict=True):
            self._ranges.append((block.memory, block.pitch, start, min(start + size, lanes), scratch))
        self._keys = (block.arrays["k0"], block.arrays["k1"])
        self._chosen = block.arrays["chosen"]
        self.buffers = _buffers(program, block.arrays, lanes)
        self._episodes = Episodes(self.buffers, options.mode)
        self._waits = options.mode == "disabled"
        self._shape = (lanes, *self.action.shape)
        self._dtype = np.dtype(np.int64 if self.action.parts[0].is_whole else np.float32)
        self._reset = compiled(self._module.reset, *self._ranges[0])
        self._step = self._step_for(self._dtype)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def _step_for(self, dtype: Any) -> Callable[..., int]:
        return compiled(self._module.step, *self._ranges[0], np.zeros(self._shape, dtype))

    @cached_property
    def _step_float64(self) -> Callable[..., int]:
        return self._step_for(np.float64)

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        self._episodes.seed(seeds, lanes)
        low, high = self._keys
        low[:] = self.buffers.seeds.astype(np.uint32)
        high[:] = self.buffers.seeds >> np.uint64(32)

    def reset(self, lanes: Array | None = None) -> None:
        chosen = self._chosen
        chosen[:] = lanes is None
        if lanes is not None:
            chosen[lanes] = True
        for place in self._ranges:
            self._reset(*place)
        self._episodes.reset(chosen)

    def step(self, actions: Any) -> int:
        if not self._episodes.ready:
            raise LanesNotRunningError
        step = self._step
        if (
            actions.__class__ is not np.ndarray
            or actions.dtype is not self._dtype
            or actions.shape != self._shape
            or not actions.flags.c_contiguous
        ):
            actions = self._read(actions)
            if actions.dtype == np.float64:
                step = self._step_float64
        if self._pool is None:
            ended = step(*self._ranges[0], actions)
        else:
            jobs = [self._pool.submit(step, *place, actions) for place in self._ranges]
            counts = [job.result() for job in jobs]
            ended = BAD if BAD in counts else sum(counts)  # all are BAD then: each looks at all actions first
        if ended == BAD:
            raise BadActionError
        if self._waits:
            self._episodes.step(ended)
        return ended

    def _read(self, actions: Any) -> Array:
        """Convert actions to an array that a step takes: int64, or float32 (float64 where they come so)."""
        array = action_array(actions, self.action, len(self._chosen))
        if self._dtype.kind == "i":
            return np.ascontiguousarray(array, np.int64)
        return np.ascontiguousarray(array, np.float32 if array.dtype == np.float32 else np.float64)

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        self._episodes.place(values, lanes)


def _buffers(program: Program, arrays: dict[str, Array], lanes: int) -> Buffers:
    observation = program.observation
    numbers = range(len(observation.parts))
    return Buffers(
        seeds=np.zeros(lanes, np.uint64), steps=arrays["steps"], episodes=arrays["episodes"], time=arrays["time"],
        running=np.zeros(lanes, np.bool_), state=tuple(arrays[f"s{i}"] for i in range(len(program.states))),
        seen=Values(observation, tuple(arrays[f"seen{i}"] for i in numbers)),
        final=Values(observation, tuple(arrays[f"final{i}"] for i in numbers)),
        reward=arrays["reward"], terminated=arrays["terminated"], truncated=arrays["truncated"], ended=arrays["ended"],
        measures=tuple(arrays[name] for name in program.measures),
    )  # fmt: skip
