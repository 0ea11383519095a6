"""The part of a finite task that episodes visit, as transitions: what a graph of it shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.base.limits import limits
from taskspec.lang.ir import Node, Read, Role, walk
from taskspec.model.transitions import Steps
from taskspec.registry import load
from taskspec.task.task import Task

MAX_STATES = 1500
MAX_TRANSITIONS = 20_000
MAX_ACTIONS = 100
MAX_CONSIDERED = 200_000
"""Outcomes that are looked at in one go: many more than a graph could show, and few enough to take a second."""


@dataclass(frozen=True, slots=True)
class Transition:
    source: int
    action: int
    target: int
    probability: float
    reward: float
    ends: bool


@dataclass(frozen=True)
class Machine:
    """States by code in the order of their discovery, and what can happen in each."""

    task: Task
    start: dict[int, float]
    states: tuple[int, ...]
    transitions: tuple[Transition, ...]
    ending: frozenset[int]
    n_actions: int
    starters: Mapping[int, str] = field(default_factory=dict)  # who starts where, in tasks with roles
    timed: bool = False  # episodes end by the time as well
    cut: frozenset[int] = frozenset()  # states first reached at the horizon, which further steps would leave


def explore(task: Task) -> Machine | None:
    """Return the states that episodes visit; None if they are many, or if dynamics or rewards depend on the time."""
    if not task.is_finite or any(is_time(node) for root in (*task.next, task.reward) for node in walk([root])):
        return None
    try:
        steps = Steps(task)
        if steps.branching > limits().outcomes or steps.actions.size > MAX_ACTIONS:
            return None
        starts = _starts(task, steps)
    except SpecError:
        return None
    first = {code: p for by in starts.values() for code, p in by.items()}
    found = _walk(steps, np.array(list(first)))
    if found is None:
        return None
    states, transitions, last = found
    ending = frozenset(t.target for t in transitions if t.ends)
    starters = {code: f"{who} starts" for who, by in starts.items() if who for code in by}
    return Machine(
        task, first, states, transitions, ending, steps.actions.size, starters, steps.uses_time, _cut(steps, last)
    )


def is_time(node: Node) -> bool:
    return isinstance(node, Read) and node.role is Role.TIME


def _starts(task: Task, steps: Steps) -> dict[str, dict[int, float]]:
    """Return probabilities of first states by role, or under "" if roles differ in more than where episodes start."""
    own = _weights(steps)
    given = {p.name: p.value for p in task.parameters if p.value != p.default}
    found: dict[str, dict[int, float]] = {}
    for who, key in task.roles.items():
        other = task if key == task.variant else load(task, key, **given)
        if (other.state, other.spec.dynamics) != (task.state, task.spec.dynamics):
            return {"": own}
        found[who] = own if other is task else _weights(Steps(other))
    codes = [code for by in found.values() for code in by]
    return found if len(set(codes)) == len(codes) and own in found.values() else {"": own}


def _weights(steps: Steps) -> dict[int, float]:
    start, weights = steps.starts()
    return dict(zip(start.tolist(), weights.tolist(), strict=True))


def _walk(steps: Steps, start: np.ndarray) -> tuple[tuple[int, ...], tuple[Transition, ...], list[int]] | None:
    """Search breadth first up to the horizon; return states, transitions, and the states first reached at the horizon."""
    seen: dict[int, None] = dict.fromkeys(start.tolist())
    level = list(seen)
    transitions = []
    depth = 0
    while level and (steps.task.horizon is None or depth < steps.task.horizon):
        if len(seen) > MAX_STATES or len(level) * steps.actions.size * steps.branching > MAX_CONSIDERED:
            return None
        new: dict[int, None] = {}
        for t in _from(steps, level):
            transitions.append(t)
            if t.target not in seen and not t.ends:
                new[t.target] = None
        ends = [t.target for t in transitions if t.ends]
        seen |= new | dict.fromkeys(e for e in ends if e not in seen)
        if len(transitions) > MAX_TRANSITIONS:
            return None
        level = list(new)
        depth = depth + 1
    return (tuple(seen), tuple(transitions), level) if len(seen) <= MAX_STATES else None


def _cut(steps: Steps, last: list[int]) -> frozenset[int]:
    """Return those states that some step leaves."""
    if not last or len(last) * steps.actions.size * steps.branching > MAX_CONSIDERED:
        return frozenset()
    try:
        return frozenset(t.source for t in _from(steps, last) if t.source != t.target)
    except SpecError:
        return frozenset()


def _from(steps: Steps, level: list[int]) -> Iterator[Transition]:
    """Return transitions out of some states, state by state and action by action."""
    actions = steps.actions.size
    sources = np.repeat(level, actions)
    choices = np.tile(np.arange(actions), len(level))
    found: list[Transition] = []
    for o in steps.outcomes(sources, choices, 0):
        origin = np.arange(len(sources)) if o.origin is None else o.origin
        columns = (o.code, o.weight, o.reward, o.terminal)
        code, p, reward, ends = (np.broadcast_to(x, origin.shape) for x in columns)
        for i, point in enumerate(origin.tolist()):
            if p[i] > 0:
                found.append(Transition(int(sources[point]), int(choices[point]), int(code[i]),
                                        float(p[i]), float(reward[i]), bool(ends[i])))  # fmt: skip
    rank = {code: i for i, code in enumerate(level)}
    return iter(sorted(_merged(found), key=lambda t: (rank[t.source], t.action)))


def _merged(found: list[Transition]) -> list[Transition]:
    """Return equal outcomes of one action, with their probabilities added."""
    total: dict[tuple[int, int, int, float, bool], float] = {}
    for t in found:
        key = (t.source, t.action, t.target, t.reward, t.ends)
        total[key] = total.get(key, 0.0) + t.probability
    return [Transition(a, b, c, p, reward, ends) for (a, b, c, reward, ends), p in total.items()]
