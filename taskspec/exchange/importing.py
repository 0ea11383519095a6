"""Specs of tasks that other tools have, with the returns of their source as claims."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import spec_error
from taskspec.base.limits import limits
from taskspec.exchange.formats import read
from taskspec.exchange.settled import PHASE
from taskspec.exchange.tables import FrozenTask, Number, plain_names, separated, visited
from taskspec.model.extract import OVERHEAD, SWEEP
from taskspec.model.model import NoModel, scipy_sparse
from taskspec.solve.backward import action_values, backward, first_values
from taskspec.solve.infinite_horizon import chain_values

MOST_ROUNDS = 200
"""Rounds of policy iteration, for tasks without a horizon."""
CLOSE = 1e-10
"""A difference of Q-values that may be rounding."""
NAME = re.compile(r"[A-Z][A-Za-z0-9]{0,59}")


def imported(place: str, format: str | None = None, name: str | None = None, horizon: int | None = None) -> FrozenTask:
    """Return the task of a file or an environment, ready to be written as a spec.

    Args:
        place: the path of a file, or the id of an environment of Gymnasium.
        format: of the file, where its suffix does not say it.
        name: of the task; made from that of the file or environment unless given.
        horizon: of episodes, in place of the source's.

    Raises:
        SpecError: E728, E726, E711 or E701 where it cannot be read, E713 for a name that is none.
    """
    if name is not None and not NAME.fullmatch(name):
        raise spec_error("E713", f"'{name}' is not a name", "a capital letter, and letters and digits")
    found = read(place, format)
    if horizon is not None:
        found = replace(found, horizon=horizon)
    width = _width(found)
    if width is None:
        found = visited(found)
    names = _names(found, width)
    cells = len(names) ** 2 * len(found.actions)
    found = separated(replace(found, states=names, width=width), everywhere=cells > limits().cells)
    text = {
        "title": f"{Path(place).stem}, imported",
        "summary": f"The decision process of {Path(place).name}.",
        "capability": "imported",
    }
    return replace(found, name=name or _name(place), text=text, claims=_returns(found))


def _name(place: str) -> str:
    """Return a name for the task of a file or environment: `FrozenLake` for `FrozenLake-v1`."""
    words = re.findall(r"[A-Za-z0-9]+", re.sub(r"-v\d+$", "", Path(place).stem))
    joined = "".join(word[0].upper() + word[1:] for word in words)
    return joined if NAME.fullmatch(joined) else "Imported"


def _names(task: FrozenTask, width: int | None) -> tuple[str, ...]:
    """Return names of states: their components with their values, where the source has them; rows and columns of a grid."""
    if not task.values and width is not None:
        return tuple(f"r{s // width}c{s % width}" for s in range(len(task.states)))
    if not task.values:
        return task.states
    names = []
    for row in task.values:
        parts = {name: value for name, value in row.items() if name != PHASE}
        end = "_end" if row.get(PHASE) == 2 else ""
        names.append("_".join(f"{name}{value}" for name, value in parts.items()) + end)
    return plain_names(names, "s")


def _width(task: FrozenTask) -> int | None:
    """Return the columns of a grid, if every step leads to a neighbour in it, to a first state, or nowhere."""
    n = len(task.states)
    firsts = {s for s, p in enumerate(task.start) if p > 0}
    moves = set()
    for s, _, outcome in task.steps():
        if s in task.acting and outcome.state != s and outcome.state not in firsts:
            moves.add((s, outcome.state))
    sizes = {abs(to - s) for s, to in moves} - {1}
    if len(sizes) != 1:
        return None
    (width,) = sizes
    if width < 2 or n % width or any(abs(to - s) == 1 and to // width != s // width for s, to in moves):
        return None
    return width


# -- returns ----------------------------------------------------------------------------------------------------------


def _returns(task: FrozenTask) -> dict[str, Number]:
    """Return the optimal and random return of the tables themselves, without the spec.

    Both are left out where they would take too long; the optimal one where some policy never ends an episode, as no claim
    about it can be proved then.
    """
    P, R = _arrays(task)
    start = np.array([float(p) for p in task.start])
    gamma = float(task.discount)
    legal = np.array([[bool(outcomes) for outcomes in by_action] for by_action in task.outcomes]).T
    uniform = legal / legal.sum(axis=0)
    found: dict[str, Number] = {}
    if task.horizon is not None:
        if task.horizon * (P.nnz + OVERHEAD) > limits().seconds * SWEEP:
            return {}

        def backup(t: int, V: Array) -> Array:
            return action_values(P, R, gamma, V)

        zero = np.zeros(len(start))
        best = first_values(backward(backup, lambda t, Q: np.where(legal, Q, -np.inf).max(axis=0), zero, task.horizon))
        random = first_values(backward(backup, lambda t, Q: (uniform * Q).sum(axis=0), zero, task.horizon))
        return {"optimal_return": float(start @ best), "random_return": float(start @ random)}
    if gamma < 1 or _always_ends(task):
        policy = np.eye(len(R))[legal.argmax(axis=0)].T
        for _ in range(MOST_ROUNDS):
            Q = action_values(P, R, gamma, _values_of(policy, P, R, gamma))
            better = np.eye(len(R))[np.where(legal, Q + CLOSE * policy, -np.inf).argmax(axis=0)].T
            if np.array_equal(better, policy):
                found["optimal_return"] = float(start @ (policy * Q).sum(axis=0))
                break
            policy = better
    with suppress(NoModel):
        found["random_return"] = float(start @ _values_of(uniform, P, R, gamma))
    return found


def _values_of(policy: Array, P: Any, R: Array, gamma: float) -> Array:
    """Return V (S,) of a policy (A, S) without a horizon."""
    n = R.shape[1]
    columns = np.tile(np.arange(n), len(R))
    chosen = scipy_sparse().csr_array((policy.reshape(-1), (columns, np.arange(len(columns)))))
    return chain_values(gamma * (chosen @ P).tocsr(), (policy * R).sum(axis=0), np.ones(n, np.bool_))


def _always_ends(task: FrozenTask) -> bool:
    """Return whether every policy ends every episode: no set of states can be stayed in."""
    inside = set(task.acting)
    while inside:
        staying = set()
        for s in inside:
            for outcomes in task.outcomes[s]:
                if outcomes and all(not outcome.ends and outcome.state in inside for outcome in outcomes):
                    staying.add(s)
        if staying == inside:
            return False
        inside = staying
    return True


def _arrays(task: FrozenTask) -> tuple[Any, Array]:
    """Return the probabilities (A*S, S) of going on in each state, and expected rewards (A, S)."""
    n = len(task.states)
    R = np.zeros((len(task.actions), n))
    rows, columns, weights = [], [], []
    for s, a, outcome in task.steps():
        if s not in task.acting:
            continue
        R[a, s] += float(outcome.probability * outcome.reward)
        if not outcome.ends:
            rows.append(a * n + s)
            columns.append(outcome.state)
            weights.append(float(outcome.probability))
    P = scipy_sparse().csr_array((weights, (rows, columns)), shape=(n * len(task.actions), n))
    return P, R
