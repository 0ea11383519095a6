"""Policies on a model as probabilities of actions, one table for each way to decide.

A plan gives (A, S) at a time. Those that come from dynamic programming depend on the time when the
task has a horizon.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from taskspec.exact import solve
from taskspec.exact.maxent import maxent_policy
from taskspec.exact.model import Model
from taskspec.exact.outcomes import branches, count
from taskspec.exact.transitions import TIME
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Node, draws, reads
from taskspec.spec.task import Soft

Array = np.ndarray[Any, Any]
Plan = Callable[[int], Array]


def stationary(table: Array) -> Plan:
    return lambda t: table


def timed(tables: Sequence[Array]) -> Plan:
    """One table for each time; the last one ever after."""
    return lambda t: tables[min(t, len(tables) - 1)]


def uniform_plan(model: Model) -> Plan:
    return stationary(np.full((model.n_actions, model.n_states), 1 / model.n_actions))


def optimal_plan(model: Model) -> Plan:
    """All best actions with equal probability."""
    return timed([solve.greedy(q) for q in solve.all_action_values(model)])


def soft_plan(model: Model, beta: float) -> Plan:
    """The causal maximum-entropy policy: exp(beta Q) of the soft values, normalised."""
    return timed([solve.boltzmann(q, beta) for q in solve.all_action_values(model, solve.soft(beta))])


def maxent_plan(model: Model, beta: float = 1.0) -> Plan:
    return timed(maxent_policy(model, beta))


def zero_terminal_value_plan(model: Model, shift: float = 0.0) -> Plan:
    """Optimal for the reward plus a constant, when what follows a terminal state is worth 0.

    A reward that was learnt from behaviour of a fixed length is only known up to a constant per
    step. That is harmless there, and not where episodes may end early: with the value of terminal
    states fixed at 0, a positive constant says to linger and a negative one to leave. `shift` is
    that constant; 0 is the task's own reward.
    """
    return timed([solve.greedy(q) for q in solve.all_action_values(model, solve.best, shift)])


def expert_plan(model: Model) -> Plan | None:
    """The expert that the task's spec gives, or None."""
    match model.task.expert:
        case "optimal":
            return optimal_plan(model)
        case Soft(beta=beta):
            return soft_plan(model, beta)
        case tuple() as nodes:
            return _expressed(model, nodes)
        case _:
            return None


def _expressed(model: Model, nodes: tuple[Node, ...]) -> Plan | None:
    """An expert given by expressions, which may draw (finitely many outcomes) and read the time."""
    if count(draws(nodes), {}) > 10_000:
        return None
    if TIME not in reads(nodes):
        return stationary(_table(model, nodes, 0))
    return lambda t: _table(model, nodes, t)


def _table(model: Model, nodes: tuple[Node, ...], t: int) -> Array:
    table = np.zeros((model.n_actions, model.n_states))
    given = model.reads(t)
    for branch in branches(draws(nodes), given, model.n_states):
        values = evaluate(nodes, branch.place(given), branch.sample)
        at = np.arange(model.n_states) if branch.origin is None else branch.origin
        action, _ = model.actions.encode(values, len(at))
        np.add.at(table, (action, at), np.broadcast_to(branch.weight, (len(at),)))
    return table
