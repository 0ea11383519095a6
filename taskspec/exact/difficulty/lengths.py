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
from taskspec.solve.backward import action_values, backward, first_values

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

    def backup(t: int, value: Array) -> Array:
        """Return (A, S, 2): more than 0 where something may be paid from now on, and the steps from now on."""
        step = model.step(t)
        reward = np.stack([_pays(step, shape), np.ones(shape)], axis=-1)
        return action_values(step.going, reward, 1.0, value)

    def choose(t: int, q: Array) -> Array:
        is_busy = (q[..., 0] > 0).any(axis=0)
        length = np.where(plan(t) > 0, q[..., 1], np.inf).min(axis=0)
        return np.stack([is_busy, np.where(is_busy, length, 0.0)], axis=-1)

    length = first_values(backward(backup, choose, np.zeros((model.n_states, 2)), model.horizon))[:, 1]
    return float(model.start @ length)


def _pays(step: Step, shape: tuple[int, int]) -> Array:
    """Return 1 for actions in states (A, S) that may be paid other than 0, else 0."""
    size = np.abs(step.reward) if step.spread is None else step.spread
    return (size.reshape(shape) > 0).astype(np.float64)


def _endless_solution(model: Model, best: Array) -> float:
    """Without a horizon: the shortest way on the same model with actions that are not best replaced by one that is."""
    step, shape = model.step(0), best.shape
    busy = leading_to(step.going, np.asarray(_pays(step, shape).any(axis=0)))
    action = np.where(best, np.arange(model.n_actions)[:, None], best.argmax(axis=0))
    rows = (action * model.n_states + np.arange(model.n_states)).reshape(-1)
    ending = None if step.ending is None else step.ending[rows]
    reward = np.where(np.tile(busy, model.n_actions), -1.0, 0.0)
    kept = replace(_paid(step, reward), going=step.going[rows], ending=ending, escaping=None, slots=None)
    return -Endless(undiscounted(model, (kept,))).best().value
