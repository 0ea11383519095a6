"""How long episodes take: expectations of steps, as returns of the same model paid for them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from taskspec.exact.model.model import Model, Step
from taskspec.exact.planning.certified.components import leading_to
from taskspec.exact.planning.certified.endless import Endless
from taskspec.exact.planning.plans import Plan, optimal_plan
from taskspec.exact.planning.solve import policy_return

Array = np.ndarray[Any, Any]


def mean_length(model: Model, plan: Plan) -> float:
    """The expected number of steps of an episode under a policy."""
    if model.horizon is not None and all(step.ending is None for step in model.steps):
        return model.horizon
    steps = {id(step): _paid(step, np.ones_like(step.reward)) for step in model.steps}
    return policy_return(undiscounted(model, tuple(steps[id(step)] for step in model.steps)), plan)


def _paid(step: Step, reward: Array) -> Step:
    return replace(step, reward=reward, scale=1.0, spread=None, least=1.0)


def undiscounted(model: Model, steps: tuple[Step, ...]) -> Model:
    """The model with other steps, without a discount."""
    return replace(model, task=replace(model.task, discount=1.0), steps=steps)


def solution_length(model: Model) -> float:
    """The least expected number of steps by which a policy of optimal return comes to where nothing is left to earn or lose."""
    plan = optimal_plan(model)
    if model.horizon is None:
        return _endless_solution(model, plan(0) > 0)
    shape = (model.n_actions, model.n_states)
    length, busy = np.zeros(model.n_states), np.zeros(model.n_states, np.bool_)
    for t in range(model.horizon - 1, -1, -1):
        going = model.step(t).going
        busy = _pays(model.step(t), shape) | ((going @ busy.astype(np.float64)).reshape(shape) > 0).any(axis=0)
        later = np.where(plan(t) > 0, (going @ length).reshape(shape), np.inf).min(axis=0)
        length = np.where(busy, 1 + later, 0.0)
    return float(model.start @ length)


def _pays(step: Step, shape: tuple[int, int]) -> Array:
    """States (S,) in which some action may be paid other than 0."""
    size = np.abs(step.reward) if step.spread is None else step.spread
    return np.asarray((size.reshape(shape) > 0).any(axis=0))


def _endless_solution(model: Model, best: Array) -> float:
    """Without a horizon: the shortest way on the same model with actions that are not best replaced by one that is."""
    step, shape = model.step(0), best.shape
    busy = leading_to(step.going, _pays(step, shape))
    action = np.where(best, np.arange(model.n_actions)[:, None], best.argmax(axis=0))
    rows = (action * model.n_states + np.arange(model.n_states)).reshape(-1)
    ending = None if step.ending is None else step.ending[rows]
    reward = np.where(np.tile(busy, model.n_actions), -1.0, 0.0)
    kept = replace(_paid(step, reward), going=step.going[rows], ending=ending, escaping=None, slots=None)
    return -Endless(undiscounted(model, (kept,))).best().value
