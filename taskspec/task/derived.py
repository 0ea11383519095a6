"""Tasks that follow from another one's spec: its finite stand-in, and itself with parameters that are left open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.lang.ir import Role, reads
from taskspec.task.build import rebuilt
from taskspec.task.merge import abstracted, merge, stripped
from taskspec.task.parameters import Varying
from taskspec.task.task import Task


def build_abstract(task: Task) -> Task | None:
    """The finite stand-in that a task's spec declares under `abstraction`, for the same parameters; None without one.

    Raises:
        SpecError: with every mistake found in it.
    """
    merged = abstracted(merge(task.document, task.variant))
    if merged is None:
        return None
    try:
        return rebuilt(merged, task.values, task.suite)
    except SpecError as error:
        note = "this is about the abstraction, which takes from the task what it does not give itself"
        raise SpecError(replace(d, notes=(*d.notes, note)) for d in error.diagnostics) from None


def build_varying(task: Task, names: Sequence[str]) -> Task:
    """What resets and steps a task, with numeric parameters as reads of PARAMETER, under their names; nothing else is built.

    Raises:
        SpecError: E702 for a parameter that there is not, E713 for one that is no number, has no effect on steps, or decides what
            is fixed once and for all, and for a task with modifiers.
    """
    for name in names:
        _check(task, name)
    given = {**task.values, **{name: Varying(task.values[name]) for name in names}}
    try:
        built = rebuilt(stripped(merge(task.document, task.variant)), given, task.suite)
    except SpecError as error:
        raise SpecError(_refused(d, names) for d in error.diagnostics) from None
    read = {name for role, name in reads((*built.reset_roots, *built.step_roots)) if role is Role.PARAMETER}
    for name in names:
        if name not in read:
            raise _error(f"parameter {name} has no effect on what a step gives, and cannot differ between lanes")
    shown = replace(built.observation, space=task.observation.space)
    return replace(built, observation=shown, content_hash=f"{built.content_hash} with open {', '.join(sorted(names))}")


def _check(task: Task, name: str) -> None:
    found = next((p for p in task.parameters if p.name == name), None)
    if found is None:
        known = ", ".join(p.name for p in task.parameters) or "none"
        raise SpecError([Diagnostic("E702", None, f"{task.name} has no parameter '{name}'", f"it has {known}")])
    if found.kind not in ("int", "real"):
        raise _error(f"parameter {name} is not a number, and cannot differ between lanes")
    if task.modifiers:
        raise _error(f"parameters of a task with modifiers, as {task.instance_id}, cannot differ between lanes")


def _error(message: str) -> SpecError:
    return SpecError([Diagnostic("E713", None, message)])


def _refused(found: Diagnostic, names: Sequence[str]) -> Diagnostic:
    """A mistake that there is because parameters are open."""
    subject = f"parameter {names[0]}" if len(names) == 1 else f"all of the parameters {', '.join(names)}"
    why = found.message.partition(":")[0]
    hint = "what decides shapes, counts and bounds is bound when a task is loaded: `load(task, L=5)`"
    return Diagnostic("E713", found.span, f"{subject} cannot differ between lanes: {why}", hint)
