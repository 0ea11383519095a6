"""The exact model of a finite decision process that is given by its outcomes, and not by a spec."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from taskspec.base.arrays import Array
from taskspec.model.model import Model, RoundingTerms, Step, scipy_sparse
from taskspec.model.transitions import Steps
from taskspec.source import read_text
from taskspec.task.build import build

SPEC = """\
taskspec: 1
name: Tabulated
state: {{s: {{type: int, low: 0, high: {last_state}}}}}
action: {{a: {{type: int, low: 0, high: {last_action}}}}}
horizon: {horizon}
discount: {discount!r}
initial: {{s: 0}}
dynamics: {{s': s}}
reward: 0
"""
"""What gives names to the states and actions."""
TableOutcome = tuple[int, int, int, float, float, bool]
"""A state, an action, the next state, its probability, the reward, and whether the episode ends there."""


def tabulated(
    outcomes: Iterable[TableOutcome], start: Array, actions: int, horizon: int | None, discount: float = 1.0,
    legal: Array | None = None,
) -> Model:  # fmt: skip
    """Return the model of some outcomes; states in which no episode acts need none.

    Args:
        outcomes: of each state and action.
        start: float64 (S,), the probabilities of first states.
        actions: their number.
        horizon: of episodes.
        discount: of rewards.
        legal: bool (A, S), the legal actions; None where all are.
    """
    n = len(start)
    s, a, to, p, reward, ends = map(np.array, zip(*outcomes, strict=True))
    row = (a * n + s).astype(np.int32)
    shape = (actions * n, n)
    matrices = []
    for kept in (~ends, ends):
        entries = (p[kept], (row[kept], to[kept].astype(np.int32)))
        matrices.append(scipy_sparse().csr_array(entries, shape=shape))
    rounding = RoundingTerms(int(np.bincount(row).max()), min(0.0, reward.min()), max(0.0, reward.max()))
    step = Step(matrices[0], matrices[1], np.bincount(row, p * reward, shape[0]), rounding)
    numbers = {"last_state": n - 1, "last_action": actions - 1, "horizon": horizon or "none", "discount": discount}
    task = build(read_text(SPEC.format(**numbers), "tabulated.yaml"))
    steps = Steps(task)
    return Model(task, steps.states, steps.actions, np.arange(n), start, (step,), legal)
