"""The value of whatever policy is handed in: a table, a function, an expert, or an object with `predict`."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.lang.ir import Role
from taskspec.model.model import Model, misused, refuse
from taskspec.policies.adapters import ASKS, Asked
from taskspec.policies.experts import Expert
from taskspec.policies.named import planned
from taskspec.rollout.rollout import State
from taskspec.scores.returns import Results, Return
from taskspec.solve import solve
from taskspec.solve.plans import Plan, stationary, timed
from taskspec.task.task import Task

Function = Callable[[State, int], Mapping[str, Any]]
Asking = Literal["probabilities", "actions", "samples"]
"""What the value of a policy rests on: its probabilities of actions, its actions where they are always the same, or episodes."""


@dataclass(frozen=True, slots=True)
class Valued:
    """The expected return of a policy, and in which way the policy was asked."""

    value: Return
    asked: Asking


def policy_value(results: Results, policy: Any, deterministic: bool | None) -> Valued:
    """The expected return of a policy: exact where the task has a model and the policy can be tabulated on it.

    Where it has to be simulated, `results` say in how many episodes, and of which seed.
    """
    task, model = results.task, results.model
    if isinstance(policy, list | tuple) or hasattr(policy, "__array__"):
        return _tabulated(policy, results)
    if isinstance(policy, Expert) and not deterministic:
        return _as_expert(policy, results)
    if hasattr(policy, "predict"):
        return _predicted(Asked(task, policy, deterministic), results)
    if not callable(policy):
        hint = f"`Expert(task, {policy!r})`" if isinstance(policy, str) and planned(policy) is not None else None
        misused(f"{type(policy).__name__} is not a policy", hint or "a table, a function, or an object with `predict`")
    function = _of_states(task, policy)
    if model is not None and model.task is task:
        try:
            return Valued(Return(solve.policy_return(model, plan_of_function(model, function))), "actions")
        except _Varies:
            pass
    return Valued(results.simulated(lambda state, t, rng: function(state, t)), "samples")


def _of_states(task: Task, policy: Callable[..., Any]) -> Function:
    """A function from states and the time to actions by component, whose arguments and answers are looked at.

    Raises:
        SpecError: (E713) when it takes something else; once it is asked, when it gives something else.
    """
    names = [c.name for c in task.action]
    hint = f"`lambda state, t: {{{', '.join(f'{name!r}: ...' for name in names)}}}`; of observations, an object with `predict`"
    try:
        inspect.signature(policy).bind({}, 0)
    except ValueError:  # nothing is known of it
        pass
    except TypeError:
        misused("a function that is a policy takes the states and the time", hint)

    def chosen(state: State, t: int) -> Mapping[str, Any]:
        answer = policy(state, t)
        if not isinstance(answer, Mapping) or any(name not in answer for name in names):
            given = (
                ", ".join(map(str, answer))
                if isinstance(answer, Mapping)
                else f"a value of type {type(answer).__name__}"
            )
            misused(
                f"a function that is a policy gives the action by component, {', '.join(names)}, not {given or 'nothing'}",
                hint,
            )
        return answer

    return chosen


def _tabulated(table: Any, results: Results) -> Valued:
    model, array = results.model, np.asarray(table)
    if array.ndim == 1 and array.dtype.kind == "f":
        misused("a list of reals is not a policy", "returns of episodes are given as `score(task, returns=[...])`")
    if model is None:
        refuse(f"a table of actions needs an exact model: {results.why_not}")
    plan = plan_of_table(model, array)
    return Valued(Return(solve.policy_return(model, plan)), "probabilities" if array.dtype.kind == "f" else "actions")


def _as_expert(expert: Expert, results: Results) -> Valued:
    """The expert knows its own return, and the probabilities behind its actions."""
    results = results if expert.given is None else expert.results
    value = results.expert
    if value is None:
        refuse(f"the expert of {expert.task.name} has no return: {results.why_not}")
    return Valued(value, "probabilities" if value.exact else "samples")


def plan_of_table(model: Model, table: Array) -> Plan:
    """Return the plan of a table: actions (S,) or (T, S), or probabilities (S, A) or (T, S, A).

    Raises:
        SpecError: E713 for another table.
    """
    a, n = model.n_actions, model.n_states
    if table.dtype.kind in "iu" and table.shape[-1:] == (n,) and table.ndim <= 2 and table.shape != (n, a):
        if not ((table >= 0) & (table < a)).all():
            misused(f"an action of the table is not in 0 to {a - 1}")
        hot = np.moveaxis(np.eye(a)[table], -1, -2)
        return stationary(hot) if table.ndim == 1 else timed(list(hot))
    if table.shape[-2:] != (n, a) or table.ndim > 3:
        message = f"a table of probabilities has shape ({n}, {a}) or (T, {n}, {a}), not {table.shape}"
        misused(message, transposed(table, n, a))
    table = table.astype(np.float64)
    if np.isnan(table).any():
        misused("the table of probabilities has NaN in it", "every entry is a probability")
    if not np.allclose(table.sum(axis=-1), 1) or (table < 0).any():
        is_square_transposed = a == n and np.allclose(table.sum(axis=-2), 1)
        hint = transposed(table, n, a) if is_square_transposed else None
        misused("the probabilities of the actions in a state are at least 0, and sum to 1", hint)
    by_action = np.moveaxis(table, -1, -2)
    return stationary(by_action) if table.ndim == 2 else timed(list(by_action))


def transposed(table: Array, rows: int, actions: int) -> str | None:
    """Return the hint for a table whose actions come before its states or observations; None for any other."""
    if table.ndim not in (2, 3) or table.shape[-2:] != (actions, rows):
        return None
    way = "table.T" if table.ndim == 2 else "np.moveaxis(table, -1, -2)"
    return f"this table is transposed: actions are its last axis, as in {way}"


class _Varies(Exception):
    """A policy does not give the same actions each time it is asked about the same states."""


def plan_of_function(model: Model, policy: Function) -> Plan:
    """A function from states by component, (*shape, S), and the time to actions by component.

    Raises:
        _Varies: when its actions are not always the same.
    """

    def ask(t: int) -> Array:
        states = {name: v.copy() for (role, name), v in model.reads(t).items() if role is Role.STATE}
        chosen = policy(states, t)
        values = [np.asarray(chosen[c.name]) for c in model.actions.components]
        return one_hot(model, [np.broadcast_to(v, (*v.shape[:-1], model.n_states)) for v in values])

    def at(t: int) -> Array:
        first = ask(t)
        if any(not np.array_equal(first, ask(t)) for _ in range(ASKS - 1 if t == 0 else 1)):
            raise _Varies
        return first

    return at


def one_hot(model: Model, values: list[Array]) -> Array:
    """Actions by component (*shape, S) as probabilities (A, S)."""
    code, outside = model.actions.encode(values, model.n_states)
    if outside is not None and outside.any():
        state = model.state_name(int(np.flatnonzero(outside)[0]))
        raise SpecError([Diagnostic("E706", None, f"the policy chose an action outside the action space in {state}")])
    table = np.zeros((model.n_actions, model.n_states))
    table[code, np.arange(model.n_states)] = 1.0
    return table


# -- objects with `predict` -----------------------------------------------------------------------


def _predicted(asked: Asked, results: Results) -> Valued:
    """The value of an object with `predict`, asked about every state at once, or in episodes."""
    model = results.model
    if model is not None and model.task is asked.task and (asked.sees_state_alone or asked.sees_time):
        for way in _ANSWERS:
            plan = _plan(asked, model, _ANSWERS[way])
            if plan is not None:
                return Valued(Return(solve.policy_return(model, plan)), way)
    memory: list[Any] = [None]

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        actions, memory[0] = asked.actions(state, t, rng, None if t == 0 else memory[0], start=t == 0)
        return actions

    return Valued(results.simulated(choose), "samples")


def _plan(asked: Asked, model: Model, answer: Callable[[Asked, Model, int], Array | None]) -> Plan | None:
    """The policy's answers for all states as a plan; None where there is one of no such kind."""
    horizon = model.task.horizon
    if asked.sees_state_alone:
        table = answer(asked, model, 0)
        return None if table is None else stationary(table)
    if horizon is None:
        return None
    tables = [answer(asked, model, t) for t in range(horizon)]
    known = [table for table in tables if table is not None]
    return timed(known) if len(known) == len(tables) else None


def _chances(asked: Asked, model: Model, t: int) -> Array | None:
    found = asked.probabilities(states_of(model), t)
    if found is None:
        return None
    wanted = (model.n_actions, model.n_states)
    if found.shape != wanted or not np.allclose(found.sum(axis=0), 1) or (found < 0).any():
        misused(
            f"`action_probabilities` gives rows of {wanted[0]} probabilities that sum to 1, one for each observation"
        )
    return found


def _constant(asked: Asked, model: Model, t: int) -> Array | None:
    chosen = asked.constant_actions(states_of(model), t)
    return None if chosen is None else one_hot(model, [chosen[c.name] for c in model.actions.components])


_ANSWERS: dict[Asking, Callable[[Asked, Model, int], Array | None]] = {"probabilities": _chances, "actions": _constant}


def states_of(model: Model) -> State:
    """All states of a model by component, (*shape, S)."""
    return {name: v for (role, name), v in model.reads().items() if role is Role.STATE}
