"""Values of a task's expressions at states, and what the agent observes of a state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.base.arrays import Array
from taskspec.figures.scene import Box, Item, Label, Line, Scene, fitted, text_width
from taskspec.lang import batch
from taskspec.lang.evaluate import Flat, evaluate
from taskspec.lang.ir import Node, Role
from taskspec.lang.ir import draws as draws_of
from taskspec.lang.variates import sampler
from taskspec.model.space import Space
from taskspec.printers import tree as m
from taskspec.printers.names import of_task
from taskspec.task.task import Component, Task

State = Mapping[str, Any]
Reads = dict[tuple[Role, str], Array]
STEPS = 200
"""Steps of an episode that are followed."""


def at_states(task: Task, node: Node, reads: Reads, count: int) -> Array:
    """Return values (count, *shape) of a node at states given as arrays (*shape, count)."""
    given = {(Role.TIME, "t"): np.zeros(1, dtype=np.int64)} | reads
    (found,) = batch.evaluate([node], given)
    return np.moveaxis(np.broadcast_to(found, (*found.shape[:-1], count)), -1, 0)


def reads_of(task: Task, state: State) -> Reads:
    """Return one state, by component, as arrays that expressions read."""
    found: Reads = {}
    for c in task.state:
        value = state[c.name]
        if c.domain is not None and isinstance(value, str):
            value = c.domain.labels.index(value)
        found[Role.STATE, c.name] = np.asarray(value, dtype=batch.DTYPES[c.type.kind]).reshape(*c.type.shape, 1)
    return found


def all_states(task: Task, limit: int = 20_000) -> tuple[Reads, int] | None:
    """Return every declared state of a finite task, or None when there are too many."""
    if not task.is_finite:
        return None
    space = Space(task.state, Role.STATE)
    if space.size > limit:
        return None
    return dict(space.decode(np.arange(space.size))), space.size


def first_state(task: Task, seed: int = 0) -> dict[str, Any]:
    """Return the first state after a reset with this seed."""
    layout = task.reset_words
    words = draws.words(seed, draws.RESET, 0, layout.count)
    flats = evaluate(task.initial, {}, sampler(layout, words))
    return {c.name: _shaped(flat, c.type.shape) for c, flat in zip(task.state, flats, strict=True)}


def _shaped(flat: tuple[Any, ...], shape: tuple[int, ...]) -> Any:
    return flat[0] if not shape else np.array([float(x) for x in flat]).reshape(shape)


def expert_path(task: Task, steps: int, seed: int = 0) -> list[dict[str, Any]]:
    """Return states of an episode of the expert, where its actions are expressions and nothing is drawn in a step."""
    task = task.remembering()
    states = [first_state(task, seed)]
    nodes = task.next
    if not isinstance(task.expert, tuple) or draws_of((*nodes, task.terminal, *task.expert)):
        return states
    for t in range(steps):
        reads = {**reads_of(task, states[-1]), (Role.TIME, "t"): np.array([t], dtype=np.int64)}
        actions = batch.evaluate(task.expert, reads)
        chosen = {(Role.ACTION, c.name): a for c, a in zip(task.action, actions, strict=True)}
        *found, ends = batch.evaluate((*nodes, task.terminal), reads | chosen)
        states.append({c.name: v[..., 0] for c, v in zip(task.state, found, strict=True)})
        if bool(np.all(ends)):
            break
    return states


# -- observations, and states as tables

SIDE = 0.8
WIDTH = 3.4
HALF = 0.45
LETTERS = 0.28
APART = 0.15
MOST = 100
"""Elements of a vector that are drawn."""


def is_noisy(task: Task) -> bool:
    """Return whether observations of one state differ, so that a picture of the state is not all of it."""
    return bool(draws_of(task.observation.nodes))


def seen(task: Task, seed: int = 0) -> Iterator[Item]:
    """Draw the observation after a reset with this seed, from (0, 0) to the right."""
    layout = task.reset_words
    words = draws.words(seed, draws.RESET, 0, layout.count)
    roots = (*task.initial, *task.first_observation)
    flats = evaluate(roots, {}, sampler(layout, words))[len(task.initial) :]
    names = of_task(task)
    x = 0.0
    for component, flat in zip(task.observation.components, flats, strict=True):
        symbol = names.symbol(component.name)
        width = max(_width(component, flat), text_width(symbol, LETTERS))
        yield Label((x + width / 2, -0.25), symbol, LETTERS)
        yield from _vector(x, width, flat) if component.type.shape else _number(x, width, component, flat)
        x += width + APART


def _width(component: Component, flat: Flat) -> float:
    if component.type.shape:
        return min(WIDTH, 0.3 * len(flat))
    return max(SIDE, text_width(m.Words(_word(component, flat)), LETTERS) + 0.2)


def _word(component: Component, flat: Flat) -> str:
    (value,) = flat
    if component.domain is not None:
        return component.domain.labels[int(value)]
    return (f"{float(value):.2g}" if isinstance(value, float) else str(value)).replace("-", "−")


def _number(x: float, width: float, component: Component, flat: Flat) -> Iterator[Item]:
    yield Box((x, 0), width, 2 * HALF, "accent", "faint", shade=0.4)
    yield Label((x + width / 2, HALF), m.Words(_word(component, flat)), LETTERS)


def _vector(x: float, width: float, flat: Flat) -> Iterator[Item]:
    """Yield bars above and below a line; of a long vector the first ones."""
    shown = [float(value) for value in flat[:MOST]]
    step = width / len(shown)
    scale = 0.95 * HALF / (max(map(abs, shown)) or 1.0)
    yield Box((x, 0), width, 2 * HALF, None, "faint")
    for i, value in enumerate(shown):
        top = HALF - scale * max(value, 0.0)
        yield Box((x + (i + 0.1) * step, top), 0.8 * step, max(0.01, scale * abs(value)), "second", None)
    yield Line(((x, HALF), (x + width, HALF)), color="muted", width=0.02)
    if len(flat) > MOST:
        yield Label((x + width + 0.2, HALF), m.Sym("…"), LETTERS)


_ELEMENTS = 6
_TABLE_WIDTH = 9.0


def state_table(task: Task, state: Mapping[str, Any]) -> Scene:
    """Draw a state as text, a line for each component, for tasks that have no figure."""
    notation = of_task(task)
    items: list[Item] = [Box((0.0, 0.0), _TABLE_WIDTH, 0.1, None, None)]  # all frames of an episode have one size
    for i, c in enumerate(task.state):
        text = m.Row((notation.symbol(c.name), m.Sym("="), m.Words(_words(c, state[c.name]))))
        items.append(Label((0.0, 0.55 * i), text, anchor="start"))
    return fitted(items, f"A state of {task.name}", margin=0.3)


def _words(c: Component, value: Any) -> str:
    if c.domain is not None and not isinstance(value, str) and np.ndim(value) == 0:
        return c.domain.labels[int(value)]
    flat = np.asarray(value).reshape(-1).tolist()
    shown = ", ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in flat[:_ELEMENTS])
    return f"({shown}{', …' if len(flat) > _ELEMENTS else ''})" if c.type.shape else shown
