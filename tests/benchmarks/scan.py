"""Steps inside `scan`, of our programs and of gymnax."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task
from taskspec.programs.jax.functions import Functional

STEPS = 128
ACTIONS = 16


def device() -> str:
    """The platform that JAX runs on: cpu, gpu or tpu."""
    return str(jax.default_backend())


def held() -> int:
    """Bytes of all arrays that JAX holds."""
    arrays: Any = jax.live_arrays  # without types
    return sum(array.nbytes for array in arrays())


def scan(task: Task, lanes: int) -> Callable[[], int]:
    """Drives lanes of a task, out of phase; all that a step gives is added up, so that nothing is left out."""
    functional = Functional(task)
    key = jnp.stack([jnp.zeros(lanes, jnp.uint32), jnp.arange(lanes, dtype=jnp.uint32)])
    _, state = jax.jit(functional.lanes_reset)(key)
    if task.horizon is not None:
        state = state._replace(time=jnp.arange(lanes, dtype=jnp.int32) % task.horizon)
    actions = _actions(functional.program.action, lanes)

    def step(carry: Any, k: Any) -> tuple[Any, None]:
        state, total = carry
        seen, state, result = functional.lanes_step(state, actions[k % ACTIONS])
        ended = result.terminated | result.truncated
        return (state, total + result.reward + ended + _sum(seen)), None

    return _driver(step, (state, jnp.zeros(lanes)), lanes)


def copying_scan(task: Task, lanes: int) -> Callable[[], int]:
    """Drive a scan whose step moves as many bytes as one of a task does at least: actions in; states and times in and out."""
    functional = Functional(task)
    _, state = jax.jit(functional.lanes_reset)(jnp.zeros((2, lanes), jnp.uint32))
    kept = sum(array.nbytes for array in (*state.values, state.time))
    moved = 2 * kept + _actions(functional.program.action, lanes)[0].nbytes

    def step(carry: Any, k: Any) -> tuple[Any, None]:
        return carry + 1, None

    return _driver(step, jnp.zeros(moved // 8, jnp.float32), lanes)


def gymnax_scan(
    name: str, lanes: int, options: Mapping[str, Any] | None = None, changes: Mapping[str, Any] | None = None
) -> Callable[[], int]:
    """Drives lanes of an environment of gymnax, made with options, its parameters changed."""
    gymnax = import_module("gymnax")
    env, params = gymnax.make(name, **(options or {}))
    params = params.replace(**(changes or {}))
    keys = jax.random.split(jax.random.key(0), lanes)
    _, state = jax.jit(jax.vmap(env.reset, (0, None)))(keys, params)
    count = env.action_space(params).n
    actions = jnp.array(np.random.default_rng(0).integers(0, count, (ACTIONS, lanes)), jnp.int32)

    def step(carry: Any, k: Any) -> tuple[Any, None]:
        state, total, key = carry
        key, own = jax.random.split(key)
        each = jax.random.split(own, lanes)
        results = jax.vmap(env.step, (0, 0, 0, None))(each, state, actions[k % ACTIONS], params)
        seen, state, reward, *ends, _ = results  # one flag before gymnax 1.0, two since then
        return (state, total + reward + sum(ends) + seen.reshape(lanes, -1).sum(1), key), None

    return _driver(step, (state, jnp.zeros(lanes), jax.random.key(1)), lanes)


def _driver(step: Callable[[Any, Any], tuple[Any, None]], carry: Any, lanes: int) -> Callable[[], int]:
    run = jax.jit(lambda c: jax.lax.scan(step, c, jnp.arange(STEPS))[0])
    held = [carry]

    def drive() -> int:
        held[0] = run(held[0])
        jax.tree.map(lambda x: x.block_until_ready(), held[0])
        return lanes * STEPS

    return drive


def _sum(seen: Any) -> Any:
    parts = seen.values() if isinstance(seen, dict) else [seen]
    return sum(p.reshape(-1, p.shape[-1]).sum(0) for p in parts)


def _actions(layout: SpaceLayout, lanes: int) -> Any:
    """Random actions (ACTIONS, *shape, lanes) in the space of a layout."""
    rng = np.random.default_rng(0)
    if layout.form == "box":
        low, high = (bound.reshape(*layout.shape, 1) for bound in _bounds(layout))
        return jnp.array(rng.uniform(low, high, (ACTIONS, *layout.shape, lanes)), jnp.float32)
    rows = [rng.integers(0, count, (ACTIONS, lanes)) for count in layout.counts]
    if layout.form == "discrete":
        return jnp.array(rows[0] + layout.starts[0], jnp.int32)
    return jnp.array(np.stack(rows, 1), jnp.int32)


def _bounds(layout: SpaceLayout) -> tuple[Any, Any]:
    """The bounds of a box; where there is none, 2 from the other one, or -1 and 1."""
    low = np.array(layout.low)
    high = np.array(layout.high)
    low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2, -1))
    return low, np.where(np.isfinite(high), high, low + 2)
