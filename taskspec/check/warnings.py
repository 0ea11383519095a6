"""Warnings about sound tasks that can hardly be meant: a table of checks, in the order of their codes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from taskspec.base.diagnostics import Collector, Diagnostic, Span
from taskspec.check import model_warnings, observation_warnings, text_warnings
from taskspec.check.warning_context import Doubt, LintContext
from taskspec.registry import load
from taskspec.scores.returns import Results
from taskspec.task.merge import merge
from taskspec.task.task import Task, TaskLike


@dataclass(frozen=True, slots=True)
class WarningKind:
    """A kind of warnings: their code, and the function that finds them."""

    code: str
    find: Callable[[LintContext], Iterator[Doubt]]


KINDS: tuple[WarningKind, ...] = (
    WarningKind("W501", model_warnings.unreachable),
    WarningKind("W502", model_warnings.later_rewards),
    WarningKind("W503", model_warnings.same_reward),
    WarningKind("W504", model_warnings.indifferent),
    WarningKind("W505", model_warnings.inert),
    WarningKind("W506", text_warnings.unused_names),
    WarningKind("W507", model_warnings.expert),
    WarningKind("W509", observation_warnings.hidden_goal),
    WarningKind("W510", text_warnings.moved),
    WarningKind("W516", observation_warnings.constant),
    WarningKind("W517", observation_warnings.duplicate),
    WarningKind("W518", observation_warnings.hidden),
    WarningKind("W519", model_warnings.unread),
    WarningKind("W519", model_warnings.forgotten),
    WarningKind("W520", model_warnings.twins),
    WarningKind("W522", observation_warnings.unproved_abstraction),
    WarningKind("W524", text_warnings.printed_alike),
    WarningKind("W527", text_warnings.foreign_letters),
)


def warnings(task: TaskLike, results: Results | None = None) -> tuple[Diagnostic, ...]:
    """Return the warnings about a task for its present parameters, sorted by place; without those that need a missing model.

    Args:
        results: of the task, where they are known already.
    """
    task = load(task)
    context = LintContext(task, results or Results(task))
    collector = Collector()
    for kind in KINDS:
        for doubt in kind.find(context):
            context.codes.add(kind.code)
            collector.add(kind.code, doubt.place, doubt.message, doubt.hint, doubt.notes)
    return collector.diagnostics


# -- accepted warnings ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Accepted:
    """A warning that the spec accepts, the reason, and its place."""

    warning: Diagnostic
    because: str
    place: Span


def set_aside(task: Task, found: Sequence[Diagnostic]) -> tuple[list[Diagnostic], list[Accepted]]:
    """Split diagnostics into those to report, and warnings that the task accepts."""
    reasons = task.spec.accept
    merged = merge(task.document, task.variant)
    accepted = [
        Accepted(each, reasons[each.code], merged.key_span(("accept", each.code)))
        for each in found
        if each.severity == "warning" and each.code in reasons
    ]
    aside = [each.warning for each in accepted]
    return [each for each in found if each not in aside], accepted


def idle(task: Task, accepted: Sequence[Accepted], unknown: Sequence[str] = ()) -> list[Diagnostic]:
    """Reasons for warnings that a whole check did not give; `unknown` are codes that it did not look for."""
    reasons = task.spec.accept
    merged = merge(task.document, task.variant)
    unneeded = [code for code in reasons if code not in {*unknown, *(each.warning.code for each in accepted)}]
    return [
        Diagnostic("W511", merged.key_span(("accept", code)), f"there is no {code} to accept", "remove this entry")
        for code in unneeded
    ]
