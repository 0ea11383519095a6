"""Indices that lie outside their vector in some episode, and are moved to the nearest end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted
from taskspec.exact.model.space import Reads, shown, words
from taskspec.exact.simulation.rollout import visited
from taskspec.lang.basechecker import ClampedIndex
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Node, Role, children, reads, walk
from taskspec.lang.variates.layout import WordLayout
from taskspec.lang.variates.sample import batch_sampler
from taskspec.task.task import Task

Array = np.ndarray[Any, Any]
POINTS = 100_000
"""States, actions and times that are looked at, at most."""
BATCH = 4096


def moved(case: Linted, collector: Collector) -> None:
    """W510: an index that lies outside in a state in which episodes act, where its value matters."""
    task = case.task
    left = {id(m.node): m for m in task.surface.moved}
    for roots in (task.observation.nodes, _expert(task), (*task.raw_next, task.reward, task.terminal)):
        found = [left[id(n)] for n in walk(roots) if id(n) in left]
        for points in _points(case, roots) if found else ():
            for each in _outside(roots, found, points, task):
                del left[id(each[0].node)]
                _report(*each, collector)
            found = [m for m in found if id(m.node) in left]


def _expert(task: Task) -> tuple[Node, ...]:
    return task.expert if isinstance(task.expert, tuple) else ()


def _report(m: ClampedIndex, index: int, reads: Reads, task: Task, collector: Collector) -> None:
    components = ((r, c) for r, cs in ((Role.STATE, task.state), (Role.ACTION, task.action)) for c in cs)
    where = [f"{c.name} = {shown(c, reads[r, c.name][..., 0])}" for r, c in components if (r, c.name) in reads]
    where += [f"t = {words(int(v[0]))}" for (r, _), v in reads.items() if r is Role.TIME]
    place = f"for {', '.join(where)}, " if where else ""
    end = 0 if index < 0 else m.length - 1
    message = f"{place}this index is {index}; it is moved to {end}, the nearest of 0 ... {m.length - 1}"
    collector.add("W510", m.place, message, "if this is intended, write `clip(i, 0, n - 1)`")


# -- points -------------------------------------------------------------------------------------------------------


def _points(case: Linted, roots: Sequence[Node]) -> Iterator[Reads]:
    """What is read where episodes act: all of it where there is an exact model, samples elsewhere."""
    model, read = case.model, reads(roots)
    if model is None:
        found = visited(case.task)
        yield from _batches({k: v for k, v in found.items() if k in read}, max(v.shape[-1] for v in found.values()))
        return
    timed = (Role.TIME, "t") in read
    acts = any(role is Role.ACTION for role, _ in read)
    left = POINTS
    for t, level in model.levels() if timed or model.is_timed else [(0, model.acting)]:
        codes = model.codes[level]
        every = np.arange(len(codes) * (model.actions.size if acts else 1))[: max(0, left)]
        left -= len(every)
        point = model.states.decode(codes[every % len(codes)], read) | model.actions.decode(every // len(codes), read)
        yield from _batches(point | ({(Role.TIME, "t"): np.array([t])} if timed else {}), len(every))


def _batches(found: Mapping[Any, Array], lanes: int) -> Iterator[Reads]:
    for low in range(0, lanes, BATCH):
        yield {k: v if v.shape[-1] == 1 else v[..., low : low + BATCH] for k, v in found.items()}


# -- what matters there -------------------------------------------------------------------------------------------


def _outside(
    roots: Sequence[Node], found: Sequence[ClampedIndex], points: Reads, task: Task
) -> Iterator[tuple[ClampedIndex, int, Reads, Task]]:
    """The indices that lie outside at a point where they matter: the value, and what is read there."""
    lanes = max((v.shape[-1] for v in points.values()), default=1)
    layout = WordLayout.of(roots)
    sample = batch_sampler(layout, np.random.default_rng(0).integers(0, 2**32, (layout.count, lanes), dtype=np.uint32))
    order = list(walk(roots))
    asked = [n for n in order if _choice(n)]
    values = evaluate([*(n.args[0] for n in asked), *(m.index for m in found)], points, sample)  # type: ignore[union-attr]
    needed = _needed(roots, order, dict(zip(map(id, asked), values, strict=False)), lanes)
    for m, value in zip(found, values[len(asked) :], strict=True):
        rows = np.broadcast_to(value.reshape(-1, value.shape[-1]), (m.index.type.size, lanes))
        wrong = ((rows < 0) | (rows >= m.length)) & needed[id(m.node)]
        if wrong.any():
            row, lane = (int(i[0]) for i in np.nonzero(wrong))
            here = reads([m.index])
            at = {k: v if v.shape[-1] == 1 else v[..., lane : lane + 1] for k, v in points.items() if k in here}
            yield m, int(rows[row, lane]), at, task


def _choice(node: Node) -> bool:
    """Whether the first argument decides which of the others matter."""
    return isinstance(node, Apply) and node.op in ("where", "and", "or") and node.type.is_scalar


def _needed(
    roots: Iterable[Node], order: Sequence[Node], conditions: Mapping[int, Array], lanes: int
) -> dict[int, Array]:
    """For every node the points at which its value matters: not in a branch that is not taken."""
    needed = {id(n): np.zeros(lanes, np.bool_) for n in order} | {id(r): np.ones(lanes, np.bool_) for r in roots}
    for node in reversed(order):
        here = needed[id(node)]
        each: Sequence[Any] = [here] * len(children(node))
        if id(node) in conditions and isinstance(node, Apply):
            holds = conditions[id(node)]
            each = [here, here & (~holds if node.op == "or" else holds), here & ~holds]
        for child, matters in zip(children(node), each, strict=False):
            needed[id(child)] = needed[id(child)] | matters
    return needed
