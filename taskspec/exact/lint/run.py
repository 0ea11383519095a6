"""All lints, in the order of their codes, over one task."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from taskspec.diagnostics import Collector, Diagnostic, SpecError
from taskspec.exact.checks.soundness import cases
from taskspec.exact.lint.abstractions import endless
from taskspec.exact.lint.actions import expert, inert
from taskspec.exact.lint.case import Linted
from taskspec.exact.lint.draws import certain
from taskspec.exact.lint.errata import idle_errata
from taskspec.exact.lint.indices import moved
from taskspec.exact.lint.names import unused_names
from taskspec.exact.lint.observations import constant, duplicate, hidden, hidden_goal, leak
from taskspec.exact.lint.reals import whole
from taskspec.exact.lint.rewards import indifferent, rewards
from taskspec.exact.lint.slices import past_the_end, uneven
from taskspec.exact.lint.states import unreachable
from taskspec.exact.lint.symbols import foreign_letters, printed_alike
from taskspec.exact.lint.symmetries import idle
from taskspec.exact.lint.twins import twins
from taskspec.exact.lint.unread import forgotten, unread
from taskspec.exact.scoring.returns import Results
from taskspec.registry import load
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
