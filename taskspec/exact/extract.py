"""Task -> model: every state, action and outcome enumerated by the array form of the task, in chunks."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exact.failure import refuse, scipy_sparse
from taskspec.exact.model import Model, Step
from taskspec.exact.outcomes import count
from taskspec.exact.reach import visits
from taskspec.exact.rows import Sink, all_rows
from taskspec.exact.transitions import MAX_OUTCOMES, Steps
from taskspec.lang.ir import draws
from taskspec.spec.task import Task

Array = np.ndarray[Any, Any]
MAX_ENTRIES = 50_000_000
"""Non-zeros that a model may have: 12 bytes each, so 600 MB."""
WHOLE = 4_000_000
SWEEP = 200
"""How often all non-zeros of the largest model may be gone through: a sweep for each step of an episode."""
LOST = 1e-9
"""How much of the start may be missing for rounding."""
OVERHEAD = 20_000
"""What a sweep costs whatever the size of the model, as non-zeros."""


def extract(task: Task, reachable: bool | None = None, limit: int = MAX_ENTRIES) -> Model:
    """The exact model of a finite task.

    Args:
        reachable: only states that episodes enter (True), or all declared ones (False); None takes
            all where that is cheap.
        limit: how many non-zeros the matrices may have; checked before memory is spent.

    Raises:
        SpecError: (E712) when the task is not finite or too large; (E705) without scipy.
    """
    scipy_sparse()
    steps = Steps(task)
    _check_finite(steps)
    per_state = steps.actions.size * steps.branching
    times = task.horizon or 1 if steps.uses_time else 1
    if reachable is None:
        reachable = steps.states.size > WHOLE or steps.states.size * per_state * times > limit
    codes = _reachable(steps, int(limit // max(1, per_state * times))) if reachable else np.arange(steps.states.size)
    size = len(codes) * per_state * times
    if size > limit:
        refuse(
            f"the exact model would have up to {size:,.0f} entries; the limit is {limit:,}", "choose smaller parameters"
        )
    if (task.horizon or 1) * (size / times + OVERHEAD) > SWEEP * limit:
        refuse(f"an episode of {task.horizon:,} steps is too long to plan", "choose a smaller horizon, or `none`")
    start = np.zeros(len(codes))
    first, weight = steps.starts()
    start[np.searchsorted(codes, first)] = weight
    model = Model(task, steps.states, steps.actions, codes, start, _steps(steps, codes, times))
    _check_inside(model)
    _check_rewards(model)
    return model


def _check_inside(model: Model) -> None:
    """Refuse a model in which an episode can start outside the state space, or leave it."""
    if model.start.sum() < 1 - LOST:
        refuse("an episode can start outside the state space")
    for t, step in enumerate(model.steps):
        if step.escaping is None:
            continue
        wrong = step.escaping.reshape(model.n_actions, model.n_states) & model.acting
        if wrong.any():
            action, state = (int(i[0]) for i in np.nonzero(wrong))
            when = f" at t = {t}" if model.is_timed else ""
            place = f"{model.state_name(state)} with {model.action_name(action)}{when}"
            refuse(f"the next state is outside the state space, from {place}")


def _check_rewards(model: Model) -> None:
    """Refuse a model in which an episode can be paid what is no number; where no episode acts, nothing is paid."""
    for t, step in enumerate(model.steps):
        wrong = ~np.isfinite(step.reward.reshape(model.n_actions, model.n_states))
        if not wrong.any():
            continue
        if (wrong & model.acting).any():
            action, state = (int(i[0]) for i in np.nonzero(wrong & model.acting))
            when = f" at t = {t}" if model.is_timed else ""
            refuse(f"the reward is not finite, from {model.state_name(state)} with {model.action_name(action)}{when}")
        step.reward[wrong.reshape(-1)] = 0.0


def _check_finite(steps: Steps) -> None:
    task = steps.task
    for c in (*task.state, *task.action):
        if not c.is_finite:
            refuse(f"'{c.name}' has infinitely many values", "give it bounds, or the spec an `abstraction`")
    if steps.branching > MAX_OUTCOMES:
        found = next((d for d in steps.draws if count([d], {}) == float("inf")), None)
        if found is not None:
            refuse(f"a step draws from a {found.base} distribution, which has infinitely many outcomes")
        refuse(f"a step has up to {steps.branching:,.0f} outcomes; the limit is {MAX_OUTCOMES:,}")
    if count(draws(task.initial), {}) > MAX_OUTCOMES:
        refuse("the start has too many outcomes to enumerate")
    if steps.uses_time and task.horizon is None:
        refuse("dynamics or rewards depend on the time, and there is no horizon")
    if steps.states.size > 2**62 or steps.actions.size > 10_000_000:
        refuse(f"there are {steps.states.size:,} states and {steps.actions.size:,} actions")


def _reachable(steps: Steps, most: int) -> Array:
    """Codes of the states that episodes enter; refused as soon as there are more than a model could hold."""
    return visits(steps, max(1, most)).entered


def _steps(steps: Steps, codes: Array, times: int) -> tuple[Step, ...]:
    found: list[Step] = []
    for t in range(times):
        step = _step(steps, codes, t)
        found.append(found[-1] if found and found[-1].same(step) else step)
    if all(step is found[0] for step in found):
        return (found[0],)
    return tuple(found)


def _step(steps: Steps, codes: Array, t: int) -> Step:
    rows = len(codes) * steps.actions.size
    sink = Sink(rows, int(rows * steps.branching))
    for some in all_rows(steps, codes, t):
        sink.add(some)
    return sink.step(len(codes))
