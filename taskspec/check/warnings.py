"""Warnings about sound tasks that can hardly be meant: a table of checks, in the order of their codes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from taskspec.base.diagnostics import Collector, Diagnostic, SpecError
from taskspec.check import actions, expressions, names, observations, states
from taskspec.check.context import Doubt, LintContext
from taskspec.registry import load
from taskspec.scores.returns import Results
from taskspec.soundness.soundness import cases
from taskspec.task.build import build
from taskspec.task.task import Task, TaskLike


@dataclass(frozen=True, slots=True)
class WarningKind:
    """A kind of warnings: their code, and the function that finds them.

    With `for_all`, they are about the text itself, and given only if they remain for other parameter values.
    """

    code: str
    find: Callable[[LintContext], Iterator[Doubt]]
    for_all: bool = False


KINDS: tuple[WarningKind, ...] = (
    WarningKind("W501", states.unreachable),
    WarningKind("W502", actions.later_rewards),
    WarningKind("W503", actions.same_reward),
    WarningKind("W504", actions.indifferent),
    WarningKind("W505", actions.inert),
    WarningKind("W506", names.unused_names),
    WarningKind("W507", actions.expert),
    WarningKind("W508", observations.leak),
    WarningKind("W509", observations.hidden_goal),
    WarningKind("W510", expressions.moved),
    WarningKind("W512", expressions.certain, for_all=True),
    WarningKind("W513", expressions.whole, for_all=True),
    WarningKind("W514", expressions.past_the_end, for_all=True),
    WarningKind("W515", expressions.uneven, for_all=True),
    WarningKind("W516", observations.constant),
    WarningKind("W517", observations.duplicate),
    WarningKind("W518", observations.hidden),
    WarningKind("W519", states.unread),
    WarningKind("W519", states.forgotten),
    WarningKind("W520", actions.twins),
    WarningKind("W521", names.idle_errata),
    WarningKind("W522", observations.infinite_abstraction),
    WarningKind("W524", names.printed_alike),
    WarningKind("W525", observations.idle_symmetry),
    WarningKind("W527", names.foreign_letters),
)


def warnings(task: TaskLike, results: Results | None = None) -> tuple[Diagnostic, ...]:
    """Return the warnings about a task for its present parameters, sorted by place; without those that need a missing model.

    Args:
        results: of the task, where they are known already.
    """
    task = load(task)
    context = LintContext(task, results or Results(task))
    collector = Collector()
    _collect(context, collector)
    _collect(context, text := Collector(), for_all=True)
    found = text.diagnostics
    for other in _at_other_values(task) if found else ():
        _collect(LintContext(other, Results(other)), lasting := Collector(), for_all=True)
        kept = {(d.code, d.span) for d in lasting.diagnostics}
        found = tuple(d for d in found if (d.code, d.span) in kept)
    collector.extend(found)
    return collector.diagnostics


def _collect(context: LintContext, collector: Collector, for_all: bool = False) -> None:
    for kind in KINDS:
        for problem in kind.find(context) if kind.for_all is for_all else ():
            context.codes.add(kind.code)
            collector.add(kind.code, problem.place, problem.message, problem.hint, problem.notes)


def _at_other_values(task: Task) -> Iterator[Task]:
    for values in cases(task):
        try:
            yield build(task.document, task.variant, values, task.suite)
        except SpecError:
            continue
