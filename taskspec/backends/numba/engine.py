"""Many environments of a task, stepped by compiled kernels over their memory (see `taskspec.backends.vector.Engine`)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from taskspec.backends.actions import BadActionError
from taskspec.backends.buffers import Array, Buffers
from taskspec.backends.kernelmemory import Program
from taskspec.backends.kernelstep import generate
from taskspec.backends.numba.compile import load
from taskspec.backends.vector import Mode, NotRunningError, Options
from taskspec.lang.types import Kind
from taskspec.spec.spaces import action_layout, observation_layout
from taskspec.spec.task import Task


@lru_cache(maxsize=64)
def compile_numba(task: Task, mode: Mode) -> tuple[str, Program, ModuleType]:
    """Source, memory and module of a task's kernel."""
    source, program = generate(task, observation_layout(task), action_layout(task), mode)
    return source, program, load(source)


class NumbaEngine:
    """Lanes of a task; with several threads, each steps a range of them."""

    def __init__(self, task: Task, lanes: int, options: Options) -> None:
        self.source, program, module = compile_numba(task, options.mode)
        self.observation, self.action = program.observation, program.action
        self.buffers = Buffers.of(task, program.observation, lanes)
        self._program, self._mode = program, options.mode
        self._keys = np.zeros((2, lanes), np.uint32)
        self._check, self._step, self._reset = module.check, module.step, module.reset
        self._set_actions(task, lanes)
        threads = max(1, min(options.num_threads, -(-lanes // program.block)))
        self._ranges = _ranges(lanes, threads, program.block)
        self._scratch = [self._new_scratch() for _ in self._ranges]
        self._lanes, self._begun, self._over = lanes, False, 0
        pairs = zip(self._scratch, self._ranges, strict=True)
        self._memory = [self._addresses(scratch, *place) for scratch, place in pairs]
        self._first, self._all = self._memory[0], self._addresses(self._scratch[0], 0, lanes)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def _set_actions(self, task: Task, lanes: int) -> None:
        self._shape: tuple[int, ...] = (lanes, *self.action.shape) if self.action.form != "discrete" else (lanes,)
        box = self.action.form == "box"
        self._dtype = np.dtype(np.float32 if box else np.int64)
        self._kinds = "fiub" if box else "iub"
        self._whole = all(c.type.kind is not Kind.REAL for c in task.action)

    def _new_scratch(self) -> dict[str, Array]:
        p = self._program
        return {
            "lanes": np.zeros(p.block + 1, np.int64),
            "words": np.zeros((p.rows, p.block), np.uint32),
            "reals": np.zeros((p.rows, p.block), np.float32),
        }

    def _addresses(self, scratch: dict[str, Array], start: int, stop: int) -> Array:
        """Where every array of `Memory.fields` begins, after the range of lanes and the number of all."""
        b = self.buffers
        arrays = {
            "k0": self._keys[0], "k1": self._keys[1], "steps": b.steps, "episodes": b.episodes, "time": b.time,
            "reward": b.reward, "terminated": b.terminated, "truncated": b.truncated, "ended": b.ended, **scratch,
        }  # fmt: skip
        arrays |= {f"s{i}": array for i, array in enumerate(b.state)}
        arrays |= {f"seen{i}": array for i, array in enumerate(b.seen.parts)}
        arrays |= {f"final{i}": array for i, array in enumerate(b.final.parts)}
        places = [arrays[name].ctypes.data for name in self._program.memory.fields[3:]]
        return np.array([start, stop, self._lanes, *places], np.uint64)

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        b, chosen = self.buffers, slice(None) if lanes is None else lanes
        b.seeds[chosen] = seeds
        b.steps[chosen] = 0
        b.episodes[chosen] = 0
        self._keys[0] = b.seeds.astype(np.uint32)
        self._keys[1] = (b.seeds >> np.uint64(32)).astype(np.uint32)

    def reset(self, lanes: Array | None = None) -> None:
        b = self.buffers
        chosen = np.full(self._lanes, lanes is None)
        if lanes is not None:
            chosen[lanes] = True
        self._reset(self._all, chosen)
        b.running |= chosen
        self._begun = self._begun or bool(b.running.all())
        if self._mode == "disabled":
            self._over = int(np.count_nonzero(b.ended))

    def step(self, actions: Any) -> int:
        if not self._begun or self._over:
            raise NotRunningError
        if (
            actions.__class__ is not np.ndarray
            or actions.dtype is not self._dtype
            or actions.shape != self._shape
            or not actions.flags.c_contiguous
        ):
            actions = self._read(actions)
        ended: int = self._step(self._first, actions) if self._pool is None else self._step_threads(actions)
        if ended < 0:
            raise BadActionError
        if self._mode == "disabled":
            self._over = ended
        return ended

    def _read(self, actions: Any) -> Array:
        """Actions as an array of the kernel's type: int64, or float32 (float64 where they come so)."""
        array = np.asarray(actions)
        if array.shape != self._shape or array.dtype.kind not in self._kinds:
            raise BadActionError
        if self._dtype.kind == "i":
            return np.ascontiguousarray(array, np.int64)
        return np.ascontiguousarray(array, np.float32 if array.dtype == np.float32 else np.float64)

    def _step_threads(self, actions: Array) -> int:
        assert self._pool is not None
        if self._check(self._lanes, actions.reshape(-1)):
            return -1
        jobs = [self._pool.submit(self._step, memory, actions) for memory in self._memory]
        return sum(job.result() for job in jobs)

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        for held, new in zip(self.buffers.state, values, strict=True):
            held[..., lanes] = new


def _ranges(lanes: int, threads: int, block: int) -> list[tuple[int, int]]:
    """Lanes shared out among threads, in whole blocks."""
    blocks = -(-lanes // block)
    size = -(-blocks // threads) * block
    return [(start, min(start + size, lanes)) for start in range(0, lanes, size)]
