"""Warnings about symmetries and abstractions that show nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, SpecError
from taskspec.check.case import Linted
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Node, Read, Role, reads
from taskspec.lang.types import Kind
from taskspec.lang.variates.sample import WordLayout, batch_sampler
from taskspec.modifiers import modify
from taskspec.rollout.rollout import Choose, State, by_expert, reads_of
from taskspec.rollout.simulate import simulate
from taskspec.scores.returns import normalised
from taskspec.task.task import Component, Task

# ---------- symmetries
# Symmetries that tell nothing: the twin is solved by what solves the task as it is printed.

ALIKE = 0.9
"""The score from which on a task counts as solved."""
EPISODES = 200


def idle(case: Linted, collector: Collector) -> None:
    """W525: the expert of the task as printed does in a twin about as well as in the task."""
    task = case.task
    places = dict(_places(task))
    if not task.symmetries or not isinstance(task.expert, tuple) or task.memory is not None or task.modifiers:
        return
    if {name for role, name in reads(task.expert) if role is Role.STATE} - places.keys():
        return  # the expert knows more than it sees
    expert, random = (case.results.sample(which, EPISODES) for which in ("expert", "random"))
    for symmetry in task.symmetries if expert is not None and random is not None else ():
        try:
            twin = modify(task, {"symmetry": symmetry.name})
            found = float(simulate(twin, _as_printed(task, twin, places), EPISODES).mean())
        except SpecError:
            continue  # it is no symmetry, and reported as that
        assert expert is not None and random is not None
        score = normalised(found, random.value, expert.value, None)
        if score >= ALIKE:
            message = f"in the twin by '{symmetry.name}' the expert of the task as it is printed scores {score:.2f}"
            hint = (
                "leave out the map of the action, or the other one"
                if symmetry.observation and symmetry.action
                else None
            )
            collector.add("W525", case.key("symmetries", symmetry.name), message, hint)


def _places(task: Task) -> Iterator[tuple[str, tuple[int, Component]]]:
    """Where components of the state stand in the observation as one vector."""
    state, at = {c.name: c for c in task.state}, 0
    for c, node in zip(task.observation.components, task.observation.nodes, strict=True):
        shown = _bare(node)
        if isinstance(shown, Read) and shown.role is Role.STATE:
            yield shown.name, (at, state[shown.name])
        at += c.type.size


def _bare(node: Node) -> Node:
    while isinstance(node, Apply) and node.op in ("to_real", "to_int"):
        node = node.args[0]
    return node


def _as_printed(task: Task, twin: Task, places: Mapping[str, tuple[int, Component]]) -> Choose:
    """The expert of a task that takes what a twin shows for what the task shows."""
    nodes, expert = twin.observation.nodes, by_expert(task)
    layout = WordLayout.of(nodes)

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        words = rng.integers(0, 2**32, (layout.count, lanes), dtype=np.uint32)
        values = evaluate(nodes, reads_of(state, {}, t), batch_sampler(layout, words))
        rows = np.concatenate([np.broadcast_to(v, (*v.shape[:-1], lanes)).reshape(-1, lanes) for v in values])
        needed = max(at + c.type.size for at, c in places.values())
        rows = np.concatenate([rows, np.zeros((max(0, needed - len(rows)), lanes))])  # where a twin shows less
        return expert({n: _value(c, rows[at : at + c.type.size]) for n, (at, c) in places.items()}, t, rng)

    return choose


def _value(c: Component, rows: Array) -> Array:
    """Elements (size, lanes) as a value of a component, the nearest one where they are none."""
    lanes = rows.shape[-1]
    if c.type.kind is not Kind.REAL:
        low, high = (np.array(ends).reshape(-1, 1) for ends in (c.low, c.high))
        rows = np.rint(np.clip(rows, low, high)).astype(np.bool_ if c.type.kind is Kind.BOOL else np.int64)
    return rows.reshape(*c.type.shape, lanes)


# ---------- abstractions
# Abstractions that solve nothing.


def endless(case: Linted, collector: Collector) -> None:
    """W522: a component of the stand-in that has infinitely many values, so that there is no exact model of it."""
    found = case.results.abstraction
    for c in () if found is None else found.stand_in.state:
        if not c.is_finite:
            message = f"'{c.name}' has infinitely many values, so the abstraction gives no exact results"
            collector.add(
                "W522", case.key("abstraction", "state", c.name), message, "declare an int with `low` and `high`"
            )
