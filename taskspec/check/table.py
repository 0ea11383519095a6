"""All lints, in the order of their codes, over one task."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from taskspec.base.diagnostics import Collector, Diagnostic, SpecError
from taskspec.check.actions import expert, inert, twins
from taskspec.check.case import Linted
from taskspec.check.indices import moved, past_the_end, uneven
from taskspec.check.names import foreign_letters, idle_errata, printed_alike, unused_names
from taskspec.check.observations import constant, duplicate, hidden, hidden_goal, leak
from taskspec.check.rewards import certain, indifferent, rewards
from taskspec.check.states import forgotten, unreachable, unread, whole
from taskspec.check.symmetries import endless, idle
from taskspec.registry import load
from taskspec.scores.returns import Results
from taskspec.soundness.soundness import cases
from taskspec.task.build import build
from taskspec.task.task import Task, TaskLike

Lint = Callable[[Linted, Collector], None]


LINTS: tuple[Lint, ...] = (
    unreachable, rewards, indifferent, inert, unused_names, expert, leak, hidden_goal, moved, constant, duplicate, hidden,
    unread, forgotten, twins, idle_errata, endless, printed_alike, idle, foreign_letters,
)  # fmt: skip
"""What is looked at for the parameters at hand."""

WRITTEN: tuple[Lint, ...] = (certain, whole, past_the_end, uneven)
"""What the text itself is warned about: given for the parameters at hand, and for all others that are tried."""


def sense(task: TaskLike, results: Results | None = None) -> tuple[Diagnostic, ...]:
    """Warnings about a task for its present parameters; what needs an exact model is passed over without one."""
    task = load(task)
    case = Linted(task, results or Results(task))
    collector = Collector()
    for lint in LINTS:
        lint(case, collector)
    collector.extend(_of_text(case))
    return collector.diagnostics


def _of_text(case: Linted) -> list[Diagnostic]:
    """Warnings about what is written that do not go away with other parameter values."""
    found = _run(WRITTEN, case)
    for other in _others(case.task) if found else ():
        lasting = {(d.code, d.span) for d in _run(WRITTEN, Linted(other, Results(other)))}
        found = [d for d in found if (d.code, d.span) in lasting]
    return found


def _run(lints: Sequence[Lint], case: Linted) -> list[Diagnostic]:
    collector = Collector()
    for lint in lints:
        lint(case, collector)
    return list(collector.diagnostics)


def _others(task: Task) -> Iterator[Task]:
    for values in cases(task):
        try:
            yield build(task.document, task.variant, values, task.suite)
        except SpecError:
            continue
