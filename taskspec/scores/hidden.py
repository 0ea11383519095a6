"""What observations leave open: the information about the state that noise and hiding take away."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Node, draws, reads
from taskspec.model.model import Model, refuse
from taskspec.model.transitions import TIME, branches, count
from taskspec.scores.random_success import mean_length, undiscounted
from taskspec.solve.infinite_horizon import chain_values
from taskspec.solve.plans import uniform_plan
from taskspec.solve.solve import occupancy
from taskspec.task.task import Task

RATE = 5_000_000
"""Numbers in observations that are listed in a second, nominally."""


def hidden_bits(model: Model) -> float:
    """The entropy of the state given its observation, in bits, where random actions are about to be taken."""
    task = model.task
    if task.observation.is_state:
        return 0.0
    nodes = _telling(task)
    timed = TIME in reads(nodes)
    if timed and model.horizon is None:
        refuse("the observation depends on the time, and there is no horizon")
    often = _often_at_each_time(model) if timed else [_often(model)]
    _check_size(nodes, sum(int(np.count_nonzero(each)) for each in often))
    found = [part for t, each in enumerate(often) for part in _seen(model, nodes, t, each)]
    state, rows, weight = (np.concatenate(column) for column in zip(*found, strict=True))
    _, seen = np.unique(rows, axis=0, return_inverse=True)
    pairs, pair = np.unique(np.stack([seen.reshape(-1), state]), axis=1, return_inverse=True)
    joint = np.bincount(pair.reshape(-1), weight / weight.sum())
    alone = np.bincount(pairs[0], joint)
    return max(0.0, float(-(joint * np.log2(joint / alone[pairs[0]])).sum()))


def _telling(task: Task) -> list[Node]:
    """What is seen, without noise that does not depend on the state and is in nothing else."""
    moving = {d.site for d in draws((*task.next, *task.initial, task.reward, task.terminal))}
    if moving & {d.site for d in draws(task.observation.nodes)}:
        refuse("what is seen shares a draw with the dynamics")
    nodes = [node for node in task.observation.nodes if not draws([node]) or reads([node])]
    while True:
        used = {d.site for d in draws(nodes)}
        kept = [n for n in task.observation.nodes if n in nodes or used & {d.site for d in draws([n])}]
        if len(kept) == len(nodes):
            return nodes
        nodes = kept


def _check_size(nodes: list[Node], states: int) -> None:
    outcomes = count(draws(nodes), {})
    if outcomes == np.inf:
        refuse("the noise on what is seen of a state has infinitely many outcomes")
    size = states * outcomes * sum(node.type.size for node in nodes)
    if size > limits().seconds * RATE:
        refuse(f"observations have {count_of(int(size))} numbers in all", how_to_raise("seconds", size / RATE))


def _seen(model: Model, nodes: list[Node], t: int, often: Array) -> Iterator[tuple[Array, Array, Array]]:
    """States, what is seen of them (one row each), and how often, for each outcome of the noise."""
    states = np.flatnonzero(often)
    given = {k: v if v.shape[-1] == 1 else v[..., states] for k, v in model.reads(t).items()}
    for branch in branches(draws(nodes), given, len(states)):
        which = np.arange(len(states)) if branch.origin is None else branch.origin
        rows = [np.zeros((1, len(which)))]
        for value in evaluate(nodes, branch.place(given), branch.sample):
            rows.append(np.broadcast_to(value, (*value.shape[:-1], len(which))).reshape(-1, len(which)))
        yield states[which], np.concatenate(rows).astype(np.float64).T, often[states[which]] * branch.weight


def _often(model: Model) -> Array:
    """How often random actions are expected to be taken in each state, (S,)."""
    plan = uniform_plan(model)
    if model.horizon is not None:
        return occupancy(undiscounted(model, model.steps), plan)
    mean_length(model, plan)  # refuses where episodes may never end
    shape = (model.n_actions, model.n_states, model.n_states)
    going = model.step(0).P
    matrix = sum(going[a * shape[1] : (a + 1) * shape[1]] for a in range(shape[0])) / shape[0]
    return chain_values(matrix.T.tocsr(), model.start, model.acting)


def _often_at_each_time(model: Model) -> list[Array]:
    plan, found, now = uniform_plan(model), [], model.start
    for t in range(model.horizon or 0):
        found.append(now)
        now = model.step(t).P.T @ (plan(t) * now).reshape(-1)
    return found
