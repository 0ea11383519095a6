"""All lints, in the order of their codes, over one task."""

from __future__ import annotations

from collections.abc import Callable

from taskspec.diagnostics import Collector, Diagnostic
from taskspec.exact.lint.actions import expert, inert
from taskspec.exact.lint.case import Case
from taskspec.exact.lint.names import unused_names
from taskspec.exact.lint.observations import hidden_goal, leak
from taskspec.exact.lint.rewards import indifferent, rewards
from taskspec.exact.lint.states import unreachable
from taskspec.exact.returns import Results
from taskspec.spec.task import Task

Lint = Callable[[Case, Collector], None]


def sense(task: Task, results: Results | None = None) -> tuple[Diagnostic, ...]:
    """Warnings about a task for its present parameters; what needs an exact model is passed over without one."""
    case = Case(task, results or Results(task))
    collector = Collector()
    for lint in LINTS:
        lint(case, collector)
    return collector.diagnostics


LINTS: tuple[Lint, ...] = (unreachable, rewards, indifferent, inert, unused_names, expert, leak, hidden_goal)
