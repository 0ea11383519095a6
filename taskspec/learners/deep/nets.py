"""Small fully connected nets: pairs of weights (inputs, outputs) and biases (outputs,), one for each layer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp

Array = Any
Net = tuple[tuple[Array, Array], ...]
Weights = Callable[[Array, int, int, bool], Array]
"""A matrix of a key, of how many inputs and outputs, and whether it is the last."""
_FUNCTIONS = {"relu": jax.nn.relu, "tanh": jnp.tanh}


def orthogonal(last: float) -> Weights:
    """Orthogonal matrices, times the square root of 2, the last one times `last`."""

    def made(key: Array, inputs: int, outputs: int, is_last: bool) -> Array:
        return jax.nn.initializers.orthogonal(last if is_last else 2**0.5)(key, (inputs, outputs), jnp.float32)

    return made


def xavier(key: Array, inputs: int, outputs: int, is_last: bool) -> Array:
    """Uniform numbers, whose variance suits both directions."""
    return jax.nn.initializers.glorot_uniform()(key, (inputs, outputs), jnp.float32)


def net(key: Array, inputs: int, hidden: Sequence[int], outputs: int, weights: Weights = xavier) -> Net:
    """A net with biases of 0."""
    sizes = (inputs, *hidden, outputs)
    keys = jax.random.split(key, len(sizes) - 1)
    layers = list(zip(keys, sizes, sizes[1:], strict=False))
    return tuple(
        (weights(k, a, b, i == len(layers) - 1), jnp.zeros(b, jnp.float32)) for i, (k, a, b) in enumerate(layers)
    )


def says(layers: Net, x: Array, activation: str = "tanh") -> Array:
    """What a net says of inputs (..., inputs): (..., outputs)."""
    *inner, (w, b) = layers
    for u, c in inner:
        x = _FUNCTIONS[activation](x @ u + c)
    return x @ w + b
