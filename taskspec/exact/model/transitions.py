"""The outcomes of a step with their probabilities, at many points at once, and expected rewards."""

from __future__ import annotations

import math
import operator
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits
from taskspec.exact.model.lump import lumped
from taskspec.exact.model.model import refuse, too_large
from taskspec.exact.model.probabilities import FLOATS
from taskspec.exact.model.space import MAX_CODES, Reads, Space
from taskspec.language.expressions import interval
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Apply, Draw, Node, Read, children, draws, reads, rewrite, walk
from taskspec.language.expressions.operators import entry_of
from taskspec.language.expressions.types import TIME, Expression, Range, Role
from taskspec.language.expressions.variates import VARIATES
from taskspec.language.expressions.variates.entry import ProbabilityArithmetic, once
from taskspec.language.task.task import Task

# -- the expected reward where the reward itself is noisy -------------------------------------------------------------


def expected(reward: Node, builder: Builder, shared: Collection[Draw] = ()) -> Node:
    """Return the reward with every draw that is not finite and enters linearly replaced by its mean.

    Draws in `shared` also decide something else (the next state) and are left alone; so is a draw
    that enters in any other way, and then the task has no exact model.
    """
    kept = {d.site for d in shared}
    means: dict[int, Node] = {}
    for draw in draws([reward]):
        mean = VARIATES[draw.base].mean
        if mean is not None and draw.site not in kept and _is_linear(reward, draw):
            value = builder.cast(mean(builder, draw), draw.type.kind)
            means[id(draw)] = builder.stretch(value, draw.type.shape)
    return rewrite([reward], means, builder.remake)[0]


def _is_linear(root: Node, draw: Draw) -> bool:
    depends: dict[int, bool] = {}
    for node in walk([root]):
        below = [depends[id(c)] for c in children(node)]
        depends[id(node)] = node is draw or any(below)
        if any(below) and not (isinstance(node, Apply) and entry_of(node.op).linear(below)):
            return False
    return True


# -- every outcome of the finite draws of some expressions, with its probability, over a batch of points ------------------
#
# Draws are taken one after the other. Where the probabilities are the same at all points and there are
# many, an outcome is one pass over the points with the drawn value held fixed; otherwise the points are
# repeated, once for each outcome of positive probability.

LOOP_FROM = 4096
"""From this many points on, an outcome shared by all points is a pass of its own."""


@dataclass(frozen=True)
class Branch:
    """Outcomes of the draws at some of the points.

    `weight` is their probability, (M,) or (1,). `origin` gives the point of each, (M,), or is None
    when there is exactly one for every point. `drawn` holds the values of the draws by site,
    (*shape, M) or (*shape, 1).
    """

    weight: Array
    origin: Array | None
    drawn: Mapping[int, Array]
    numbers: ProbabilityArithmetic = FLOATS

    def place(self, reads: Reads) -> Reads:
        """Return what is read at each outcome's point."""
        if self.origin is None:
            return reads
        return picked(reads, self.origin)


def count(draws: Sequence[Draw], known: dict[int, Range]) -> float:
    """Return an upper bound on the outcomes at one point; infinite where a draw is not finite."""
    total = 1.0
    for draw in draws:
        outcomes = VARIATES[draw.base].outcomes
        if outcomes is None:
            return math.inf
        total *= outcomes.count(draw, lambda node: interval.bounds(node, known))
    return total


def outcome_count(expressions: Iterable[Expression]) -> float:
    """Return an upper bound on the outcomes of all draws in some expressions at one point; infinite where one is not finite."""
    return count(draws(expressions), {})


def is_finite(draw: Draw) -> bool:
    """Return whether the outcomes can be enumerated. Those of a Poisson are, up to where a tail of 1e-20 is left."""
    return VARIATES[draw.base].outcomes is not None


def branches(
    draws: Sequence[Draw], reads: Reads, lanes: int, numbers: ProbabilityArithmetic = FLOATS
) -> Iterator[Branch]:
    """Yield all outcomes of the finite draws among `draws` (as `ir.draws` orders them) at `lanes` points."""
    start = Branch(numbers.ratio(np.ones(1, np.int64), np.ones(1, np.int64)), None, {}, numbers)
    yield from _expand([d for d in draws if is_finite(d)], reads, lanes, start)


