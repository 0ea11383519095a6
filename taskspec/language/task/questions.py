"""Questions about the expressions of a task, and about what is written in its sections.

Only the language, the programs, the exact model and soundness take expressions apart. Others compute the value of one
(`expressions.batch.evaluate`), put it into another task (`Task.new_builder`), or ask here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from taskspec.language.expressions.interval import bounds
from taskspec.language.expressions.ir import Apply, Const, Read, draws, reads, walk
from taskspec.language.expressions.scope import Scope
from taskspec.language.expressions.types import TIME, Expression, Role
from taskspec.language.task.parts import by_name
from taskspec.language.task.task import Task

# -- expressions ------------------------------------------------------------------------------------------------------


def is_random(expressions: Iterable[Expression]) -> bool:
    """Return whether some of the expressions draw random numbers."""
    return bool(draws(expressions))


def reads_time(expressions: Iterable[Expression]) -> bool:
    """Return whether some of the expressions depend on the steps taken."""
    return TIME in reads(expressions)


def components_read(expressions: Iterable[Expression], role: Role = Role.STATE) -> set[str]:
    """Return the names of the components that expressions read, of the state unless another role is given."""
    names = set()
    for each, name in reads(expressions):
        if each is role:
            names.add(name)
    return names


def components_followed(
    expressions: Iterable[Expression], following: Mapping[str, Expression], of_step: bool = True
) -> set[str]:
    """Return the components that expressions depend on, at this step or later.

    Args:
        following: next values by component.
        of_step: whether the expressions may have next values in them.
    """
    expressions = tuple(expressions)
    followed: set[str] = set()
    fresh = components_read(expressions)
    if of_step:
        inside = set(map(id, walk(expressions)))
        for name, value in following.items():
            if id(value) in inside:
                fresh.add(name)
    while fresh:
        followed |= fresh
        fresh = components_read([following[name] for name in fresh if name in following]) - followed
    return followed


def constant(expression: Expression) -> Any:
    """Return the value of a constant: a number, or a flat tuple of the elements of a vector; None for other expressions."""
    if isinstance(expression, Const):
        return expression.value
    return None


def component(expression: Expression) -> str | None:
    """Return the component of the state that an expression is, and nothing else; None for other expressions."""
    if isinstance(expression, Read) and expression.role is Role.STATE:
        return expression.name
    return None


def elements(expression: Expression) -> tuple[Expression, ...] | None:
    """Return the elements of a vector that is written one by one; None for other expressions."""
    if isinstance(expression, Apply) and expression.op == "vector":
        return expression.args
    return None


def period(task: Task, expression: Expression) -> float:
    """Return the length of the range in which a remainder keeps a component; infinite for other expressions."""
    name = component(expression)
    if name is None:
        return math.inf
    later = by_name(task.state, task.process.next)[name]
    if any(isinstance(part, Apply) and part.op == "mod" for part in walk([later])):
        low, high = bounds(later, {})
        return high - low
    return math.inf


def unchanged(task: Task) -> set[str]:
    """Return the components of the state that no step changes."""
    names = set()
    for c, later in zip(task.state, task.process.next, strict=True):
        if component(later) == c.name:
            names.add(c.name)
    return names


# -- what is written --------------------------------------------------------------------------------------------------


def written_in(task: Task, section: str) -> Any:
    """Return what is written in a section: one expression, or expressions by name; None for a section that is not there."""
    return task.source.surface.sections.get(section)


def axes(task: Task) -> dict[str, int]:
    """Return the number of axes of each definition and of each noise."""
    return {name: len(lengths) for name, lengths in task.source.surface.shapes.items()}


def argument_axes(task: Task, definition: str, arguments: Iterable[str]) -> dict[str, int]:
    """Return the axes of the arguments with which a definition is called; 0 for one that nothing calls."""
    known = task.source.surface.argument_axes
    return {argument: known.get((definition, argument), 0) for argument in arguments}


def scope(task: Task, section: str) -> Scope:
    """Return the names that expressions of a section see, for a check of others in it."""
    return task.source.surface.scopes[section]
