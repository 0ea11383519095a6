"""Actions with two names."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector
from taskspec.exact.inert import groups
from taskspec.exact.lint.case import Case
from taskspec.exact.model import Model
from taskspec.lang.ir import Node, Read, Role, rewrite, walk
from taskspec.spec.task import Component, Task

FEW = 32
"""Labels of an action up to which all pairs are compared."""
MOST = 200_000
"""Operations that are worked out, once for each label."""
ROUNDING = 1e-12


def twins(case: Case, collector: Collector) -> None:
    """W520: two labels of an action that do the same in every state."""
    for c in case.task.action:
        if c.domain is None or not c.type.is_scalar or not 2 < len(c.domain.labels) <= FEW:
            continue  # of two labels that are the same, W505 speaks
        if case.model is None and len(list(walk(_step(case.task)))) * len(c.domain.labels) > MOST:
            continue
        same = _by_model(case.model, c) if case.model is not None else _by_form(case.task, c)
        alike = [pair for pair in combinations(range(len(c.domain.labels)), 2) if same(*pair)]
        if len(alike) == len(c.domain.labels) * (len(c.domain.labels) - 1) // 2:
            continue  # so it does of all of them
        for one, other in alike:
            labels = f"'{c.domain.labels[one]}' and '{c.domain.labels[other]}'"
            collector.add("W520", case.key("action", c.name), f"{labels} do the same in every state")


def _step(task: Task) -> tuple[Node, ...]:
    return (*task.next, task.reward, task.terminal)


def _by_form(task: Task, c: Component) -> Callable[[int, int], bool]:
    """Compares what is left of a step once the label is known: equal forms are one node."""
    b, roots = task.builder, _step(task)

    def chosen(label: int) -> tuple[Node, ...]:
        def leaf(node: Node) -> Node | None:
            is_it = isinstance(node, Read) and (node.role, node.name) == (Role.ACTION, c.name)
            return b.scalar(label) if is_it else None

        return rewrite(roots, leaf, b.remake)

    assert c.domain is not None
    forms = [chosen(label) for label in range(len(c.domain.labels))]
    return lambda one, other: all(a is b for a, b in zip(forms[one], forms[other], strict=True))


def _by_model(model: Model, c: Component) -> Callable[[int, int], bool]:
    """Compares all that the labels do in the states in which episodes act."""
    table, acting = groups(model, c.name), np.flatnonzero(model.acting)

    def rows(label: int) -> Any:
        return (table[:, label][:, None] * model.n_states + acting[None, :]).reshape(-1)

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
