"""What the agent sees of a state, as a scene: cells for numbers, bars for vectors. For observations that are drawn at random."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec import draws
from taskspec.figures.scene import Box, Item, Label, Line, text_width
from taskspec.lang.evaluate import Flat, evaluate
from taskspec.lang.ir import draws as draws_of
from taskspec.lang.variates.sample import sampler
from taskspec.printers import tree as m
from taskspec.printers.names import of_task
from taskspec.task.task import Component, Task

SIDE, WIDTH, HALF, LETTERS, APART = 0.8, 3.4, 0.45, 0.28, 0.15
MOST = 100
"""Elements of a vector that are drawn."""


def is_noisy(task: Task) -> bool:
    """Whether what is seen of a state is drawn anew each time, so that a picture of the state is not all of it."""
    return bool(draws_of(task.observation.nodes))


def seen(task: Task, seed: int = 0) -> Iterator[Item]:
    """The observation that a reset with this seed gives, from (0, 0) to the right."""
    layout = task.reset_words
    words = draws.words(seed, draws.RESET, 0, layout.count)
    roots = (*task.initial, *task.first_observation)
    flats = evaluate(roots, {}, sampler(layout, words))[len(task.initial) :]
    names, x = of_task(task), 0.0
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
    """Bars above and below a line; of a long vector the first ones."""
    shown = [float(value) for value in flat[:MOST]]
    step, scale = width / len(shown), 0.95 * HALF / (max(map(abs, shown)) or 1.0)
    yield Box((x, 0), width, 2 * HALF, None, "faint")
    for i, value in enumerate(shown):
        top = HALF - scale * max(value, 0.0)
        yield Box((x + (i + 0.1) * step, top), 0.8 * step, max(0.01, scale * abs(value)), "second", None)
    yield Line(((x, HALF), (x + width, HALF)), color="muted", width=0.02)
    if len(flat) > MOST:
        yield Label((x + width + 0.2, HALF), m.Sym("…"), LETTERS)
