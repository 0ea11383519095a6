"""Many environments of a task, stepped by one jitted function (see `taskspec.backends.vector.Engine`)."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.backends.actions import reader
from taskspec.backends.buffers import Buffers
from taskspec.backends.jax.program import JaxProgram, State, compile_jax, observed
from taskspec.backends.vector import Episodes, LanesNotRunningError, Mode, Options
from taskspec.base.arrays import Array
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task


class JaxEngine:
    """Lanes of a task; their state lives where JAX computes, results are copied to NumPy arrays."""

    def __init__(self, task: Task, lanes: int, options: Options) -> None:
        program = compile_jax(task)
        self.observation = program.observation
        self.action = program.action
        self.source = program.source
        self.buffers = Buffers.of(task, program.observation, lanes)
        self._read = reader(task, program.action, lanes)
        self._episodes = Episodes(self.buffers, options.mode)
        self._lanes = lanes
        self._reset, self._step = functions(task, options.mode)
        self._state = self._empty(task, lanes)

    @staticmethod
    def _empty(task: Task, lanes: int) -> State:
        dtypes = {np.dtype(np.bool_): jnp.bool_, np.dtype(np.int64): jnp.int32, np.dtype(np.float64): jnp.float32}
        held = Buffers.of(task, compile_jax(task).observation, lanes).state
        values = tuple(jnp.zeros(v.shape, dtypes[v.dtype]) for v in held)
        zero = jnp.zeros(lanes, jnp.uint32)
        return State(values, zero.astype(jnp.int32), zero, zero, jnp.zeros((2, lanes), jnp.uint32))

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        self._episodes.seed(seeds, lanes)
        b = self.buffers
        key = np.stack([b.seeds >> np.uint64(32), b.seeds & np.uint64(0xFFFFFFFF)]).astype(np.uint32)
        self._state = self._state._replace(key=jnp.array(key), steps=jnp.array(b.steps), episodes=jnp.array(b.episodes))

    def reset(self, lanes: Array | None = None) -> None:
        b = self.buffers
        chosen = np.full(self._lanes, lanes is None)
        if lanes is not None:
            chosen[lanes] = True
        self._state, seen = self._reset(self._state, jnp.array(chosen))
        for part, new in zip(b.seen.parts, _parts(self.observation, seen), strict=True):
            np.copyto(part, np.asarray(new).reshape(part.shape), where=chosen, casting="unsafe")
        self._episodes.reset(chosen)
        self._keep()

    def step(self, actions: Any) -> int:
        parts = self._read(actions)
        if not self._episodes.ready:
            raise LanesNotRunningError
        b = self.buffers
        narrow = tuple(jnp.array(p.astype(_NARROW[p.dtype.kind])) for p in parts)
        self._state, out = self._step(self._state, narrow, jnp.array(b.ended))
        seen, final, reward, terminated, truncated = out
        shown = (*_parts(self.observation, seen), *_parts(self.observation, final))
        for part, new in zip((*b.seen.parts, *b.final.parts), shown, strict=True):
            np.copyto(part, np.asarray(new).reshape(part.shape), casting="unsafe")
        b.reward[:], b.terminated[:], b.truncated[:] = reward, terminated, truncated
        np.logical_or(b.terminated, b.truncated, b.ended)
        self._keep()
        return self._episodes.step(int(np.count_nonzero(b.ended)))

    def _keep(self) -> None:
        """State and counters where callers look for them."""
        b = self.buffers
        state = self._state
        for held, value in zip(b.state, state.values, strict=True):
            held[...] = value
        b.time[:], b.steps[:], b.episodes[:] = state.time, state.steps, state.episodes

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        self._episodes.place(values, lanes)
        old = self._state.values
        made = tuple(jnp.array(h.astype(o.dtype)) for h, o in zip(self.buffers.state, old, strict=True))
        self._state = self._state._replace(values=made)


_NARROW = {"b": np.bool_, "i": np.int32, "f": np.float32}


def _parts(layout: SpaceLayout, seen: Any) -> list[Any]:
    """Return the parts of a dict in the order of the layout: JAX gives dicts back in that of their keys."""
    return [seen[part.name] for part in layout.parts] if layout.is_dict else [seen]


@lru_cache(maxsize=64)
def functions(task: Task, mode: Mode) -> tuple[Any, Any]:
    """Return the jitted reset and step of an autoreset mode."""
    program = compile_jax(task)
    return jax.jit(_resetting(program)), jax.jit(_stepping(program, mode))


def _chosen(flags: Any, a: State, b: State) -> State:
    """Lanes of `a` where flagged, of `b` elsewhere."""
    return jax.tree.map(lambda x, y: jnp.where(flags, x, y), a, b)  # type: ignore[no-any-return]


def _resetting(program: JaxProgram) -> Any:
    def reset(state: State, chosen: Any) -> tuple[State, Any]:
        fresh, seen = program.begin(state)
        return _chosen(chosen, fresh, state), observed(program.observation, seen)

    return reset


def _stepping(program: JaxProgram, mode: Mode) -> Any:
    layout = program.observation

    def step(state: State, action: Any, late: Any) -> tuple[State, Any]:
        after, result = program.step(state, action)
        seen = observed(layout, result.observation)
        flags = (result.reward, result.terminated, result.truncated)
        if mode == "same_step":
            following, fresh = program.again(after, result)
            return following, (observed(layout, fresh), seen, *flags)
        if mode == "disabled":
            return after, (seen, seen, *flags)
        fresh_state, fresh = program.begin(state)
        shown = jax.tree.map(lambda x, y: jnp.where(late, x, y), observed(layout, fresh), seen)
        reward, terminated, truncated = (jnp.where(late, jnp.zeros_like(f), f) for f in flags)
        return _chosen(late, fresh_state, after), (shown, seen, reward, terminated, truncated)

    return step
