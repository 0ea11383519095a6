"""Actions with two names."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted
from taskspec.exact.model.inert import groups
from taskspec.exact.model.model import Model
from taskspec.exact.model.space import shown
from taskspec.lang.ir import Node, Read, Role, rewrite, walk
from taskspec.task.task import Component, Task

FEW = 32
"""Values of an action up to which all pairs are compared."""
MOST = 200_000
"""Operations that are worked out, once for each value."""
ROUNDING = 1e-12


def twins(case: Linted, collector: Collector) -> None:
    """W520: two values of an action that do the same in every state."""
    for c in case.task.action:
        count = c.counts[0] if c.is_finite and c.type.is_scalar else 0
        if not 2 < count <= FEW:
            continue  # of two values that are the same, W505 speaks
        if case.model is None and len(list(walk(_step(case.task)))) * count > MOST:
            continue
        same = _by_model(case.model, c) if case.model is not None else _by_form(case.task, c)
        found = _classes(count, same)
        for alike in found if len(found) > 1 else ():  # if all do the same, so W505 says
            names = [shown(c, np.asarray(int(c.low[0]) + number)) for number in alike]
            if len(names) > 1:
                message = f"{c.name} = {', '.join(names[:-1])} and {names[-1]} do the same in every state"
                collector.add("W520", case.key("action", c.name), message)


def _classes(count: int, same: Callable[[int, int], bool]) -> list[list[int]]:
    """The numbers below `count`, those that are the same together."""
    found: list[list[int]] = []
    for number in range(count):
        known = next((alike for alike in found if same(alike[0], number)), None)
        if known is None:
            found.append([number])
        else:
            known.append(number)
    return found


def _step(task: Task) -> tuple[Node, ...]:
    return (*task.next, task.reward, task.terminal)


def _by_form(task: Task, c: Component) -> Callable[[int, int], bool]:
    """Compares what is left of a step once the value is known: equal forms are one node."""
    b, roots = task.builder, _step(task)

    def chosen(value: int) -> tuple[Node, ...]:
        def leaf(node: Node) -> Node | None:
            is_it = isinstance(node, Read) and (node.role, node.name) == (Role.ACTION, c.name)
            return b.scalar(value) if is_it else None

        return rewrite(roots, leaf, b.remake)

    forms = [chosen(int(c.low[0]) + number) for number in range(c.counts[0])]
    return lambda one, other: all(a is b for a, b in zip(forms[one], forms[other], strict=True))


def _by_model(model: Model, c: Component) -> Callable[[int, int], bool]:
    """Compares all that the values do in the states in which episodes act."""
    table, acting = groups(model, c.name), np.flatnonzero(model.acting)

    def rows(number: int) -> Any:
        return (table[:, number][:, None] * model.n_states + acting[None, :]).reshape(-1)

    def same(one: int, other: int) -> bool:
        a, b = rows(one), rows(other)
        return all(_is_zero(found) for step in _steps(model) for found in _gaps(step, a, b))

    return same


def _steps(model: Model) -> list[Any]:
    return list({id(step): step for step in model.steps}.values())


def _gaps(step: Any, a: Any, b: Any) -> Iterator[Any]:
    yield step.reward[a] - step.reward[b]
    for matrix in (step.going, step.ending):
        if matrix is not None:
            yield (matrix[a] - matrix[b]).data


def _is_zero(found: Any) -> bool:
    return not len(found) or bool(np.abs(found).max() <= ROUNDING)
