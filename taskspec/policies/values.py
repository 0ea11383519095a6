"""Expected returns of policies: tables, functions, experts, and objects with `predict`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.model.model import Model, misused, refuse
from taskspec.policies.adapters import (
    ObservationFunction,
    ObservationPolicy,
    Predictor,
    ProbabilisticPolicy,
    StateFunction,
    Varies,
    normaliser,
)  # fmt: skip
from taskspec.policies.experts import Expert
from taskspec.policies.policy import Asking, EpisodeBatch, TaskPolicy, greedy, planned, states_of
from taskspec.rollout.rollout import Rollout, State
from taskspec.scores.returns import Results, Return
from taskspec.solve import solve
from taskspec.solve.backward import Plan
from taskspec.solve.plans import stationary, timed
from taskspec.task.task import Task


@dataclass(frozen=True, slots=True)
class PolicyValue:
    """The expected return of a policy, and what it rests on."""

    value: Return
    asked: Asking


def policy_value(results: Results, policy: Any, deterministic: bool | None = None) -> PolicyValue:
    """Return the expected return of a policy: exact if the task has a model on which the policy can be tabulated.

    Args:
        results: of the task; they give the number of simulated episodes, and their seed.
        policy: a table over the states of the exact model (see `plan_of_table`), a function of the states and the time, an
            `Expert`, an object with `predict`, or a `TaskPolicy`.
        deterministic: passed to `predict`.

    Raises:
        SpecError: E706 for actions outside the action space, E712 where an exact model is needed and there is none, E713 for
            anything else.
    """
    if is_table(policy):
        return _table_value(results, np.asarray(policy))
    if isinstance(policy, Expert) and not deterministic:
        return _expert_value(results, policy)
    if isinstance(policy, TaskPolicy):
        return _value(results, policy)
    if hasattr(policy, "predict"):
        return _value(results, Predictor(results.task, policy, deterministic))
    if not callable(policy):
        hint = f"`Expert(task, {policy!r})`" if isinstance(policy, str) and planned(policy) is not None else None
        misused(f"{type(policy).__name__} is not a policy", hint or "a table, a function, or an object with `predict`")
    return _value(results, StateFunction(results.task, policy))


def is_table(policy: Any) -> bool:
    """Return whether a policy is a table: a list or an array."""
    return isinstance(policy, list | tuple) or hasattr(policy, "__array__")


def _value(results: Results, policy: TaskPolicy) -> PolicyValue:
    model = results.model
    if model is not None and model.task is policy.task:
        found = policy.tabulate(model)
        try:
            if found is not None:
                return PolicyValue(Return(solve.policy_return(model, found.plan)), found.asked)
        except Varies:
            pass

    def choose(states: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        if isinstance(policy, ObservationPolicy):
            return policy.choose(policy.batch(states, t, rng))
        return policy.choose(EpisodeBatch.sharing(t, states, None, rng))

    return PolicyValue(results.simulated(choose), "samples")


def _expert_value(results: Results, expert: Expert) -> PolicyValue:
    results = results if expert.given is None else expert.results
    value = results.expert
    if value is None:
        refuse(f"the expert of {expert.task.name} has no return: {results.why_not}")
    return PolicyValue(value, "probabilities" if value.exact else "samples")


# -- tables over the states of an exact model -------------------------------------------------------------------------


def _table_value(results: Results, table: Array) -> PolicyValue:
    model = results.model
    if table.ndim == 1 and table.dtype.kind == "f":
        misused("a list of reals is not a policy", "returns of episodes are given as `score(task, returns=[...])`")
    if model is None:
        refuse(f"a table of actions needs an exact model: {results.why_not}")
    value = Return(solve.policy_return(model, plan_of_table(model, table)))
    return PolicyValue(value, "probabilities" if table.dtype.kind == "f" else "actions")


def plan_of_table(model: Model, table: Array) -> Plan:
    """Return the plan of a table: actions (S,) or (T, S), or probabilities (S, A) or (T, S, A).

    Raises:
        SpecError: E713 for another table.
    """
    a = model.n_actions
    n = model.n_states
    if table.dtype.kind in "iu" and table.shape[-1:] == (n,) and table.ndim <= 2 and table.shape != (n, a):
        if not ((table >= 0) & (table < a)).all():
            misused(f"an action of the table is not in 0 to {a - 1}")
        hot = np.moveaxis(np.eye(a)[table], -1, -2)
        return stationary(hot) if table.ndim == 1 else timed(list(hot))
    if table.shape[-2:] != (n, a) or table.ndim > 3:
        message = f"a table of probabilities has shape ({n}, {a}) or (T, {n}, {a}), not {table.shape}"
        misused(message, _transposed(table, n, a))
    table = table.astype(np.float64)
    if np.isnan(table).any():
        misused("the table of probabilities has NaN in it", "every entry is a probability")
    if not are_probabilities(table):
        is_square_transposed = a == n and np.allclose(table.sum(axis=-2), 1)
        hint = _transposed(table, n, a) if is_square_transposed else None
        misused("the probabilities of the actions in a state are at least 0, and sum to 1", hint)
    by_action = np.moveaxis(table, -1, -2)
    return stationary(by_action) if table.ndim == 2 else timed(list(by_action))


def are_probabilities(table: Array) -> bool:
    """Return whether the rows of a table are probabilities."""
    return bool((table >= 0).all() and np.allclose(table.sum(axis=-1), 1))


def _transposed(table: Array, rows: int, actions: int) -> str | None:
    """Return the hint for a table whose actions come before its states or observations; None for any other."""
    if table.ndim not in (2, 3) or table.shape[-2:] != (actions, rows):
        return None
    way = "table.T" if table.ndim == 2 else "np.moveaxis(table, -1, -2)"
    return f"this table is transposed: actions are its last axis, as in {way}"


# -- policies of observations, greedy and stochastic ------------------------------------------------------------------


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
        policy: an object with `predict` (and maybe `probabilities`), a function of the observation, or a table (see `_of_table`).
        seed: of what it draws.

    Raises:
        SpecError: E706 for actions outside the action space, E713 for anything that is not a policy.
    """
    if is_table(policy):
        return _of_table(results, np.asarray(policy), seed)
    probabilities = observed_probabilities(policy, results.task)
    if probabilities is not None:
        return _of_probabilities(results, probabilities, probabilities, seed)
    if hasattr(policy, "predict"):
        predictor = Predictor(results.task, policy, deterministic=True)
        best = _value(results, predictor).value
        if "deterministic" not in predictor.takes:
            return ObservedValue(best, best)
        return ObservedValue(best, _value(results, Predictor(results.task, policy, deterministic=False)).value)
    if not callable(policy):
        hint = "a table, a function of the observation, an object with `predict`"
        misused(f"{type(policy).__name__} is not a policy", hint)
    value = _value(results, ObservationFunction(results.task, policy, name="", seed=seed)).value
    return ObservedValue(value, value)