def _expand(draws: Sequence[Draw], reads: Reads, lanes: int, so_far: Branch) -> Iterator[Branch]:
    if not draws:
        yield so_far
        return
    draw = draws[0]
    rest = draws[1:]
    times = so_far.numbers.times
    args = evaluate(draw.args, so_far.place(reads), drawn=so_far.drawn)
    outcomes = VARIATES[draw.base].outcomes
    assert outcomes is not None
    values, p = outcomes.table(draw, args, so_far.numbers)
    if p.shape[-1] == 1 and lanes >= LOOP_FROM and so_far.origin is None:
        for k in np.flatnonzero(p[:, 0] > 0):
            drawn = {**so_far.drawn, draw.site: values[k][..., None]}
            yield from _expand(rest, reads, lanes, replace(so_far, weight=times(so_far.weight, p[k]), drawn=drawn))
        return
    if len(p) == 1:  # nothing is left to chance
        drawn = {**so_far.drawn, draw.site: values[0][..., None]}
        yield from _expand(rest, reads, lanes, replace(so_far, drawn=drawn))
        return
    # every point once for each outcome of positive probability, the outcomes of a point side by side
    n = lanes
    if so_far.origin is not None:
        n = len(so_far.origin)
    possible = once(operator.gt, p, np.zeros_like(p)).astype(np.bool_)
    point, outcome = np.nonzero(np.broadcast_to(possible.T, (n, len(p))))
    if p.shape[-1] == 1:
        chance = p[outcome, 0]
    else:
        chance = p[outcome, point]
    weight = times(_at(so_far.weight, point), chance)
    drawn = {site: _at(v, point) for site, v in so_far.drawn.items()}
    drawn[draw.site] = np.moveaxis(values[outcome], 0, -1)
    origin = point
    if so_far.origin is not None:
        origin = so_far.origin[point]
    yield from _expand(rest, reads, lanes, replace(so_far, weight=weight, origin=origin, drawn=drawn))


def picked(reads: Reads, at: Array) -> Reads:
    """Return what is read at some of the points."""
    return {key: _at(value, at) for key, value in reads.items()}


def _at(values: Array, point: Array) -> Array:
    if values.shape[-1] == 1:
        return values
    return values[..., point]


def joint_outcomes(
    nodes: Sequence[Expression], reads: Reads, lanes: int, numbers: ProbabilityArithmetic = FLOATS
) -> Iterator[tuple[list[Array], Array, Array]]:
    """Yield the values of some nodes together, for every outcome of their finite draws at `lanes` points.

    Returns:
        Batches of values (*shape, N) of each node, points (N,) and probabilities (N,). Values may occur several times.
    """
    for branch in branches(draws(nodes), reads, lanes, numbers):
        if branch.origin is None:
            point = np.arange(lanes)
        else:
            point = branch.origin
        values = evaluate(nodes, branch.place(reads), drawn=branch.drawn)
        everywhere = [np.broadcast_to(v, (*v.shape[:-1], len(point))) for v in values]
        yield everywhere, point, np.broadcast_to(branch.weight, (len(point),))


def merge_outcomes(keys: Sequence[Array], weight: Array) -> tuple[list[Array], Array]:
    """Return distinct outcomes in order, the first key first, with their total probabilities.

    Args:
        keys: columns (N,) which together tell outcomes apart.
        weight: their probabilities (N,), floats or rationals.
    """
    if keys:
        order = np.lexsort(keys[::-1])
    else:
        order = np.arange(len(weight))
    keys = [key[order] for key in keys]
    weight = weight[order]
    fresh = np.zeros(len(weight), np.bool_)
    fresh[:1] = True
    for key in keys:
        fresh[1:] |= key[1:] != key[:-1]
    start = np.flatnonzero(fresh)
    total = weight
    if len(start) != len(weight):
        total = np.add.reduceat(weight, start)
    return [key[start] for key in keys], total


# -- one step of a finite task at many points at once -----------------------------------------------------------------


@dataclass(frozen=True)
class Outcomes:
    """The possible outcomes at some of the points.

    Each of `weight`, `code`, `outside` (None: nothing is outside), `reward` and `terminal` has M
    entries, or one for all. `origin` (M,) gives the point of each; None: one each.
    """

    weight: Array
    origin: Array | None
    code: Array
    outside: Array | None
    reward: Array
    terminal: Array

    def spread(self, lanes: int) -> tuple[Array, ...]:
        """Return points, codes, weights, rewards, ends and which are outside, (M,) each."""
        if self.origin is None:
            point = np.arange(lanes)
        else:
            point = self.origin
        outside = np.zeros(1, np.bool_)
        if self.outside is not None:
            outside = self.outside
        fields = (point, self.code, self.weight, self.reward, self.terminal, outside)
        return tuple(np.broadcast_to(x, (len(point),)) for x in fields)


