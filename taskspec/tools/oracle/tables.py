"""Policies and observations as tables over the states of an exact model, in floats or in rationals.

Shapes: T times (1 without a horizon), S states, A actions, O observations.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from taskspec.base.arrays import Array, map_parts
from taskspec.base.display import plural
from taskspec.exact.model.extract import extract, lasting
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.model.probabilities import Reader
from taskspec.exact.policies import python_files as files
from taskspec.exact.policies.adapters import Predictor, Varies, parameters, policy_of
from taskspec.exact.policies.networks import evaluating, is_network
from taskspec.exact.policies.policy import Tabulated, TaskPolicy, observation_of
from taskspec.exact.policies.state_observations import StateObservations, times
from taskspec.exact.policies.values import LAST_AXIS, is_table
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike

LARGEST = 2**24
"""The number of entries of a table (T, S, A)."""


def model_of(task: TaskLike) -> Model:
    """Return the exact model of a task; refuse (E712) one whose tables over time would not fit in memory."""
    model = lasting(extract(load(task)))
    if times(model) * model.n_states * model.n_actions > LARGEST:
        refuse(f"tables of {model.task.id} over time, states and actions would take gigabytes")
    return model


def policy_table(model: Model, policy: Any, exact: bool) -> Array:
    """Return the probabilities (T, S, A) of a policy's actions.

    Args:
        model: an exact model.
        policy: as `oracle.evaluate` takes it.
        exact: as rationals in an object array; else as float64.

    Raises:
        SpecError: E712 for a policy without a table, E713 for anything that is not a policy, or has no rational probabilities.
    """
    if is_table(policy):
        table = _of_table(model, np.asarray(policy))
    else:
        table = _of_policy(model, policy)
    shape = (times(model), model.n_states, model.n_actions)
    if exact:
        table = _rational(table)
    else:
        table = table.astype(np.float64)
    is_right = (table >= 0).all() and np.allclose(table.sum(axis=-1).astype(np.float64), 1)
    if not is_right:
        misused("the probabilities of the actions in a state are at least 0, and sum to 1", LAST_AXIS)
    return np.broadcast_to(table, shape)


def _rational(table: Array) -> Array:
    """Return a table as rationals: those that are given, and the short fractions near floats."""
    read = Reader(as_written=True)
    values, numbers = np.unique(table, return_inverse=True)
    fractions = np.array(list(map(read, values.tolist())), dtype=object)[numbers.reshape(table.shape)]
    if (fractions.sum(axis=-1) != 1).any():
        misused(
            "these probabilities are no short fractions that sum to 1", "give them as fractions, or take `exact=False`"
        )
    return fractions


# -- tables -----------------------------------------------------------------------------------------------------------


def _of_table(model: Model, table: Array) -> Array:
    seen = StateObservations(model)
    by_state = _probabilities(table, model.n_states, model.n_actions)
    by_observation = None
    if seen.is_known and model.task.observation_layout.form == "discrete":
        by_observation = _probabilities(table, seen.count, model.n_actions)
    if by_observation is None and by_state is not None:
        _check_times(model, by_state)
        return by_state
    if by_observation is None:
        forms = f"({model.n_states},) for actions, ({model.n_states}, {model.n_actions}) for their probabilities"
        misused(f"a table has shape {forms}; maybe with the time in front; not {table.shape}", LAST_AXIS)
    if by_state is not None and (seen.rows != np.arange(model.n_states)).any():
        hint = "a function of the observation, `lambda observation: table[observation]`"
        misused("the rows of this table may be states or observations, which are numbered differently", hint)
    _check_times(model, by_observation)
    last = len(by_observation) - 1
    return np.stack([by_observation[min(t, last), rows] for t, rows in enumerate(seen.rows)])


def _probabilities(table: Array, rows: int, actions: int) -> Array | None:
    """Return a table of actions or probabilities as one of (1 or T, rows, A); None where its shape is another one."""
    is_choice = table.dtype.kind in "iu" and table.shape[-1:] == (rows,) and table.shape[-2:] != (rows, actions)
    if is_choice:
        if not ((table >= 0) & (table < actions)).all():
            misused(f"an action of the table is not in 0 to {actions - 1}")
        table = np.eye(actions)[table]
    if table.shape[-2:] != (rows, actions) or table.ndim not in (2, 3):
        return None
    return table.reshape(-1, rows, actions)


def _check_times(model: Model, table: Array) -> None:
    if len(table) not in (1, times(model)):
        message = f"a table over time has {plural(times(model), 'time')} on {model.task.id}, not {len(table)}"
        misused(message, "leave the axis out where the time does not matter")


# -- policies ---------------------------------------------------------------------------------------------------------


def _of_policy(model: Model, policy: Any) -> Array:
    """Return the probabilities (1 or T, S, A) of a name, a function, a module of PyTorch, or an object with `predict`."""
    seen = StateObservations(model)
    if is_network(policy):
        return np.stack([_of_module(policy, seen.at(t)) for t in seen.times])
    if callable(policy) and not hasattr(policy, "predict"):
        rows = _of_function(model, seen, policy)
        if rows is not None:
            return rows
    tabulated = _tabulated(model, _acting(model.task, policy))
    if tabulated is None and not seen.is_known:
        refuse(f"observations of {model.task.id} are drawn: a policy of observations has no table over its states")
    if tabulated is None:
        message = "the policy has no table: it remembers, or its actions vary"
        refuse(message, "a function from the observation to probabilities of actions")
    return np.stack([tabulated.plan(t).T for t in range(times(model))])


def _acting(task: Task, policy: Any) -> TaskPolicy:
    if isinstance(policy, TaskPolicy):
        return policy
    if hasattr(policy, "predict"):
        return Predictor(task, policy)
    return policy_of(task, policy)


def _tabulated(model: Model, policy: TaskPolicy) -> Tabulated | None:
    if policy.task is not model.task:
        refuse(f"the policy '{policy.name}' remembers: it has no table over the states of {model.task.id}")
    try:
        return policy.tabulate(model)
    except Varies:
        return None


def _of_function(model: Model, seen: StateObservations, function: Callable[[Any], Any]) -> Array | None:
    """Probabilities (1 or T, S, A) that a function of one observation gives; None where it gives actions."""
    if not seen.is_known or "rng" in parameters(function):
        return None
    first = _answer(function, seen.at(0), 0)
    if first.shape != (model.n_actions,) or model.task.action_layout.form != "discrete":
        return None
    rows = []
    for t in seen.times:
        for s in range(model.n_states):
            rows.append(_answer(function, seen.at(t), s))
    return np.stack(rows).reshape(-1, model.n_states, model.n_actions)


def _answer(function: Callable[[Any], Any], observations: Any, lane: int) -> Array:
    return plain(function(observation_of(observations, lane)))


def _of_module(module: Any, observations: Any) -> Array:
    with evaluating(module) as torch:
        answer = module(map_parts(torch.as_tensor, observations))
        if not hasattr(answer, "probs"):
            answer = torch.distributions.Categorical(logits=answer.double())
        return plain(answer.probs.double())


def plain(values: Any) -> Array:
    """Return values as an array of NumPy: of numbers, lists, arrays of JAX, and tensors with or without a gradient."""
    return np.asarray(files.plain(values))
