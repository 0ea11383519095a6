"""Observations and actions of the JAX program as Gymnasium lays them out, lanes last."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from taskspec.lang.types import Kind
from taskspec.task.segments import Segment
from taskspec.task.spaces import SpaceLayout

Array = Any
DTYPES: dict[Kind, Any] = {Kind.BOOL: jnp.bool_, Kind.INT: jnp.int32, Kind.REAL: jnp.float32}


def observed(layout: SpaceLayout, seen: Sequence[Array]) -> Any:
    """Components (*shape, N) as one array (*shape, N), float32 or int32; a dict for dict spaces."""
    rows: list[list[Array]] = [[] for _ in layout.parts]
    for segment in layout.segments:
        dtype = jnp.int32 if layout.parts[segment.part].is_whole else jnp.float32
        rows[segment.part].append(_numbers(segment, seen[segment.component]).astype(dtype))
    lanes = seen[0].shape[-1]
    made = [jnp.concatenate(r).reshape(*p.shape, lanes) for p, r in zip(layout.parts, rows, strict=True)]
    return {p.name: a for p, a in zip(layout.parts, made, strict=True)} if layout.is_dict else made[0]


def _numbers(segment: Segment, value: Array) -> Array:
    """The rows of a segment, (size, N)."""
    flat = value.reshape(-1, value.shape[-1])
    if segment.values is not None:
        return flat[segment.element][None].astype(jnp.int32) == jnp.array(segment.values)[:, None]
    return flat.astype(jnp.int32) - jnp.array(segment.starts, jnp.int32)[:, None] if segment.starts else flat


def acted(layout: SpaceLayout, action: Array) -> tuple[Array, ...]:
    """An action (*shape, N) as Gymnasium gives it, as components (*shape, N)."""
    parts, given = [], jnp.asarray(action)
    given = given.reshape(-1, given.shape[-1])
    for c, segment in zip(layout.components, layout.segments, strict=True):
        rows = given[segment.first : segment.first + segment.size]
        if segment.starts:
            rows = rows.astype(jnp.int32) + jnp.array(segment.starts, jnp.int32)[:, None]
        elif c.type.kind is not Kind.REAL and not layout.parts[segment.part].is_whole:
            rows = jnp.rint(rows)
        parts.append(rows.astype(DTYPES[c.type.kind]).reshape(*c.type.shape, rows.shape[-1]))
    return tuple(parts)
