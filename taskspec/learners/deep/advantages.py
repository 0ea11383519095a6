"""What actions are worth, from what followed."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from taskspec.learners.deep.world import Played, Walk, World

Array = Any


def judged(world: World, steps: Played, walk: Walk, sees_time: bool) -> Array:
    """What a critic sees of steps and of where they led, (T + 1, E, D)."""
    return jnp.concatenate([_seen(world, *steps[:3], sees_time), _last(world, walk, sees_time)[None]])


def critic_inputs(world: World, sees_time: bool) -> int:
    return world.seen.size + world.absorbs + (sees_time and world.horizon is not None)


def _last(world: World, walk: Walk, sees_time: bool) -> Array:
    return _seen(world, walk.seen, walk.gone, walk.state.time, sees_time)


def _seen(world: World, seen: Array, gone: Array, time: Array, sees_time: bool) -> Array:
    parts = [seen]
    if world.absorbs:
        parts.append(gone[..., None])
    if sees_time and world.horizon is not None:
        parts.append((time / world.horizon).astype(jnp.float32)[..., None])
    return jnp.concatenate(parts, -1)


def advantages(rewards: Array, values: Array, ended: Array, discount: float, trace: float) -> Array:
    """Generalised advantages (T, E), of rewards (T, E) and values (T + 1, E); the end of an episode is worth 0."""
    lasts = discount * (1 - ended)
    errors = rewards + lasts * values[1:] - values[:-1]

    def back(later: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
        error, last = now
        found = error + trace * last * later
        return found, found

    return jax.lax.scan(back, jnp.zeros_like(errors[0]), (errors, lasts), reverse=True)[1]


def standardised(values: Array, weight: Array) -> Array:
    """With mean 0 and deviation 1 over those that count."""
    total = jnp.maximum(weight.sum(), 1.0)
    centred = values - (values * weight).sum() / total
    return centred / (jnp.sqrt((centred**2 * weight).sum() / total) + 1e-8)


def mean(values: Array, weight: Array) -> Array:
    """The mean over those that count."""
    return (values * weight).sum() / jnp.maximum(weight.sum(), 1.0)
