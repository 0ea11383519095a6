"""Training: all seeds of a block at once, in chunks of rounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.learners.case import LearnerCase
from taskspec.progress import tell

Array = Any
CHUNKS = 10
"""How often it is told how far training is, and a point of the learning curve is shown; the last, shorter one is one more."""


@dataclass(frozen=True)
class Schedule:
    """How long it is trained.

    Attributes:
        rounds: of training.
        steps: of the environment that a round is counted as.
        comparisons: that are made in a round.
        shown: the policies, one for each seed, of the state of all seeds: a point of the learning curve.
    """

    rounds: int
    steps: int
    comparisons: int = 0
    shown: Callable[[Any], list[Any]] | None = None


def trained(
    case: LearnerCase,
    init: Callable[[Array], Any],
    advance: Callable[[Any, Array, Any], Any],
    plan: Schedule,
    shared: Any = (),
) -> Any:
    """The state of every seed in the end, seeds first.

    Args:
        init: the first state of a seed, of its key.
        advance: the state after a round, of the state, the round's key, and what is `shared`.
        shared: arrays that all seeds read.
    """

    def chunk(state: Any, keys: Array, numbers: Array, shared: Any) -> Any:
        def one(state: Any, key: Array) -> Any:
            body = lambda s, n: (advance(s, jax.random.fold_in(key, n), shared), None)  # noqa: E731
            return jax.lax.scan(body, state, numbers)[0]

        return jax.vmap(one)(state, keys)

    keys = jax.vmap(jax.random.key)(jnp.array(np.array(case.seeds, np.uint64).astype(np.uint32)))
    halves = jax.vmap(jax.random.split)(keys)
    state = jax.jit(jax.vmap(init))(halves[:, 0])
    run, size = jax.jit(chunk, donate_argnums=0), max(1, plan.rounds // CHUNKS)
    for first in range(0, plan.rounds, size):
        tell(f"{case.task.name}: round {first:,} of {plan.rounds:,}, {len(case.seeds)} seeds")
        numbers = np.arange(first, min(first + size, plan.rounds))
        state = run(state, halves[:, 1], numbers, shared)
        case.count(plan.steps * len(numbers), plan.comparisons * len(numbers))
        if plan.shown is not None and numbers[-1] + 1 < plan.rounds:
            case.show(*plan.shown(state))
    return state


def of_seed(state: Any, i: int) -> Any:
    """The part of a state that belongs to one seed, as NumPy arrays."""
    return jax.tree.map(lambda x: np.asarray(x[i]), state)
