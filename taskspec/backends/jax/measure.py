"""Steps inside `scan`, of our programs and of gymnax, for `taskspec.envs.measure`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.backends.jax.functional import Functional
from taskspec.spec.spaces import Layout
from taskspec.spec.task import Task

STEPS = 128
ACTIONS = 16


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


def gymnax_scan(name: str, lanes: int) -> Callable[[], int]:
    """Drives lanes of an environment of gymnax."""
    from importlib import import_module

    gymnax = import_module("gymnax")

    env, params = gymnax.make(name)
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


def _actions(layout: Layout, lanes: int) -> Any:
    rng = np.random.default_rng(0)
    if layout.form == "box":
        low, high = (np.clip(np.array(b), -1, 1).reshape(*layout.shape, 1) for b in (layout.low, layout.high))
        return jnp.array(rng.uniform(low, high, (ACTIONS, *layout.shape, lanes)), jnp.float32)
    rows = [rng.integers(0, count, (ACTIONS, lanes)) for count in layout.counts]
    if layout.form == "discrete":
        return jnp.array(rows[0] + layout.starts[0], jnp.int32)
    return jnp.array(np.stack(rows, 1), jnp.int32)
