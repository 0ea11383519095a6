"""The checks of a task as data, and their evaluation: conditions on its start, observations, expert and steps, at all points."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.base.named import entries_by_name
from taskspec.exact.model.extract import Visits, successors, visits
from taskspec.exact.model.lump import lumped
from taskspec.exact.model.points import Batch, Cost, Grid, Method, Samples, columns, drawn, resampled
from taskspec.exact.model.space import Reads, Space, distinct, holds, union, without
from taskspec.exact.model.transitions import Branch, Steps, branches, count, is_finite, outcome_count
from taskspec.exact.rollout.rollout import Visited, entered, visited
from taskspec.exact.soundness.places import SectionScope, Written, distributions
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import DISTS
from taskspec.language.expressions.interval import ranges
from taskspec.language.expressions.ir import Const, Draw, Node, are_constant, draws, reads
from taskspec.language.expressions.types import INF, TIME, Interval, Kind, Range, Role, total_size
from taskspec.language.expressions.variates import WordLayout, batch_sampler
from taskspec.language.task.parts import Component, by_read
from taskspec.language.task.reach import over, reach
from taskspec.language.task.task import Task

MANY_TIMES = 1000
"""Times that are checked in a task without a horizon."""
MOST_OUTCOMES = 5000
"""Outcomes at one point up to which they are enumerated."""
FEW_OUTCOMES = 64
"""The same where points are samples."""
BATCH = 65_536
"""Points that are evaluated at once."""
MOST_WORDS = 2_000_000
"""Random words that are drawn at once."""
STARTS = 1024
"""First states that are sampled where they are not enumerated."""
SEARCH = 20_000_000
"""Outcomes up to which all states that episodes visit are searched."""
SEARCH_STARTS = 200_000
"""Outcomes of the start up to which they are."""
NEVER = 3
"""The rank of counterexamples that do not count."""
LEAST = 1e-300
"""The least number that counts as above 0."""


@dataclass(frozen=True, eq=False)
class Check:
    """A condition at every point: `node` is a number between `low` and `high`.

    Args:
        section, entry: the place of its expression.
        subject: the component whose value it is.
        place: of the expression, where it is known.
        guards: conditions under which the check applies.
        what: the value in words.
    """

    code: str
    node: Node
    low: tuple[float, ...]
    high: tuple[float, ...]
    section: str
    entry: str | None = None
    subject: Component | None = None
    place: s.Expr | None = None
    guards: tuple[Node, ...] = ()
    what: str = ""

    def wrong(self, value: Array) -> Array:
        """Mark values (*shape, M) that are not allowed: bool (M,)."""
        shape = self.node.type.shape
        axes = tuple(range(len(shape)))
        low = np.array(self.low).reshape(*shape, 1)
        high = np.array(self.high).reshape(*shape, 1)
        if self.node.type.kind is not Kind.REAL:
            return np.asarray(((value < low) | (value > high)).any(axis=axes))
        tolerance = 1e-9
        if self.code == "E401":
            tolerance = 1e-6
        slack = tolerance * (1 + np.abs(np.where(np.isfinite(value), value, 0)))
        inside = (value >= low - slack) & (value <= high + slack) & np.isfinite(value)
        return np.asarray((~inside).any(axis=axes))

    def is_proved(self, known: dict[int, Range]) -> bool:
        """Prove the check by interval arithmetic, if possible; ranges of nodes are added to those known, by id."""
        bounds = ranges(self.node, known)
        return (
            bounds.finite and bounds.low >= max(self.low, default=-INF) and bounds.high <= min(self.high, default=INF)
        )


@dataclass(frozen=True)
class CheckPhase:
    """Checks that share their points and their draws; `exact` if all points are among them."""

    task: Task
    name: str
    checks: tuple[Check, ...]
    points: Grid | Samples
    exact: bool


def phases(task: Task, limit: int) -> Iterator[CheckPhase]:
    """Yield the phases of a task, with the checks that bounds do not prove."""
    phase = PhaseBuilder(task, limit).phase
    start = _values("E404", "initial", task.state, task.process.raw_initial)
    yield phase("start", start + _drawn(task, "initial", task.process.initial))
    seen = task.observation
    observation = []
    if not seen.is_state:
        observation = _values("E405", "observation", seen.components, seen.nodes)
        observation += _drawn(task, "observation", seen.nodes)
    yield phase("observation", observation)
    some = [task.new_builder().apply("any", mask) for mask in task.mask]
    yield phase("legal", [Check("E412", node, (1,), (1,), "legal") for node in some])
    expert = []
    if not task.annotations.memory:
        expert = _expert_checks(task)
    yield phase("expert", expert)
    steps = _values("E403", "dynamics", task.state, task.process.raw_next, "'")
    steps.append(Check("E406", task.process.reward, (-INF,), (INF,), "reward", what="the reward"))
    for name, node in task.process.measures.items():
        steps.append(Check("E406", node, (-INF,), (INF,), "measures", name, what=f"the measure '{name}'"))
    for section in ("noise", "dynamics", "reward", "terminal", "measures"):
        steps += _drawn(task, section, task.process.step_roots)
    yield phase("step", steps)
    if task.annotations.memory is not None:
        whole = task.remembering()
        remembered = task.annotations.memory.declared
        own = slice(len(task.state), len(task.state) + len(remembered))
        phase = PhaseBuilder(whole, limit).phase
        yield phase("start", _values("E404", "memory", remembered, whole.process.raw_initial[own]))
        yield phase("expert", _expert_checks(whole))
        yield phase("step", _values("E403", "memory", remembered, whole.process.raw_next[own], "'"))


# -- points ---------------------------------------------------------------------------------------


@dataclass
class PhaseBuilder:
    """Makes the phases of a task; bounds on the states of episodes, and samples of them, are shared by all.

    `limit` is the number of points and outcomes up to which all are checked.
    """

    task: Task
    limit: int

    @cached_property
    def reached(self) -> dict[str, Interval]:
        process = self.task.process
        return reach(self.task.state, process.initial, process.next, self.task.horizon, tight=True)

    @cached_property
    def visited(self) -> Visited:
        return visited(self.task)

    def phase(self, name: str, checks: Sequence[Check]) -> CheckPhase:
        """Select the checks that bounds do not prove: at all points of a finite task, otherwise at samples."""
        task = self.task
        known: dict[int, Range] = {}
        left = tuple(c for c in checks if not c.is_proved(known))
        roots = roots_of(left)
        nodes = lumped(roots, Builder.of(roots))
        merged: list[Check] = []
        first = 0
        for check in left:
            last = first + len(check.guards)
            merged.append(replace(check, guards=tuple(nodes[first:last]), node=nodes[last]))
            first = last + 1
        outcomes = outcome_count(nodes)
        read = reads(nodes)
        if name == "start":
            is_exact = outcomes <= self.limit and not read
            if is_exact:
                left = tuple(merged)
            return CheckPhase(task, name, left, Samples({}, {}), is_exact)
        if task.is_finite and outcomes <= MOST_OUTCOMES:
            actions = None
            if name == "step":
                actions = Space(task.action, Role.ACTION)
            times = None
            if TIME in read:
                times = self._times(name)
            grid = Grid(Space(task.state, Role.STATE), actions, times)
            if grid.size * outcomes <= min(self.limit, Cost(nodes).affordable()):
                return CheckPhase(task, name, tuple(merged), grid, True)
        left = tuple(c for c in left if not c.is_proved(over([c.node], self.reached)))
        if not left:
            return CheckPhase(task, name, (), Samples({}, {}), True)
        return CheckPhase(task, name, left, self._samples(name == "observation"), False)

    def _times(self, name: str) -> range:
        last = MANY_TIMES
        if self.task.horizon is not None:
            last = self.task.horizon
        return range(last + (name == "observation"))

    def _samples(self, ends: bool) -> Samples:
        """Return points that episodes visit, and others; with the states in which they end for observations."""
        task = self.task
        rng = np.random.default_rng(1)
        actions = [(Role.ACTION, c) for c in task.action]
        if ends:
            known = self.visited.entered
        else:
            known = self.visited.acting
        points = columns([known, resampled(known, actions, rng)])
        has_reals = any(c.type.kind is Kind.REAL for c in task.state)
        if has_reals and total_size(task.state) > 1:
            return Samples(points, {})
        everywhere = [(Role.STATE, self._limited(c)) for c in task.state] + actions
        starts = entered(task, drawn(everywhere, self._times("step"), rng), False, rng)
        others = resampled(starts, actions, rng)
        if ends and others:
            others = entered(task, others, True, rng)
        return Samples(points, others)

    def _limited(self, c: Component) -> Component:
        low, high = self.reached[c.name]
        near = replace(c, low=tuple(max(v, low) for v in c.low), high=tuple(min(v, high) for v in c.high))
        if all(a <= b for a, b in zip(near.low, near.high, strict=True)):
            return near
        return c  # it begins outside


# -- checks ---------------------------------------------------------------------------------------


def roots_of(checks: Sequence[Check]) -> tuple[Node, ...]:
    roots: list[Node] = []
    for check in checks:
        roots += [*check.guards, check.node]
    return tuple(roots)


def _values(
    code: str, section: str, components: Sequence[Component], nodes: Sequence[Node], prime: str = ""
) -> list[Check]:
    checks = []
    for c, node in zip(components, nodes, strict=True):
        checks.append(Check(code, node, c.low, c.high, section, c.name + prime, c))
    return checks


def _expert_checks(task: Task) -> list[Check]:
    if not isinstance(task.annotations.expert, tuple):
        return []
    checks = _values("E409", "expert", task.action, task.annotations.expert)
    legal = task.process.legal
    if legal is not None:
        chosen = by_read(Role.ACTION, task.action, task.annotations.expert)
        (node,) = task.new_builder().substitute([legal], chosen)
        checks.append(Check("E413", node, (1,), (1,), "expert", task.action[0].name))
    return checks + _drawn(task, "expert", task.annotations.expert)


def entries(task: Task, section: str) -> list[tuple[str | None, s.Expr]]:
    """List the expressions of a section with their names; None for the name of a section that is one expression."""
    written = task.source.surface.sections.get(section)
    if not isinstance(written, dict):
        written = {None: written}
    return [(name, expr) for name, expr in written.items() if expr is not None]


def _drawn(task: Task, section: str, roots: Sequence[Node]) -> list[Check]:
    if not draws(roots):
        return []
    checks: list[Check] = []
    where = SectionScope(task, section)
    for name, expr in entries(task, section):
        for written in distributions(expr, where):
            checks += _Parameters(name, written).checks()
    return checks


@dataclass(frozen=True)
class _Parameters:
    """A distribution in an entry of a section, whose parameters are checked."""

    entry: str | None
    written: Written

    @property
    def where(self) -> SectionScope:
        return self.written.section

    def checks(self) -> Iterator[Check]:
        match self.written.expr:
            case s.Weights(pairs=pairs) | s.Call(function="Categorical", args=(s.Weights(pairs=pairs),)):
                yield from self._probabilities([p for _, p in pairs])
            case s.Call(function="Categorical", args=(p,)):
                yield from self._probabilities([p])
            case s.Call() as call if call.function in DISTS:
                yield from self._of_call(call)

    def _probabilities(self, exprs: list[s.Expr]) -> Iterator[Check]:
        b = self.where.builder
        probabilities = [b.cast(n, Kind.REAL) for n in map(self.where.number, exprs) if n is not None]
        if len(probabilities) < len(exprs) or are_constant(probabilities):
            return
        terms = probabilities[0]
        if not terms.type.shape:
            terms = b.structure("vector", probabilities)
        for expr, node in zip(exprs, probabilities, strict=True):
            yield self._check("E402", node, 0.0, 1.0, "a probability", expr)
        yield self._check("E401", b.apply("sum", terms), 1.0, 1.0, "the sum of the probabilities", self.written.expr)

    def _of_call(self, call: s.Call) -> Iterator[Check]:
        arguments = entries_by_name(DISTS[call.function].arguments)
        nodes = {}
        for name, expr in (dict(zip(arguments, call.args, strict=False)) | dict(call.keywords)).items():
            if name not in arguments or isinstance(expr, s.SetOf | s.Comprehension):
                continue
            node = self.where.number(expr)
            if node is None:
                continue
            nodes[name] = node
            if not isinstance(node, Const):
                argument = arguments[name]
                code = "E408"
                if argument.is_probability:
                    code = "E402"
                low = argument.low + argument.open * LEAST
                yield self._check(code, node, low, argument.high, f"'{name}' of {call.function}", expr)
        if {"low", "high"} <= nodes.keys():
            width = self.where.builder.apply("sub", nodes["high"], nodes["low"])
            if not isinstance(width, Const):
                yield self._check("E408", width, 0.0, math.inf, f"'high' - 'low' of {call.function}", call)

    def _check(self, code: str, node: Node, low: float, high: float, what: str, place: s.Expr) -> Check:
        ends = ((low,) * node.type.size, (high,) * node.type.size)
        return Check(code, node, *ends, self.where.name, self.entry, None, place, self.written.guards, what)


# -- evaluation -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Violation:
    """A check that fails: the values that are read at the counterexample (batch axis of one), and the wrong value.

    `acting` is whether an episode acts in that state; None: unknown.
    """

    check: Check
    reads: Reads
    value: Array
    acting: bool | None


class Examination:
    """The checks of one phase, evaluated at its points."""

    def __init__(self, phase: CheckPhase) -> None:
        self.phase = phase
        self.task = phase.task
        self.roots = roots_of(phase.checks)
        self.draws = draws(self.roots)
        self.layout = WordLayout.of(self.roots)
        self.rng = np.random.default_rng(1)

    @cached_property
    def enumerated(self) -> tuple[Draw, ...]:
        """Draws that are enumerated: finite ones with few outcomes, whose arguments are not sampled."""
        chosen: list[Draw] = []
        most = FEW_OUTCOMES
        outcomes = count(self.draws, {})
        if self.phase.exact and outcomes < INF:
            most = max(most, int(outcomes))
        for draw in self.draws:
            is_ready = set(draws(draw.args)) <= set(chosen)
            if is_finite(draw) and is_ready and count([*chosen, draw], {}) <= most:
                chosen.append(draw)
        return tuple(chosen)

    @property
    def method(self) -> Method:
        if not self.phase.checks:
            return Method(True, 0)
        exact = self.phase.exact and len(self.enumerated) == len(self.draws)
        if self.phase.name == "start":
            starts = STARTS
            if exact:
                starts = int(max(1, count(self.draws, {})))
            return Method(exact, starts)
        points = self.phase.points
        states = None
        if isinstance(points, Grid):
            states = points.states.size
        return Method(exact, points.size, states)

    def batches(self) -> Iterator[Batch]:
        cost = Cost(self.roots)
        if self.phase.name == "start":
            lanes = STARTS
            if len(self.enumerated) == len(self.draws):
                lanes = 1
            yield Batch({}, cost.batch(lanes), None, True)
            return
        outcomes = max(1.0, count(self.enumerated, {}))
        most = min(BATCH, BATCH * 4 // outcomes, MOST_WORDS // max(1, self.layout.count))
        yield from self.phase.points.batches(cost.batch(max(256, most)))

    def flagged(self, batch: Batch) -> Iterator[tuple[Check, Branch, Array, Array]]:
        """Yield checks that fail in a batch: the branch, where (M,) it fails, and the values."""
        words = self.rng.integers(0, 2**32, (self.layout.count, batch.lanes), dtype=np.uint32)
        for branch in branches(self.enumerated, batch.reads, batch.lanes):
            here = words
            if branch.origin is not None:
                here = words[:, branch.origin]
            sample = batch_sampler(self.layout, here)
            values = iter(evaluate(self.roots, branch.place(batch.reads), sample, branch.drawn))
            for check in self.phase.checks:
                guards = [next(values) for _ in check.guards]
                value = next(values)
                wrong = check.wrong(value)
                if wrong.any():
                    flags = np.logical_and.reduce(np.broadcast_arrays(wrong, *guards))
                    if flags.any():
                        yield check, branch, flags, value

    def violations(self) -> Iterator[Violation]:
        """Yield the best counterexample to each check that fails: in a state in which episodes act, if there is one."""
        best: dict[Check, tuple[tuple[int, int], Violation]] = {}
        if not self.phase.checks:
            return
        for batch in self.batches():
            for check, branch, flags, value in self.flagged(batch):
                if branch.origin is None:
                    points = np.arange(batch.lanes)
                else:
                    points = branch.origin
                outcomes = np.flatnonzero(np.broadcast_to(flags, points.shape))
                points = points[outcomes]
                first = 0
                acting = batch.acting
                key = (0, 0)
                if batch.states is not None:
                    states = batch.states[points]
                    rank = self._rank(check, states)
                    first = int(np.lexsort((states, rank))[0])
                    key = (int(rank[first]), int(states[first]))
                    acting = {0: True, 1: False}.get(key[0])
                if key[0] < NEVER and (check not in best or key < best[check][0]):
                    reads = {k: _at(v, int(points[first])) for k, v in batch.reads.items()}
                    best[check] = (key, Violation(check, reads, _at(value, int(outcomes[first])), acting))
        for _, violation in best.values():
            yield violation

    def _rank(self, check: Check, states: Array) -> Array:
        """Return for states (N,) 0 if episodes act there, 1 if they do not, 2 if it is unknown, `NEVER` if they do not count."""
        if self.visits is None:
            return np.where(holds(states, self._seen), 0, 2)
        if self.phase.name == "observation":
            return np.where(holds(states, self.visits.entered), 0, 1)
        acting = holds(states, self.visits.acting)
        if acting.any():
            return np.where(acting, 0, 1)
        if check.section in ("expert", "legal"):  # nobody acts there
            return np.full(len(states), NEVER)
        return np.where(holds(states, self._finished), NEVER, 1)

    @cached_property
    def visits(self) -> Visits | None:
        """The states of all episodes; None if the search would take too long, or not end."""
        steps = Steps(self.task)
        times = 1
        if steps.uses_time:
            if self.task.horizon is None:
                return None
            times = max(1, self.task.horizon)
        cost = float(steps.states.size) * steps.actions.size * steps.branching * times
        if cost > SEARCH or outcome_count(steps.first) > SEARCH_STARTS:
            return None
        try:
            return visits(steps)
        except SpecError:
            return None

    @cached_property
    def _seen(self) -> Array:
        """States of a few episodes, for tasks in which the search for all of them costs too much."""
        episodes = visited(self.task)
        states = episodes.acting
        if self.phase.name == "observation":
            states = episodes.entered
        space = Space(self.task.state, Role.STATE)
        codes, _ = space.encode([states[c.read] for c in self.task.state], states[TIME].shape[-1])
        return distinct(codes)

    @cached_property
    def _finished(self) -> Array:
        """States that only a step which ends the episode can enter: no action is taken there."""
        if isinstance(self.task.process.terminal, Const) or not isinstance(self.phase.points, Grid):
            return np.zeros(0, np.int64)
        steps = Steps(self.task)
        every = np.arange(steps.states.size)
        entered = [steps.starts()[0]]
        ended = []
        for t in self.phase.points.times or (0,):
            going, stopped = successors(steps, every, t)
            entered.append(going)
            ended.append(stopped)
        return without(union(ended), union(entered))


def _at(values: Array, lane: int) -> Array:
    if values.shape[-1] == 1:
        return values
    return values[..., lane : lane + 1]
