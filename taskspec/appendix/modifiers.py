"""The section on modifiers: what was changed of the task as written, in order, and what its state and observations are then."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from taskspec.appendix.prose import CodeSpan, Formula, Inline, Inlines, Text, inlines, listing
from taskspec.modifiers import sentences
from taskspec.printers import tree as m
from taskspec.task.spaces import SpaceLayout, observation_layout
from taskspec.task.task import Component, Task


def modifiers(task: Task) -> Iterator[Inlines]:
    """A line for each, and one for the sizes of the state and the observation."""
    for each, said in sentences(task):
        yield (CodeSpan(str(each)), Text(": "), *inlines(said))
    if task.modifiers:
        yield (
            Text("with "),
            *_all_of(task),
            Text(f"; the rest of this page, its scores apart, is the task as written{_lost(task)}"),
        )


def _lost(task: Task) -> str:
    return ", whose expert is not one here" if task.expert is None is not task.unmodified.expert else ""


def as_written(task: Task) -> Task:
    """The task as its spec has it, with the claims and examples that are still about it."""
    return replace(task.unmodified, claims=task.claims, examples=task.examples)


def _all_of(task: Task) -> Iterator[Inline]:
    """`them, the state is s, acted (8 values), and the observation one of 4 numbers`."""
    yield Text("them, the state is " if len(task.modifiers) > 1 else "it, the state is ")
    yield from listing([(CodeSpan(c.name),) for c in task.state])
    yield from _values(task.state)
    yield Text(", and the observation is ")
    yield from _observation(observation_layout(task))


def _values(components: tuple[Component, ...]) -> Iterator[Inline]:
    if not all(c.is_finite for c in components):
        return
    count = math.prod(n for c in components for n in c.counts)
    number: m.Math = m.Num(f"{count:,}" if count < 10**9 else f"{count:.2e}")
    yield from (Text(" ("), Formula(number), Text(" values)"))


def _observation(layout: SpaceLayout) -> Iterator[Inline]:
    match layout.form:
        case "discrete":
            yield from (Text("one of "), Formula(m.Num(f"{layout.counts[0]:,}")), Text(" numbers"))
        case "dict":
            yield from (Text("a dictionary of "), *listing([(CodeSpan(c.name),) for c in layout.components]))
        case "box":
            yield from (Text("a vector of "), Formula(m.Num(f"{layout.size:,}")), Text(" reals"))
        case form:
            kind = "integers" if form == "multi_discrete" else "zeros and ones"
            yield from (Text("a vector of "), Formula(m.Num(f"{layout.size:,}")), Text(f" {kind}"))