def observed_probabilities(policy: Any, task: Task) -> Probabilities | None:
    """Return the probabilities that a policy gives of finite actions; None where it gives none."""
    if task.action_layout.form == "box":
        return None
    if hasattr(policy, "probabilities"):
        normalise = normaliser(policy)
        return lambda observations: np.asarray(policy.probabilities(normalise(observations)), np.float64)
    predictor = Predictor(task, policy)
    if not hasattr(policy, "action_probabilities"):
        if not hasattr(policy, "predict"):
            return None
        start = predictor.observe(Rollout(task, 1).start(), 0, np.random.default_rng(0))
        if predictor.probabilities(start) is None:
            return None
    return lambda observations: np.asarray(predictor.probabilities(observations), np.float64)


def _of_probabilities(results: Results, values: Probabilities, stochastic: Probabilities, seed: int) -> ObservedValue:
    """Return the values of the greedy policy of some values (N, A), and of a stochastic policy."""
    best = ProbabilisticPolicy(results.task, lambda observations: greedy(values(observations)), seed)
    random = ProbabilisticPolicy(results.task, stochastic, seed)
    return ObservedValue(_value(results, best).value, _value(results, random).value)


def _of_table(results: Results, table: Array, seed: int) -> ObservedValue:
    """Return the values of a table over observations that are one number.

    The table has actions (O,) or (T, O), or probabilities or values (O, A) or (T, O, A). A table of values, whose rows are not
    probabilities, is a greedy policy.
    """
    seen = results.task.observation_layout
    actions = results.task.action_layout
    if seen.form != "discrete" or actions.form not in ("discrete", "multi_discrete"):
        misused(f"a table is a policy where observations are one number and actions finite, not on {results.task.id}")
    o = seen.counts[0]
    a = int(np.prod(actions.counts))
    if table.dtype.kind in "iu" and table.shape[-1:] == (o,) and table.shape[-2:] != (o, a):
        index = table - actions.starts[0] if actions.form == "discrete" else table
        if not ((index >= 0) & (index < a)).all():
            misused(f"an action of the table is not in {results.task.action_space}")
        table = np.eye(a)[index]
    if table.ndim not in (2, 3) or table.shape[-2:] != (o, a):
        misused(
            f"a table has shape ({o},) for actions, ({o}, {a}) for their probabilities or values; maybe with "
            f"the time in front; not {table.shape}",
            _transposed(table, o, a),
        )
    if not np.isfinite(table).all():
        what = "NaN" if np.isnan(table).any() else "an infinite number"
        misused(f"the table of probabilities or values of actions has {what} in it", "every entry is a finite number")
    stochastic = table if are_probabilities(table) else greedy(table)
    if table.ndim == 3:
        return ObservedValue(_timed_value(results, greedy(table)), _timed_value(results, stochastic))
    start = seen.starts[0]
    return _of_probabilities(
        results, lambda rows: table[np.asarray(rows) - start], lambda rows: stochastic[np.asarray(rows) - start], seed
    )


def _timed_value(results: Results, table: Array) -> Return:
    """Return the value of a table (T, O, A) on the exact model, if its states and observations are one to one."""
    model = results.model
    policy = Predictor(results.task, None)
    if model is None or model.task is not results.task or policy.is_noisy or policy.sees_time:
        misused(f"a table over the time is a policy where observations show the state, not on {results.task.id}")
    observations = policy.observe(states_of(model), 0, np.random.default_rng(0)) - policy.layout.starts[0]
    return _table_value(results, table[:, observations].astype(np.float64)).value
