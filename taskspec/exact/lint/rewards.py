"""Rewards that tell no policy from another."""

from __future__ import annotations

import numpy as np

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import SAME, Linted
from taskspec.exact.model.space import words

LONGER = 1000


def rewards(case: Linted, collector: Collector) -> None:
    """W502 and W503: rewards that are always the same."""
    if not case.is_constant or case.paid is None:
        return
    value = words(case.paid[0])
    later = _later_reward(case, case.paid[0])
    if later is None:
        collector.add("W503", case.merged.span(("reward",)), f"every possible step has reward {value}")
        return
    message = f"within {case.task.horizon} steps every reward is {value}; longer episodes have others"
    hint = f"the first of them is paid in step {later}"
    collector.add("W502", case.merged.span(("horizon",)), message, hint)


def _later_reward(case: Linted, before: float) -> int | None:
    """The first step in which a longer episode could be paid otherwise than before."""
    model = case.results.model
    if model is None or model.horizon is None or model.is_timed:
        return None
    level, seen = model.start > 0, np.zeros(model.n_states, np.bool_)
    paid = model.step(0).reward.reshape(model.n_actions, -1)
    for t in range(model.horizon + LONGER):
        if not (level & ~seen).any():
            return None
        if np.ptp(np.append(paid[:, level].reshape(-1), before)) > SAME:
            return t + 1
        seen |= level
        level = model.successors(model.step(0).going, level)
    return None


def indifferent(case: Linted, collector: Collector) -> None:
    """W504: the best return is that of random actions."""
    if case.is_constant or (optimal := case.results.optimal) is None or (random := case.results.random) is None:
        return  # random actions are simulated only where the best return is known
    if abs(optimal.value - random.value) <= SAME * max(1.0, abs(optimal.value)):
        message = f"random actions are as good as the best: both return {words(optimal.value)}"
        collector.add("W504", case.merged.span(("reward",)), message)
