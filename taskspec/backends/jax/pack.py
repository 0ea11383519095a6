"""Observations and actions of the JAX program as Gymnasium lays them out, lanes last."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from taskspec.lang.types import Kind
from taskspec.task.spaces import SpaceLayout

Array = Any


def observed(layout: SpaceLayout, seen: Sequence[Array]) -> Any:
    """Components (*shape, N) as one array (*shape, N), float32 or int32; a dict for dict spaces."""
    match layout.form:
        case "discrete":
            return jnp.asarray(seen[0], jnp.int32)
        case "dict":
            return {
                c.name: _entry(c.is_finite and c.type.is_scalar, v)
                for c, v in zip(layout.components, seen, strict=True)
            }
        case "one_hot":
            places = zip(_rows(seen), layout.starts, layout.counts, strict=True)
            hot = [(row[None] == jnp.arange(start, start + n)[:, None]).astype(jnp.float32) for row, start, n in places]
            return jnp.concatenate(hot)
        case "multi_discrete":
            starts = jnp.array(layout.starts, jnp.int32)[:, None]
            return jnp.stack(_rows(seen)).astype(jnp.int32) - starts
        case "box":
            rows = [v.reshape(-1, v.shape[-1]).astype(jnp.float32) for v in seen]
            return jnp.concatenate(rows).reshape(*layout.shape, -1)


def _entry(finite: bool, value: Array) -> Array:
    return value.astype(jnp.int32 if finite else jnp.float32)


def _rows(seen: Sequence[Array]) -> list[Array]:
    return [row.astype(jnp.int32) for v in seen for row in v.reshape(-1, v.shape[-1])]


def acted(layout: SpaceLayout, action: Array) -> tuple[Array, ...]:
    """An action (*shape, N) as Gymnasium gives it, as components (*shape, N)."""
    if layout.form == "discrete":
        (c,) = layout.components
        return (action != 0,) if c.type.kind is Kind.BOOL else (jnp.asarray(action, jnp.int32),)
    flat = jnp.asarray(action).reshape(-1, action.shape[-1])
    if layout.form == "multi_discrete":
        flat = flat.astype(jnp.int32) + jnp.array(layout.starts, jnp.int32)[:, None]
    parts, offset = [], 0
    for c in layout.components:
        rows = flat[offset : offset + c.type.size]
        if layout.form == "box" and c.type.kind is not Kind.REAL:
            rows = jnp.rint(rows)
        dtype = {Kind.BOOL: jnp.bool_, Kind.INT: jnp.int32, Kind.REAL: jnp.float32}[c.type.kind]
        parts.append(rows.astype(dtype).reshape(*c.type.shape, rows.shape[-1]))
        offset += c.type.size
    return tuple(parts)
