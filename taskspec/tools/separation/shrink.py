"""Smaller versions of a task in tables: fewer states, actions, steps and outcomes, and plainer numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import compress

from taskspec.exact.solve.outcomes import Outcome
from taskspec.tools.exchange.frozen_task import FrozenTask, Rows, visited

Holds = Callable[[Sequence[FrozenTask]], Sequence[bool]]
"""From several tasks to whether what matters holds on each of them."""
BATCH = 4
"""Tasks that are asked about at a time."""


def shrink(task: FrozenTask, holds: Holds, is_over: Callable[[], bool]) -> list[FrozenTask]:
    """Return ever smaller tasks on which something holds, the given one first.

    Of the smaller versions of a task the first one is taken on which it holds, until there is none (after delta debugging, Zeller
    and Hildebrandt 2002).

    Args:
        is_over: whether there is no time left.
    """
    path = [task]
    while not is_over():
        candidates = list(smaller(path[-1]))
        held: list[FrozenTask] = []
        for i in range(0, len(candidates), BATCH):
            batch = candidates[i : i + BATCH]
            held = list(compress(batch, holds(batch)))
            if held or is_over():
                break
        if not held:
            return path
        path.append(held[0])
    return path


def size(task: FrozenTask) -> tuple[int, ...]:
    """Return how large a task is; what comes first counts most."""
    rows = 0
    for by_action in task.outcomes:
        rows += len(set(by_action))
    outcomes = paid = ends = others = 0
    for _, _, outcome in task.steps():
        outcomes += 1
        paid += outcome.reward != 0
        ends += outcome.ends
        others += abs(outcome.reward) not in (0, 1)
    sizes = (len(task.states), len(task.actions), task.horizon or 0, len(task.starts))
    return (*sizes, outcomes, rows, paid, ends, others)


def smaller(task: FrozenTask) -> Iterator[FrozenTask]:
    """Yield smaller versions of a task, those that lack most first."""
    seen = set()
    for change in (_fewer_states, _fewer_actions, _fewer_steps, _one_start, _fewer_outcomes, _equal_actions, _plainer):
        for changed in change(task):
            version = visited(changed)
            if size(version) < size(task) and version.outcomes not in seen:
                if version.horizon == task.horizon:
                    seen.add(version.outcomes)
                yield version


def _fewer_states(task: FrozenTask) -> Iterator[FrozenTask]:
    """Yield the task without each of its states: steps that led there stay where they are, lead to the start, or end."""
    first = max(range(len(task.states)), key=lambda s: task.start[s])
    for gone in range(len(task.states) - 1, -1, -1):
        if gone == first:
            continue
        for way in ("stay", "start", "end"):
            rows = []
            for s, by_action in enumerate(task.outcomes):
                target = first if way == "start" else s
                rows.append(tuple(_redirected(outcomes, gone, target, way == "end") for outcomes in by_action))
            start = list(task.start)
            start[gone] = 0.0
            start[first] += task.start[gone]
            yield replace(task, outcomes=tuple(rows), start=tuple(start))


def _redirected(outcomes: Sequence[Outcome], gone: int, target: int, ends: bool) -> tuple[Outcome, ...]:
    merged: dict[int, Outcome] = {}
    for outcome in outcomes:
        moved = outcome
        if outcome.state == gone:
            moved = replace(outcome, state=target, ends=outcome.ends or ends)
        known = merged.get(moved.state)
        if known is not None:
            probability = known.probability + moved.probability
            paid = known.probability * known.reward + moved.probability * moved.reward
            moved = Outcome(probability, moved.state, paid / probability, known.ends or moved.ends)
        merged[moved.state] = moved
    return tuple(merged.values())


def _fewer_actions(task: FrozenTask) -> Iterator[FrozenTask]:
    if len(task.actions) <= 2:
        return
    for gone in range(len(task.actions)):
        rows = []
        for by_action in task.outcomes:
            rows.append(by_action[:gone] + by_action[gone + 1 :])
        yield replace(task, actions=task.actions[:gone] + task.actions[gone + 1 :], outcomes=tuple(rows))


def _fewer_steps(task: FrozenTask) -> Iterator[FrozenTask]:
    if task.horizon is None or task.last is not None:
        return
    for length in sorted({1, 2, task.horizon // 2, task.horizon - 1}):
        if 1 <= length < task.horizon:
            yield replace(task, horizon=length)


def _one_start(task: FrozenTask) -> Iterator[FrozenTask]:
    for chosen, probability in enumerate(task.start):
        if 0 < probability < 1:
            start = [0.0] * len(task.start)
            start[chosen] = 1.0
            yield replace(task, start=tuple(start))


def _fewer_outcomes(task: FrozenTask) -> Iterator[FrozenTask]:
    for s, by_action in enumerate(task.outcomes):
        for a, outcomes in enumerate(by_action):
            if len(outcomes) == 1:
                continue
            for outcome in outcomes:
                yield replace(task, outcomes=_with_row(task.outcomes, s, a, (replace(outcome, probability=1.0),)))


def _equal_actions(task: FrozenTask) -> Iterator[FrozenTask]:
    for s, by_action in enumerate(task.outcomes):
        for chosen in dict.fromkeys(by_action):
            rows = list(task.outcomes)
            rows[s] = (chosen,) * len(by_action)
            yield replace(task, outcomes=tuple(rows))


def _plainer(task: FrozenTask) -> Iterator[FrozenTask]:
    for s, by_action in enumerate(task.outcomes):
        for a, outcomes in enumerate(by_action):
            for value in (0.0, 1.0, -1.0):
                paid = tuple(replace(outcome, reward=value) for outcome in outcomes)
                yield replace(task, outcomes=_with_row(task.outcomes, s, a, paid))
            on = tuple(replace(outcome, ends=False) for outcome in outcomes)
            yield replace(task, outcomes=_with_row(task.outcomes, s, a, on))


def _with_row(rows: Rows, state: int, action: int, row: tuple[Outcome, ...]) -> Rows:
    by_action = list(rows[state])
    by_action[action] = row
    return (*rows[:state], tuple(by_action), *rows[state + 1 :])
