"""The notation of a task: what its parameters, components, constants, definitions and labels look like."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from taskspec.lang import syntax as s
from taskspec.lang.parse import literal, parse
from taskspec.lang.types import shape
from taskspec.printers import tree as m
from taskspec.printers.notation import Notation
from taskspec.printers.symbols import label, symbol
from taskspec.task.names import signature
from taskspec.task.task import Component, Task


def of_task(task: Task) -> Notation:
    """The notation that every part of a task's printed form shares."""
    components = (*task.state, *task.action, *(() if task.memory is None else task.memory.components))
    return Notation(
        symbols=dict(_symbols(task)),
        labels={c.name: dict(_labels(c)) for c in components if c.domain is not None},
        singles=frozenset(c.name for c in components if c.type.shape == (1,)),
        lengths={
            name: expr
            for name, entry in (task.spec.state | task.spec.action | task.spec.memory).items()
            if (expr := _length(entry.shape)) is not None
        },
        axes=_axes(task),
        bodies={
            name: (arguments, expr)
            for written, expr in (task.surface.sections.get("definitions") or {}).items()
            for name, arguments in [signature(written)]
            if arguments is not None and expr is not None
        },
    )


def _axes(task: Task) -> dict[str, int]:
    """How many axes every name of a task has; a vector of one element is written like a number."""
    components = (*task.state, *task.action, *(() if task.memory is None else task.memory.components))
    return {
        **dict.fromkeys((p.name for p in task.parameters), 0),
        **{name: len(value.type.shape) for name, value in task.fixed.items()},
        **{name: len(found) for name, found in task.surface.shapes.items()},
        **{c.name: len(found) * (found != (1,)) for c in components for found in [shape(c.type, c.domain)]},
        "t": 0,
        "T": 0,
    }


def _symbols(task: Task) -> Iterator[tuple[str, m.Math]]:
    spec = task.spec
    for declared in (spec.parameters.entries, spec.state, spec.action, spec.memory):
        for name, entry in declared.items():
            yield name, symbol(name, entry.symbol)
    for name in (*spec.constants, *spec.noise):
        yield name, symbol(name)
    for written in spec.definitions:
        name = signature(written)[0]
        yield name, symbol(name)
    yield "t", m.Ident("t")
    yield "T", m.Ident("T")


def _labels(component: Component) -> Iterator[tuple[str, m.Math]]:
    domain = component.domain
    assert domain is not None
    for i, name in enumerate(domain.labels):
        yield name, label(name, domain.symbols[i] if domain.symbols else None)


def _length(shape: Any) -> s.Expr | None:
    """The length of a component along its first axis, as the author wrote it."""
    first = shape[0] if isinstance(shape, list) and shape else shape
    return None if first in (None, []) else expression(first)


def expression(value: Any) -> s.Expr:
    """A value of a declaration (a bound, a length) as surface syntax; it has been checked, so it parses."""
    if isinstance(value, list):
        place = s.Place(nowhere(""), 0, 0)
        return s.Vector(tuple(expression(v) for v in value), place)
    written = nowhere(str(value))
    if isinstance(value, bool | int | float):
        return literal(value, written)
    return parse(written)


def nowhere(text: str) -> s.SourceText:
    """A text that no file holds."""

    def locate(start: int, end: int) -> Any:
        return None

    return s.SourceText(text, locate)
