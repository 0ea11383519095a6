"""Values of a task's expressions at states, episodes of the expert, and states and observations as tables."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.display import number
from taskspec.exact.model.space import Space
from taskspec.exact.rollout.rollout import Rollout, alone, at_random, by_expert
from taskspec.language import draws
from taskspec.language.expressions import batch
from taskspec.language.expressions.evaluate import Flat, evaluate
from taskspec.language.expressions.types import TIME, Expression, Kind, Role
from taskspec.language.expressions.variates import sampler
from taskspec.language.task.parts import DEFAULT, Component, Figure
from taskspec.language.task.questions import is_random
from taskspec.language.task.task import Task
from taskspec.show.figures.shapes import Box, Item, Label, Line, Scene, fitted, text_width
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import of_task
from taskspec.show.record import value_words

State = Mapping[str, Any]
Reads = dict[tuple[Role, str], Array]
STEPS = 200  # steps of an episode that are followed
MANY = 20_000  # states that are drawn all at once


def at_states(task: Task, node: Expression, reads: Reads, count: int = 1) -> Array:
    """Return values (count, *shape) of a node at states given as arrays (*shape, count)."""
    given = {TIME: np.zeros(1, dtype=np.int64)} | reads
    (values,) = batch.evaluate([node], given)
    return np.moveaxis(np.broadcast_to(values, (*values.shape[:-1], count)), -1, 0)


def as_printed(component: Component, value: Any) -> Any:
    """Return a value of a component as pages print it: conditions as 0 and 1."""
    if component.type.kind is Kind.BOOL:
        return np.asarray(value).astype(int)
    return value


def figure_of(task: Task) -> Figure:
    """Return what the spec says of its figure, which may be nothing."""
    return task.annotations.figure or Figure(DEFAULT)


def at_state(task: Task, node: Expression, state: State) -> Array:
    return at_states(task, node, reads_of(task, state))[0].astype(float)


def reads_of(task: Task, state: State) -> Reads:
    """Return one state, by component, as arrays that expressions read."""
    return {(Role.STATE, c.name): alone(c, state[c.name]) for c in task.state}


def repeated(task: Task, state: State, count: int) -> Reads:
    """Return `count` times one state."""
    return {read: np.repeat(value, count, axis=-1) for read, value in reads_of(task, state).items()}


def all_states(task: Task) -> tuple[Reads, int] | None:
    """Return every declared state of a finite task, or None when there are too many."""
    if not task.is_finite:
        return None
    space = Space(task.state, Role.STATE)
    if space.size > MANY:
        return None
    return dict(space.decode(np.arange(space.size))), space.size


def first_state(task: Task, seed: int = 0) -> dict[str, Any]:
    return first_lane(Rollout(task, 1, seed).start())


def first_lane(state: Mapping[str, Array]) -> dict[str, Any]:
    return {name: value[..., 0] for name, value in state.items()}


def expert_path(task: Task, steps: int = STEPS, seed: int = 0) -> list[dict[str, Any]]:
    """Return states of an episode of the expert, where its actions are expressions and nothing is drawn in a step."""
    task = task.remembering()
    expert = task.annotations.expert
    if not isinstance(expert, tuple) or is_random((*task.process.next, task.process.terminal, *expert)):
        return [first_state(task, seed)]
    path, _ = episode_path(task, steps, seed)
    return path


def episode_path(task: Task, steps: int = STEPS, seed: int = 0) -> tuple[list[dict[str, Any]], str]:
    """Return states of an episode of the expert where its actions are expressions, else of random actions; and whose it is."""
    task = task.remembering()
    expert = task.annotations.expert
    whose = "random actions"
    choose = at_random(task)
    if isinstance(expert, tuple) and not is_random(expert):
        whose = "the expert"
        choose = by_expert(task)
    rollout = Rollout(task, 1, seed)
    rng = np.random.default_rng(seed)
    state = rollout.start()
    states = [first_lane(state)]
    for t in range(min(steps, task.horizon or steps)):
        moved = rollout.step(state, choose(state, t, rng), t)
        state = moved.state
        states.append(first_lane(state))
        if bool(np.all(moved.terminal)):
            break
    return states, whose


# Observations, and states as tables.

SIDE = 0.8
WIDTH = 3.4
HALF = 0.45
LETTERS = 0.28
APART = 0.15
MOST = 100  # elements of a vector that are drawn
ELEMENTS = 6
TABLE_WIDTH = 9.0
FRAME_LETTERS = 44


def observed(task: Task) -> Iterator[Item]:
    """Yield a first observation as boxes and bars, from (0, 0) to the right."""
    roots = (*task.process.initial, *task.first_observation)
    words = draws.words(0, draws.RESET, 0, task.reset_words.count)
    flats = list(evaluate(roots, {}, sampler(task.reset_words, words)))[len(task.process.initial) :]
    names = of_task(task)
    x = 0.0
    for component, flat in zip(task.observation.components, flats, strict=True):
        symbol = names.symbol(component.name)
        if component.type.shape:
            least = min(WIDTH, 0.3 * len(flat))
        else:
            word = m.Words(_word(component, flat))
            least = max(SIDE, text_width(word, LETTERS) + 0.2)
        width = max(least, text_width(symbol, LETTERS))
        yield Label((x + width / 2, -0.25), symbol, LETTERS)
        if component.type.shape:
            yield from _bars(x, width, flat)
        else:
            yield Box((x, 0), width, 2 * HALF, "accent", "faint", shade=0.4)
            yield Label((x + width / 2, HALF), word, LETTERS)
        x += width + APART


def _word(component: Component, flat: Flat) -> str:
    (value,) = flat
    value = as_printed(component, value)
    if component.domain is not None:
        return component.domain.labels[int(value)]
    if isinstance(value, float):
        return number(value, 2)
    return str(value).replace("-", "−")


def _bars(x: float, width: float, flat: Flat) -> Iterator[Item]:
    """Yield bars above and below a line; of a long vector the first ones."""
    shown = list(map(float, flat[:MOST]))
    step = width / len(shown)
    scale = 0.95 * HALF / (max(map(abs, shown)) or 1.0)
    yield Box((x, 0), width, 2 * HALF, None, "faint")
    for i, value in enumerate(shown):
        top = HALF - scale * max(value, 0.0)
        yield Box((x + (i + 0.1) * step, top), 0.8 * step, max(0.01, scale * abs(value)), "second", None)
    yield Line(((x, HALF), (x + width, HALF)), color="muted", width=0.02)
    if len(flat) > MOST:
        yield Label((x + width + 0.2, HALF), m.Sym("…"), LETTERS)


def state_table(task: Task, state: State) -> Scene:
    """Draw a state as text, a line for each component, for tasks that have no figure."""
    notation = of_task(task)
    items: list[Item] = [Box((0.0, 0.0), TABLE_WIDTH, 0.1, None, None)]  # all frames of an episode have one size
    for i, c in enumerate(task.state):
        value = as_printed(c, state[c.name])
        if c.domain is not None and not isinstance(value, str) and np.ndim(value) == 0:
            value = c.domain.labels[int(value)]
        flat = np.asarray(value).reshape(-1).tolist()
        shown = list(map(value_words, flat[:ELEMENTS]))
        if len(flat) > ELEMENTS:
            shown.append("…")
        word = f"({', '.join(shown)})" if c.type.shape else shown[0]
        text = m.equal(notation.symbol(c.name), m.Words(word))
        items.append(Label((0.0, 0.55 * i), text, anchor="start"))
    return fitted(items, f"A state of {task.name}", margin=0.3)


def not_drawn(task: Task, needs: str) -> Scene:
    """Return the frame in place of a figure that does not fit: the size of the task and what a figure of its kind needs."""
    size = f"{_count(task.state, 'state', task.is_finite)} and {_count(task.action, 'action')}"
    reason = f"No {figure_of(task).kind} is drawn: {needs.replace('`', '')}"
    words = [Label((0.0, 0.0), m.Words(size), 0.3, "start")]
    for i, line in enumerate(textwrap.wrap(reason, FRAME_LETTERS), start=1):
        words.append(Label((0.0, 0.5 * i), m.Words(line), 0.3, "start", "muted"))
    inside = fitted(words, "", margin=0.3)
    frame = Box((0, 0), inside.width, inside.height, None, "faint", round=0.1)
    return fitted([frame, *inside.items], f"{task.name}: {size}, not drawn")


def _count(components: tuple[Component, ...], noun: str, finite: bool = True) -> str:
    if finite and all(c.type.kind is not Kind.REAL for c in components):
        return f"{Space(components, components[0].read[0]).size:,} {noun}s"
    return f"{noun}s of {sum(c.type.size for c in components):,} numbers"
