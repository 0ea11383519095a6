"""The best return within limits on measures, and what one costs in terms of the other, by linear programs.

The unknowns are occupancies: x[t, a, s] is the discounted probability that action a is taken in state s at time t (without a
horizon, the same summed over all times). What flows into a state flows out of it,

    sum over a of x[t + 1, a, s'] = gamma * sum over a and s of P[t, a, s, s'] x[t, a, s],

and the return and every measure are linear in x. The best policy under limits may have to draw its actions.

Source: E. Altman, Constrained Markov Decision Processes (1999), chapters 3 and 4.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from scipy import sparse

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import suggest
from taskspec.base.limits import limits as cost_limits
from taskspec.base.limits import tell
from taskspec.exact.model.extract import extract, with_reward
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.solve.infinite_horizon import HINT, UNENDING
from taskspec.language.registry import load
from taskspec.language.task.task import TaskLike

MOST_ENTRIES = 5_000_000
"""Non-zeros of a linear program, at most."""
MOST_PROGRAMS = 1_000
"""Linear programs that are solved for one answer, at most."""
CLOSE = 1e-7
"""Differences of this size, relative to all numbers of a front, are those of the solver."""
_LIMIT = re.compile(r"\s*(\w+)\s*(<=|>=)\s*(\S+)\s*")


@dataclass(frozen=True)
class Limit:
    """A limit on the expected sum of a measure over an episode."""

    measure: str
    sign: Literal["<=", ">="]
    bound: float

    @classmethod
    def of(cls, text: str) -> Limit:
        """Read a limit.

        Args:
            text: a measure, `<=` or `>=`, and a number: `cost <= 1`.

        Returns:
            the limit, with a finite bound.

        Raises:
            SpecError: E713, for anything else.
        """
        found = _LIMIT.fullmatch(text)
        try:
            if found is not None and np.isfinite(float(found[3])):
                return cls(found[1], found[2], float(found[3]))  # type: ignore[arg-type]
        except ValueError:
            pass
        misused(f"'{text}' is not a limit on a measure", "a measure and a number: `cost<=1`, or `performance>=1`")

    def __str__(self) -> str:
        return f"{self.measure} {self.sign} {self.bound:g}"


@dataclass(frozen=True)
class Expectations:
    """The expected return of a policy, and the expected sums of measures, by name."""

    value: float
    measures: Mapping[str, float]


def constrained_optimum(task: TaskLike, limits: Sequence[Limit | str]) -> Expectations:
    """Return the best return of all policies that keep limits on measures.

    Args:
        task: a task with measures, its id or its path.
        limits: `cost <= 1` and the like.

    Returns:
        The best expected return, and the expected sums of all measures.

    Raises:
        SpecError: E712, where there is no exact model, or no policy keeps the limits; E713, for a measure that there is not.
    """
    kept = [limit if isinstance(limit, Limit) else Limit.of(limit) for limit in limits]
    program = Occupancies(task, [limit.measure for limit in kept])
    return program.best(1.0, {}, kept)


def pareto_front(task: TaskLike, measure: str) -> list[Expectations]:
    """Return the corners of the best return as a function of a measure, from its least to its largest expectation.

    Between two neighbours, the best return is on the line from one to the other. Found by weighing one against the other
    (Y. Aneja and K. Nair, Bicriteria Transportation Problem, Management Science 25, 1979).

    Args:
        task: a task with measures, its id or its path.
        measure: a name of one.

    Returns:
        The corners, by the expectation of the measure, the least first.

    Raises:
        SpecError: as for `constrained_optimum`.
    """
    program = Occupancies(task, [measure])
    first = program.end(measure, -1.0)
    last = program.end(measure, 1.0)
    points = [first, *_between(program, measure, first, last), last]
    corners = [first]
    for point, after in pairwise(points[1:]):
        if _height(measure, corners[-1], after, point) > 0:
            corners.append(point)
    if _width(measure, first, last) > 0:
        corners.append(last)
    return corners


def _between(program: Occupancies, measure: str, a: Expectations, b: Expectations) -> Iterator[Expectations]:
    width = _width(measure, a, b)
    if width == 0:
        return
    above = program.best(width, {measure: a.value - b.value}, ())
    if _height(measure, a, b, above) > 0:
        yield from _between(program, measure, a, above)
        yield above
        yield from _between(program, measure, above, b)


def _width(measure: str, a: Expectations, b: Expectations) -> float:
    """Return by how much a measure grows between two points; 0 where that may be an error of the solver."""
    width = b.measures[measure] - a.measures[measure]
    if width <= CLOSE * (1.0 + abs(a.measures[measure])):
        return 0.0
    return width


def _height(measure: str, a: Expectations, b: Expectations, point: Expectations) -> float:
    """Return how far a point is above the line between two others; 0 where that may be an error of the solver."""
    along = (point.measures[measure] - a.measures[measure]) / (b.measures[measure] - a.measures[measure])
    height = point.value - (a.value + along * (b.value - a.value))
    if height <= CLOSE * (1.0 + abs(a.value) + abs(b.value)):
        return 0.0
    return height


class Occupancies:
    """The linear program of a task and some of its measures."""

    def __init__(self, task: TaskLike, measures: Sequence[str]) -> None:
        task = load(task)
        known = task.process.measures
        for name in measures:
            if name not in known:
                hint = suggest(name, list(known)) or (
                    f"it has {', '.join(known)}" if known else "`measures:` declares them"
                )
                misused(f"{task.name} has no measure '{name}'", hint)
        self.model = extract(task)
        self.paid = {name: with_reward(self.model, known[name]) for name in dict.fromkeys(measures)}
        steps = self.model.horizon or 1
        if self.model.entries / len(self.model.steps) * steps > MOST_ENTRIES:
            refuse(f"the linear program would have more than {MOST_ENTRIES:,} entries", "choose smaller parameters")
        self.levels = [
            np.flatnonzero(self.model.acting)
        ]  # states that act at each time; without a horizon, as one time
        if self.model.horizon is not None:
            self.levels = [np.flatnonzero(states) for _, states in self.model.levels()]
        self.flow, self.start = self._flow()
        self.gains = {name: self._gain(model) for name, model in self.paid.items()}
        self.gain = self._gain(self.model)
        self.solved = 0

    def _rows(self, t: int) -> Array:
        actions = np.arange(self.model.n_actions)[:, None] * self.model.n_states
        return np.asarray((actions + self.levels[t])[self._legal(t)])

    def _legal(self, t: int) -> Array:
        every = np.ones((self.model.n_actions, len(self.levels[t])), np.bool_)
        if self.model.legal is None:
            return every
        return self.model.legal[:, self.levels[t]]

    def _flow(self) -> tuple[Any, Array]:
        gamma = self.model.discount
        size = len(self.levels)
        blocks: list[list[Any]] = [[None] * size for _ in range(size)]
        for t, states in enumerate(self.levels):
            out = sparse.hstack([sparse.identity(len(states), format="csr")] * self.model.n_actions, format="csr")
            out = out[:, self._legal(t).reshape(-1)]
            blocks[t][t] = out
            P = self.model.step(t).P[self._rows(t)]
            if self.model.horizon is None:
                blocks[t][t] = out - gamma * P[:, states].T
            elif t + 1 < size:
                blocks[t + 1][t] = -gamma * P[:, self.levels[t + 1]].T
        right = np.zeros(sum(map(len, self.levels)))
        right[: len(self.levels[0])] = self.model.start[self.levels[0]]
        return sparse.bmat(blocks, format="csc"), right

    def _gain(self, model: Model) -> Array:
        return np.concatenate([model.step(t).R[self._rows(t)] for t in range(len(self.levels))])

    def best(self, weight: float, weights: Mapping[str, float], limits: Sequence[Limit]) -> Expectations:
        """Return a policy of the largest weighted sum of the return and of measures, within limits.

        Args:
            weight: of the return.
            weights: of measures, by name.
        """
        self.solved += 1
        tell(f"solving linear program {self.solved:,}")
        if self.solved > MOST_PROGRAMS:
            refuse(f"the front has too many corners for {MOST_PROGRAMS:,} linear programs", "choose smaller parameters")
        objective = weight * self.gain
        for name, each in weights.items():
            objective = objective + each * self.gains[name]
        rows = np.zeros((len(limits), len(self.gain)))
        bounds = np.zeros(len(limits))
        for row, limit in enumerate(limits):
            sign = 1.0
            if limit.sign == ">=":
                sign = -1.0
            rows[row] = sign * self.gains[limit.measure]
            bounds[row] = sign * limit.bound
        from scipy.optimize import linprog  # a quarter of a second, for this alone

        found = linprog(
            -objective, rows, bounds, self.flow, self.start, method="highs",
            options={"time_limit": float(cost_limits().seconds)},
        )  # fmt: skip
        if found.status == 2:
            refuse(f"no policy keeps {' and '.join(map(str, limits))}")
        if found.status == 3:
            refuse(UNENDING, HINT)
        if found.status != 0:
            refuse(f"the linear program is not solved: {found.message}")
        measures = {name: float(gain @ found.x) for name, gain in self.gains.items()}
        return Expectations(float(self.gain @ found.x), measures)

    def end(self, measure: str, sign: float) -> Expectations:
        """Return the best policy among those with the largest measure (`sign` 1), or the smallest (-1)."""
        bound = self.best(0.0, {measure: sign}, ()).measures[measure]
        limit = Limit(measure, "<=", bound)
        if sign > 0:
            limit = Limit(measure, ">=", bound)
        return self.best(1.0, {}, [limit])
