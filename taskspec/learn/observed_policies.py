"""Policies of observations, as learners give them (tables, networks, functions, objects with `predict`), and their returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import misused
from taskspec.exact.policies.adapters import ObservationFunction, Predictor, ProbabilisticPolicy
from taskspec.exact.policies.networks import is_network, outputs_of
from taskspec.exact.policies.policy import greedy, legal_rows, states_of
from taskspec.exact.policies.values import are_probabilities, by_row, is_table, table_value, value_of
from taskspec.exact.rollout.rollout import Rollout
from taskspec.exact.scores.returns import Results, Return
from taskspec.language.task.legal import restricted
from taskspec.language.task.task import Task


@dataclass(frozen=True, slots=True)
class ObservedValue:
    """The expected returns of a policy of observations: with its most likely actions, and with those that it draws."""

    deterministic: Return
    stochastic: Return


Probabilities = Callable[[Any], Array]
"""From observations (N, *shape) to the probabilities, or values, of actions (N, A)."""


def observed_value(results: Results, policy: Any, seed: int) -> ObservedValue:
    """Return the expected returns of a policy of observations: exact if the task has a model on which it can be tabulated.

    Args:
        results: of the task.
        policy: an object with `predict` (and maybe `probabilities`), a function of the observation, a table (see `_of_table`), or
            a network of PyTorch: from observations (N, *shape) to actions of a box, or else to probabilities or values (N, A), as
            in a table.
        seed: of what it draws.
    """
    if is_table(policy):
        return _of_table(results, np.asarray(policy), seed)
    if is_network(policy):
        return _of_network(results, policy, seed)
    probabilities = observed_probabilities(policy, results.task)
    if probabilities is not None:
        return _of_rows(results, probabilities, seed)
    if hasattr(policy, "predict"):
        predictor = Predictor(results.task, policy, deterministic=True)
        best = value_of(results, predictor).value
        if "deterministic" not in predictor.takes:
            return ObservedValue(best, best)
        return ObservedValue(best, value_of(results, Predictor(results.task, policy, deterministic=False)).value)
    if not callable(policy):
        hint = "a table, a function of the observation, an object with `predict`"
        misused(f"{type(policy).__name__} is not a policy", hint)
    value = value_of(results, ObservationFunction(results.task, policy, name="", seed=seed)).value
    return ObservedValue(value, value)


def _of_network(results: Results, network: Any, seed: int) -> ObservedValue:
    task = results.task
    outputs = outputs_of(network)
    if task.action_layout.form == "box":
        value = value_of(results, Predictor(task, SimpleNamespace(predict=outputs))).value
        return ObservedValue(value, value)
    start = Predictor(task, None).observe(Rollout(task, 1).start(), 0, np.random.default_rng(0))
    return _of_rows(results, outputs, seed, are_probabilities(outputs(start)))


def observed_probabilities(policy: Any, task: Task) -> Probabilities | None:
    """Return the probabilities that a policy gives of finite actions; None where it gives none."""
    if task.action_layout.form == "box":
        return None
    predictor = Predictor(task, policy)
    if not predictor.gives_probabilities:
        if not hasattr(policy, "predict"):
            return None
        start = predictor.observe(Rollout(task, 1).start(), 0, np.random.default_rng(0))
        if predictor.probabilities(start) is None:
            return None
    return lambda observations: np.asarray(predictor.probabilities(observations), np.float64)


def _of_rows(results: Results, rows: Probabilities, seed: int, is_stochastic: bool = True) -> ObservedValue:
    """Return the values of the greedy policy of some rows (N, A), and of the stochastic one, if they are probabilities."""
    best = ProbabilisticPolicy(results.task, rows, seed, is_greedy=True)
    drawn = ProbabilisticPolicy(results.task, rows, seed, is_greedy=not is_stochastic)
    return ObservedValue(value_of(results, best).value, value_of(results, drawn).value)


def _of_table(results: Results, table: Array, seed: int) -> ObservedValue:
    """Return the values of a table over observations that are one number.

    The table has actions (O,) or (T, O), or probabilities or values (O, A) or (T, O, A). A table of values, whose rows are not
    probabilities, is a greedy policy.
    """
    seen = results.task.observation_layout
    actions = results.task.action_layout
    if seen.form != "discrete" or actions.form not in ("discrete", "multi_discrete"):
        misused(f"a table is a policy where observations are one number and actions finite, not on {results.task.id}")
    first = actions.starts[0] if actions.form == "discrete" else 0
    table = by_row(table, seen.counts[0], int(np.prod(actions.counts)), first)
    is_stochastic = are_probabilities(table)
    if table.ndim == 3:
        best = _timed_value(results, table, is_greedy=True)
        return ObservedValue(best, _timed_value(results, table, is_greedy=not is_stochastic))
    start = seen.starts[0]
    return _of_rows(results, lambda seen: table[np.asarray(seen) - start], seed, is_stochastic)


def observation_rows(task: Task, policy: Any) -> Array | None:
    """Return the probabilities (O, A) of a policy of discrete observations and actions; None where it gives none."""
    seen = task.observation_layout
    actions = task.action_layout
    if is_table(policy):
        table = by_row(np.asarray(policy), seen.counts[0], actions.counts[0], actions.starts[0])
        if table.ndim == 3:
            return None
        if are_probabilities(table):
            return table
        return greedy(table)
    observations = np.arange(seen.counts[0]) + seen.starts[0]
    if is_network(policy):
        return observation_rows(task, outputs_of(policy)(observations))
    probabilities = observed_probabilities(policy, task)
    if probabilities is None:
        return None
    return probabilities(observations)


def _timed_value(results: Results, table: Array, is_greedy: bool) -> Return:
    """Return the value of a table (T, O, A) of probabilities, or of values of a greedy policy, on the exact model.

    Its states and observations have to be one to one.
    """
    model = results.model
    policy = Predictor(results.task, None)
    if model is None or model.task is not results.task or policy.is_noisy or policy.sees_time:
        misused(f"a table over the time is a policy where observations show the state, not on {results.task.id}")
    observations = policy.observe(states_of(model), 0, np.random.default_rng(0)) - policy.layout.starts[0]
    rows = table[:, observations].astype(np.float64)
    legal = legal_rows(results.task, states_of(model))
    if is_greedy:
        rows = greedy(rows, legal)
    elif legal is not None:
        rows = restricted(rows, legal)
    return table_value(results, rows).value
