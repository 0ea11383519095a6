"""The expression of a potential as a function of the state."""

from __future__ import annotations

from taskspec.diagnostics import Collector, Diagnostic, Origin, Span, SpecError
from taskspec.lang import syntax as s
from taskspec.lang.check import Checker
from taskspec.lang.ir import Node, reads
from taskspec.lang.parse import parse
from taskspec.lang.scope import Scope, Unavailable
from taskspec.lang.types import Kind, Refused
from taskspec.task.task import Task

SCOPE = "absorbing"
"""The section whose expressions see states, and no actions."""


def potential(task: Task, written: str) -> Node:
    """What an expression of the task language says of a state.

    Raises:
        SpecError: with all that is wrong with it, at its place in the expression.
    """
    collector, origin = Collector(), Origin("potential", written)
    expr = parse(s.SourceText(written, lambda start, end: Span(origin, 1, start + 1, 1, end + 1)))
    try:
        node = Checker(task.builder, collector).numeric(expr, _scope(task))
    except Refused as refused:
        raise SpecError([Diagnostic(refused.code, expr.place.span, refused.message, refused.hint)]) from None
    finally:
        collector.raise_if_errors()
    if not node.type.is_scalar:
        raise SpecError(
            [Diagnostic("E307", expr.place.span, f"a potential is one number, not {list(node.type.shape)}")]
        )
    if any(role.value == "time" for role, _ in reads([node])):
        raise SpecError(
            [Diagnostic("E302", expr.place.span, "a potential depends on the state alone, not on the time")]
        )
    return task.builder.cast(node, Kind.REAL)


def _scope(task: Task) -> Scope:
    hidden = {name: Unavailable("E302", f"'{name}' cannot be used in a potential") for name in _beside(task)}
    inner = task.surface.scopes[SCOPE].child(dict(hidden))
    inner.draws = "a potential is a function of the state"
    return inner


def _beside(task: Task) -> list[str]:
    return ["t", *(c.name for c in task.action)]
