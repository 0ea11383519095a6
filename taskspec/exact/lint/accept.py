"""Warnings that a spec accepts, each with a reason: they are set aside, and a reason for nothing is a warning itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taskspec.diagnostics import Diagnostic, Span
from taskspec.task.merge import merge
from taskspec.task.task import Task


@dataclass(frozen=True, slots=True)
class Accepted:
    """A warning that the spec gives a reason for, and where it does."""

    warning: Diagnostic
    because: str
    place: Span


def set_aside(task: Task, found: Sequence[Diagnostic]) -> tuple[list[Diagnostic], list[Accepted]]:
    """What is left to report, and the warnings that the task accepts."""
    reasons, merged = task.spec.accept, merge(task.document, task.variant)
    accepted = [
        Accepted(each, reasons[each.code], merged.key_span(("accept", each.code)))
        for each in found
        if each.severity == "warning" and each.code in reasons
    ]
    aside = [each.warning for each in accepted]
    return [each for each in found if each not in aside], accepted


def idle(task: Task, accepted: Sequence[Accepted], unknown: Sequence[str] = ()) -> list[Diagnostic]:
    """W511: reasons for warnings that a whole check did not give; `unknown` are codes that it did not look for."""
    reasons, merged = task.spec.accept, merge(task.document, task.variant)
    unneeded = [code for code in reasons if code not in {*unknown, *(each.warning.code for each in accepted)}]
    return [
        Diagnostic("W511", merged.key_span(("accept", code)), f"there is no {code} to accept", "remove this entry")
        for code in unneeded
    ]
