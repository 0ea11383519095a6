"""Specs of tasks that other tools have, with the returns of their source as claims."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from taskspec.base.diagnostics import spec_error
from taskspec.base.limits import limits
from taskspec.exact.model.extract import OVERHEAD, SWEEP, tabulated
from taskspec.exact.model.model import NoModel
from taskspec.exact.solve.backward import Greedy, Uniform
from taskspec.exact.solve.outcomes import Number
from taskspec.exact.solve.solve import Solvers
from taskspec.exact.tables.frozen_task import FrozenTask, cleared, plain_names, separated
from taskspec.exact.tables.spec_text import has_mean_rewards
from taskspec.tools.exchange.formats import read
from taskspec.tools.exchange.reading import listed
from taskspec.tools.exchange.settled import ENDED, PHASE

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
    task = read(place, format)
    if task.labels:
        task = task.remarked(f"lost: labels ({listed(list(task.labels))})")
    if horizon is not None:
        task = replace(task, horizon=horizon)
    width = _width(task)
    if width is None:
        task = cleared(task)
    names = _names(task, width)
    cells = len(names) ** 2 * len(task.actions)
    task = separated(replace(task, states=names, width=width), everywhere=cells > limits().cells)
    if has_mean_rewards(task):
        task = task.remarked(
            "rewards: their mean for each state and action, as a table by next state would be too large"
        )
    text = {
        "title": f"{Path(place).stem}, imported",
        "summary": f"The decision process of {Path(place).name}.",
    }
    return replace(task, name=name or _name(place), text=text, claims=_returns(task))


def _name(place: str) -> str:
    """Return a name for the task of a file or environment: `FrozenLake` for `FrozenLake-v1`."""
    words = re.findall(r"[A-Za-z0-9]+", re.sub(r"-v\d+$", "", Path(place).stem))
    joined = "".join(word[0].upper() + word[1:] for word in words)
    if NAME.fullmatch(joined):
        return joined
    return "Imported"


def _names(task: FrozenTask, width: int | None) -> tuple[str, ...]:
    """Return names of states: their components with their values, where the source has them; rows and columns of a grid."""
    is_numbered = task.states == tuple(f"s{s}" for s in range(len(task.states)))
    if not task.values and width is not None and is_numbered:
        return tuple(f"r{s // width}c{s % width}" for s in range(len(task.states)))
    if not task.values:
        return task.states
    names = []
    for row in task.values:
        parts = [f"{name}{value}" for name, value in row.items() if name != PHASE]
        if row.get(PHASE) == ENDED:
            parts.append("end")
        names.append("_".join(parts))
    return plain_names(names, "s")


def _width(task: FrozenTask) -> int | None:
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


def _returns(task: FrozenTask) -> dict[str, Number]:
    """Return the optimal and random return of the tables themselves, without the spec.

    Both are left out where they would take too long, and those of endless tasks where some policy never ends an episode.
    """
    outcomes = []
    legal = np.zeros((len(task.actions), len(task.states)), np.bool_)
    for s, a, o in task.steps():
        legal[a, s] = True
        if s in task.acting:
            outcomes.append((s, a, o.state, float(o.probability), float(o.reward), o.ends))
    if (task.horizon or 0) * (len(outcomes) + OVERHEAD) > limits().seconds * SWEEP:
        return {}
    start = np.array(task.start, np.float64)
    model = tabulated(outcomes, start, len(task.actions), task.horizon, float(task.discount), legal)
    solver = Solvers(model).in_floats
    returns: dict[str, Number] = {}
    for name, rule in (("optimal_return", Greedy()), ("random_return", Uniform())):
        with suppress(NoModel):
            returns[name] = solver.value(rule).value
    return returns