class OutcomeTable(NamedTuple):
    """Outcomes (N,) of all actions in all states, in order of their rows.

    `row` is a*S + s, `column` the index of the next state, where that is `inside`; `ends` says which end the episode.
    """

    row: Array
    column: Array
    weight: Array
    reward: Array
    ends: Array
    inside: Array

    def by_step(self, states: int) -> dict[tuple[int, int], dict[tuple[int, float, bool], Any]]:
        """Return outcomes (next state, reward, end) with their probabilities, by state and action.

        Those outside of the states are left out, and equal ones are added up.

        Args:
            states: how many there are.
        """
        steps: dict[tuple[int, int], dict[tuple[int, float, bool], Any]] = {}
        for row, to, p, reward, ends, inside in zip(*(column.tolist() for column in self), strict=True):
            if not (inside and p):
                continue
            outcomes = steps.setdefault((row % states, row // states), {})
            outcome = (to, float(reward), bool(ends))
            if outcome in outcomes:
                outcomes[outcome] = outcomes[outcome] + p
            else:
                outcomes[outcome] = p
        return steps


class Steps:
    """The dynamics, reward and termination of a task whose states are finite, ready to be enumerated.

    The reward is the expected one; `as_paid`: what is paid, with the draws that are only in it.
    """

    def __init__(self, task: Task, as_paid: bool = False) -> None:
        self.task = task
        self.states = Space(task.state, Role.STATE)
        self.actions = Space(task.action, Role.ACTION)
        decisive = draws((*task.process.next, task.process.terminal))
        b = task.new_builder()
        if as_paid:
            self.reward = task.process.reward
        else:
            self.reward = expected(task.process.reward, b, decisive)
        self.roots = lumped((*task.process.raw_next, self.reward, task.process.terminal), b)
        self.first = lumped(task.process.raw_initial, b)

    @cached_property
    def draws(self) -> tuple[Draw, ...]:
        return draws(self.roots)

    @cached_property
    def names(self) -> frozenset[tuple[Role, str]]:
        return reads(self.roots)

    @cached_property
    def names_beside_draws(self) -> frozenset[tuple[Role, str]]:
        """Names of what a step reads once the values of all draws are known."""
        known = frozenset(id(node) for node in walk(self.roots) if isinstance(node, Draw))
        return frozenset((node.role, node.name) for node in walk(self.roots, known) if isinstance(node, Read))

    @property
    def uses_time(self) -> bool:
        return TIME in self.names

    @property
    def ends(self) -> bool:
        """True where some step may terminate."""
        return not self.task.process.never_ends

    @cached_property
    def branching(self) -> float:
        """An upper bound on the outcomes of one step; infinite where a draw is not finite."""
        return count(self.draws, {})

    def reads(self, states: Array, actions: Array, t: int | None) -> Reads:
        """Return what is read at points (N,) or (1,) of codes."""
        values = self.states.decode(states, self.names) | self.actions.decode(actions, self.names)
        if self.uses_time:
            values[TIME] = np.array([t], dtype=np.int64)
        return values

    def outcomes(
        self, states: Array, actions: Array, t: int | None = None, numbers: ProbabilityArithmetic = FLOATS
    ) -> Iterator[Outcomes]:
        """Yield every outcome of acting in states (N,) by actions (N,) or (1,) at time t."""
        lanes = len(states)
        given = self.reads(states, actions, t)
        needed = {name: given[name] for name in self.names_beside_draws}
        for branch in branches(self.draws, given, lanes, numbers):
            values = evaluate(self.roots, branch.place(needed), drawn=branch.drawn)
            size = lanes
            if branch.origin is not None:
                size = len(branch.origin)
            code, outside = self.states.encode(values[:-2], size)
            yield Outcomes(branch.weight, branch.origin, code, outside, values[-2], values[-1])

    def table(self, codes: Array, t: int, numbers: ProbabilityArithmetic = FLOATS) -> OutcomeTable:
        """Return every outcome of every action in some states (S,), sorted codes, at a time."""
        parts = []
        for a in range(self.actions.size):
            for listed in self.outcomes(codes, np.array([a]), t, numbers):
                point, code, weight, reward, ends, outside = listed.spread(len(codes))
                column = np.minimum(np.searchsorted(codes, code), len(codes) - 1)
                parts.append((a * len(codes) + point, column, weight, reward, ends, ~outside))
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        order = np.argsort(columns[0], kind="stable")
        return OutcomeTable(*(column[order] for column in columns))

    def start_weights(self) -> dict[int, float]:
        """Return the probabilities of the first states by their codes."""
        codes, weights = self.starts()
        return dict(zip(codes.tolist(), weights.tolist(), strict=True))

    def starts(self, numbers: ProbabilityArithmetic = FLOATS) -> tuple[Array, Array]:
        """Return codes (N,) of the first states and their probabilities (N,), each code once."""
        branching = outcome_count(self.first)
        most = limits().outcomes
        if branching == math.inf:
            refuse("the start is drawn from a distribution that has infinitely many outcomes")
        if branching > most:
            message = f"the start has up to {branching:,.0f} outcomes; the limit is {most:,}"
            too_large(message, how_to_raise("outcomes", branching))
        if self.states.size > MAX_CODES:
            too_large(f"there are {count_of(self.states.size)} states")
        codes = []
        weights = []
        for values, _, weight in joint_outcomes(self.first, {}, 1, numbers):
            code, outside = self.states.encode(values, len(weight))
            if outside is not None and outside.any():
                refuse("an episode can start outside the state space")
            codes.append(code)
            weights.append(weight)
        (first,), weight = merge_outcomes([np.concatenate(codes)], np.concatenate(weights))
        return first, weight


def total(which: Array, values: Array, size: int) -> Array:
    """Return sums (size,) of the values (N,) of each group, floats or rationals."""
    sums = np.zeros(size, values.dtype)
    np.add.at(sums, which, values)
    return sums
