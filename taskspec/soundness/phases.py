"""The checks of a task as data: conditions on its start, observations, expert and steps, and the points of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.dists import DISTS
from taskspec.lang.interval import ranges
from taskspec.lang.ir import Const, Draw, Node, Role, draws, reads
from taskspec.lang.types import INF, Interval, Kind, Range
from taskspec.model.cost import Cost
from taskspec.model.lump import lumped
from taskspec.model.points import Grid, Samples, anew, are_related, columns, drawn
from taskspec.model.space import Reads, Space
from taskspec.model.transitions import count
from taskspec.rollout.rollout import entered, visited
from taskspec.soundness.places import SectionScope, Written, distributions
from taskspec.task.reach import over, reached
from taskspec.task.task import Component, Task


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
        """Return where (M,) values (*shape, M) are not allowed."""
        shape = self.node.type.shape
        axes = tuple(range(len(shape)))
        low = np.array(self.low if shape else self.low[0]).reshape(*shape, 1)
        high = np.array(self.high if shape else self.high[0]).reshape(*shape, 1)
        if self.node.type.kind is not Kind.REAL:
            return np.asarray(((value < low) | (value > high)).any(axis=axes))
        slack = (1e-6 if self.code == "E401" else 1e-9) * (1 + np.abs(np.where(np.isfinite(value), value, 0)))
        inside = (value >= low - slack) & (value <= high + slack) & np.isfinite(value)
        return np.asarray((~inside).any(axis=axes))

    def is_proved(self, known: dict[int, Range]) -> bool:
        """Return whether interval arithmetic proves it, from what is known of nodes by id, which it adds to."""
        found = ranges(self.node, known)
        return found.finite and found.low >= max(self.low, default=-INF) and found.high <= min(self.high, default=INF)


Points = Grid | Samples
MANY_TIMES = 1000
"""Times that are checked in a task without a horizon."""
MOST_OUTCOMES = 5000
"""Outcomes at one point up to which they are enumerated."""


@dataclass(frozen=True)
class CheckPhase:
    """Checks that share their points and their draws."""

    task: Task
    name: str
    checks: tuple[Check, ...]
    points: Points
    exact: bool

    @cached_property
    def roots(self) -> tuple[Node, ...]:
        return tuple(n for c in self.checks for n in (*c.guards, c.node))

    @cached_property
    def draws(self) -> tuple[Draw, ...]:
        return draws(self.roots)


def phases(task: Task, limit: int) -> Iterator[CheckPhase]:
    """Yield the phases of a task, with the checks that bounds do not prove."""
    episodes = _Episodes(task)
    yield _phase(episodes, "start", _start_checks(task), limit)
    yield _phase(episodes, "observation", _observation_checks(task), limit)
    yield _phase(episodes, "expert", _expert_checks(task) if task.memory is None else [], limit)
    yield _phase(episodes, "step", _step_checks(task), limit)
    if task.memory is not None:
        whole = task.remembering()
        remembering = _Episodes(whole)
        yield _phase(remembering, "start", _memory_checks(task, "E404", "", whole.raw_initial), limit)
        yield _phase(remembering, "expert", _expert_checks(whole), limit)
        yield _phase(remembering, "step", _memory_checks(task, "E403", "'", whole.raw_next), limit)


@dataclass
class _Episodes:
    """Bounds on the states of episodes, and states of samples of them; shared by phases."""

    task: Task

    @cached_property
    def reached(self) -> dict[str, Interval]:
        return reached(self.task.state, self.task.initial, self.task.next, self.task.horizon)

    @cached_property
    def acting(self) -> Reads:
        return visited(self.task)

    @cached_property
    def entered(self) -> Reads:
        return visited(self.task, ends=True)


def _phase(episodes: _Episodes, name: str, checks: Sequence[Check], limit: int) -> CheckPhase:
    task = episodes.task
    known: dict[int, Range] = {}
    left = tuple(c for c in checks if not c.is_proved(known))
    listed = _lumped(left)
    roots = [n for c in listed for n in (*c.guards, c.node)]
    outcomes = count(draws(roots), {})
    read = reads(roots)
    if name == "start":
        exact = outcomes <= limit and not read
        return CheckPhase(task, name, listed if exact else left, Samples({}, {}), exact)
    times = _times(task, name) if (Role.TIME, "t") in read else None
    if task.is_finite and outcomes <= MOST_OUTCOMES:
        actions = Space(task.action, Role.ACTION) if name == "step" else None
        grid = Grid(Space(task.state, Role.STATE), actions, times)
        if grid.size * outcomes <= min(limit, Cost(roots).affordable()):
            return CheckPhase(task, name, listed, grid, True)
    return _sampled(episodes, name, left)


def _lumped(checks: Sequence[Check]) -> tuple[Check, ...]:
    """Return the same checks over draws with merged outcomes, for enumeration."""
    roots = [n for c in checks for n in (*c.guards, c.node)]
    nodes = iter(lumped(roots, Builder.of(roots)))
    return tuple(replace(c, guards=tuple(next(nodes) for _ in c.guards), node=next(nodes)) for c in checks)


def _sampled(episodes: _Episodes, name: str, checks: tuple[Check, ...]) -> CheckPhase:
    """Return checks that bounds on episodes do not prove, at points that episodes visit and at others."""
    task = episodes.task
    left = tuple(c for c in checks if not c.is_proved(over([c.node], episodes.reached)))
    if not left:
        return CheckPhase(task, name, (), Samples({}, {}), True)
    rng = np.random.default_rng(1)
    ends = name == "observation"
    actions = [(Role.ACTION, c) for c in task.action]
    known = episodes.entered if ends else episodes.acting
    points = columns([known, anew(known, actions, rng)])
    others: Reads = {}
    if not are_related(task.state):
        everywhere = [(Role.STATE, c) for c in _within(task.state, episodes.reached)] + actions
        others = anew(entered(task, drawn(everywhere, _times(task, "step"), rng), False, rng), actions, rng)
        others = entered(task, others, True, rng) if ends and others else others
    return CheckPhase(task, name, left, Samples(points, others), False)


def _within(state: Sequence[Component], reached: Mapping[str, Interval]) -> Iterator[Component]:
    """Yield the components of a state, limited to the values that episodes reach."""
    for c in state:
        low, high = reached[c.name]
        near = replace(c, low=tuple(max(v, low) for v in c.low), high=tuple(min(v, high) for v in c.high))
        yield near if all(a <= b for a, b in zip(near.low, near.high, strict=True)) else c  # it begins outside


def _times(task: Task, name: str) -> range:
    last = MANY_TIMES if task.horizon is None else task.horizon
    return range(last + (name == "observation"))


# -- checks ---------------------------------------------------------------------------------------


def _start_checks(task: Task) -> list[Check]:
    values = [
        Check("E404", node, c.low, c.high, "initial", c.name, c)
        for c, node in zip(task.state, task.raw_initial, strict=True)
    ]
    return values + _drawn(task, "initial", task.initial)


def _observation_checks(task: Task) -> list[Check]:
    if task.observation.is_state:
        return []
    pairs = zip(task.observation.components, task.observation.nodes, strict=True)
    checks = [Check("E405", n, c.low, c.high, "observation", c.name, c) for c, n in pairs]
    return checks + _drawn(task, "observation", task.observation.nodes)


def _expert_checks(task: Task) -> list[Check]:
    if not isinstance(task.expert, tuple):
        return []
    experts = zip(task.action, task.expert, strict=True)
    checks = [Check("E409", n, c.low, c.high, "expert", c.name, c) for c, n in experts]
    return checks + _drawn(task, "expert", task.expert)


def _memory_checks(task: Task, code: str, prime: str, raw: Sequence[Node]) -> list[Check]:
    """Return checks of the first or the next values of a memory, the last components of the state."""
    assert task.memory is not None
    components = task.memory.components
    pairs = zip(components, raw[-len(components) :], strict=True)
    return [Check(code, n, c.low, c.high, "memory", c.name + prime, c) for c, n in pairs]


def _step_checks(task: Task) -> list[Check]:
    pairs = zip(task.state, task.raw_next, strict=True)
    checks = [Check("E403", n, c.low, c.high, "dynamics", c.name + "'", c) for c, n in pairs]
    checks.append(Check("E406", task.reward, (-math.inf,), (math.inf,), "reward", what="the reward"))
    for section in ("noise", "dynamics", "reward", "terminal"):
        checks += _drawn(task, section, (*task.next, task.reward, task.terminal))
    return checks


def entries(task: Task, section: str) -> list[tuple[str | None, s.Expr]]:
    """Return the expressions of a section with their names."""
    found = task.surface.sections.get(section)
    if found is None:
        return []
    pairs = list(found.items()) if isinstance(found, dict) else [(None, found)]
    return [(name, expr) for name, expr in pairs if expr is not None]


def _drawn(task: Task, section: str, roots: Sequence[Node]) -> list[Check]:
    """Return checks of the parameters of distributions in a section."""
    if not draws(roots):
        return []
    where = SectionScope(task, section)
    return [
        check
        for name, expr in entries(task, section)
        for written in distributions(expr, where)
        for check in _parameters(written, where, name)
    ]


_LEAST = 1e-300
"""The least number that counts as above 0."""


def _parameters(written: Written, where: SectionScope, entry: str | None) -> Iterator[Check]:
    match written.expr:
        case s.Weights(pairs=pairs):
            yield from _probabilities([p for _, p in pairs], written, where, entry)
        case s.Call(function="Categorical", args=(s.Weights(pairs=pairs),)):
            yield from _probabilities([p for _, p in pairs], written, where, entry)
        case s.Call(function="Categorical", args=(p,)):
            yield from _probabilities([p], written, where, entry)
        case s.Call() as call if call.function in DISTS:
            yield from _of_call(call, written, where, entry)


def _probabilities(exprs: list[s.Expr], written: Written, where: SectionScope, entry: str | None) -> Iterator[Check]:
    """Yield checks that probabilities are between 0 and 1, and sum to 1."""
    nodes = [where.number(e) for e in exprs]
    if any(n is None or draws([n]) for n in nodes) or all(isinstance(n, Const) for n in nodes):
        return
    b = where.builder
    found = [b.cast(n, Kind.REAL) for n in nodes if n is not None]
    total = b.apply("sum", found[0] if found[0].type.shape else b.structure("vector", found))
    for expr, node in zip(exprs, found, strict=True):
        ends = (0.0,) * node.type.size, (1.0,) * node.type.size
        yield _check("E402", node, *ends, written, where, entry, "a probability", expr)
    what = "the sum of the probabilities"
    yield _check("E401", total, (1.0,), (1.0,), written, where, entry, what, written.expr)


def _of_call(call: s.Call, written: Written, where: SectionScope, entry: str | None) -> Iterator[Check]:
    arguments = {a.name: a for a in DISTS[call.function].arguments}
    given = dict(zip(arguments, call.args, strict=False)) | dict(call.keywords)
    for name, expr in given.items():
        node = where.number(expr) if name in arguments and not isinstance(expr, s.SetOf | s.Comprehension) else None
        if node is None or isinstance(node, Const) or draws([node]):
            continue
        argument = arguments[name]
        ends = (argument.low + argument.open * _LEAST,) * node.type.size, (argument.high,) * node.type.size
        code = "E402" if argument.is_probability else "E408"
        yield _check(code, node, *ends, written, where, entry, f"'{name}' of {call.function}", expr)
    if {"low", "high"} <= given.keys():
        yield from _ordered(given["low"], given["high"], call, written, where, entry)


def _ordered(
    low: s.Expr, high: s.Expr, call: s.Call, written: Written, where: SectionScope, entry: str | None
) -> Iterator[Check]:
    bottom = where.number(low)
    top = where.number(high)
    if bottom is None or top is None or draws([bottom, top]):
        return
    width = where.builder.apply("sub", top, bottom)
    if not isinstance(width, Const):
        ends = (0.0,) * width.type.size, (math.inf,) * width.type.size
        what = f"'high' - 'low' of {call.function}"
        yield _check("E408", width, *ends, written, where, entry, what, call)


def _check(
    code: str, node: Node, low: tuple[float, ...], high: tuple[float, ...],
    written: Written, where: SectionScope, entry: str | None, what: str, place: s.Expr,
) -> Check:  # fmt: skip
    return Check(code, node, low, high, where.name, entry, None, place, written.guards, what)
