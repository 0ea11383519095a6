"""Documents -> tasks: whole tasks, what is only listed of them, tasks with mistakes, and those that follow from others."""

from __future__ import annotations

import copyreg
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

from taskspec.base.diagnostics import Collector, Diagnostic, SpecError, in_order, raise_if_errors, spec_error
from taskspec.base.limits import Limits, limits
from taskspec.base.named import entries_by_name
from taskspec.language.expressions.ir import reads
from taskspec.language.expressions.types import Role
from taskspec.language.source import Document, Packed, packed, unpacked
from taskspec.language.task import declarations
from taskspec.language.task.context import Context
from taskspec.language.task.merge import Merged, abstracted, merge, stripped, variant_names
from taskspec.language.task.names import Names, check_names
from taskspec.language.task.parts import Component, Modifier, Parameter, Varying
from taskspec.language.task.pipeline import content_hash, task_of
from taskspec.language.task.schema.check import check_shape, remainder, shaped, validated
from taskspec.language.task.task import Task, task_id


def build(
    document: Document,
    variant: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    suite: str = "",
) -> Task:
    """Build the task of a document for given parameter values; it is built once, for tasks are immutable.

    Raises:
        SpecError: with every mistake found.
    """
    values = parameters or {}
    try:
        shaped(document, variant)
    except SpecError:
        check_document(document, [variant], values)
        raise
    given = tuple((name, value, _kind(value)) for name, value in values.items())
    most = limits().expressions
    within = replace(limits(), expressions=0)  # a task is the same within any number that it does not exceed
    try:
        hash(given)
    except TypeError:  # a list, say: no parameter takes one, and the build says so
        return _built.__wrapped__(document, variant, given, suite, within)
    task = _built(document, variant, given, suite, within)
    if task.source.surface.expressions > most:
        return _built.__wrapped__(document, variant, given, suite, within)  # refuses it
    return task


def check_document(
    document: Document, variants: Sequence[str | None] = (), values: Mapping[str, Any] | None = None
) -> None:
    """Check the shape of a document; where it is wrong, the rest of its tasks is checked as well.

    Args:
        variants: the tasks that are meant, all of them unless given.

    Raises:
        SpecError: with every mistake of the shape, and those that do not follow from it.
    """
    if check_shape(document):
        raise_if_errors(attempts(document, variants, values)[1])


@dataclass(frozen=True)
class Attempt:
    """A spec or variant that may have mistakes: its sections, and the names that are visible in each."""

    merged: Merged
    names: Names
    is_right: bool = False
    """Whether it has no mistakes."""


def attempts(
    document: Document,
    variants: Sequence[str | None] = (),
    values: Mapping[str, Any] | None = None,
    before: Sequence[Attempt] = (),
) -> tuple[list[Attempt], tuple[Diagnostic, ...]]:
    """Build as much of a document as is right, and list its mistakes; entries without the shape of a spec are left out.

    Args:
        variants: the tasks that are meant, all of them unless given.
        before: what was made, for the same values, of the text before its last change; what is right and still the same
            is taken from there, with places in this document.
    """
    problems = list(check_shape(document))
    is_whole = not problems
    rest: Document | None = document
    words: set[str] = set()
    if not is_whole:
        rest, words = remainder(document)
    if rest is None:
        return [], in_order(problems)
    made = []
    right = {}
    for each in before:
        if each.is_right:
            right[each.merged.variant] = each
    for variant in variants or variant_names(rest.data).values():
        merged = merge(rest, variant)
        mistakes: Sequence[Diagnostic] = ()
        known = right.get(merged.variant)
        if known is not None and _meant(known.merged) == _meant(merged):  # places and prose alone have changed
            known.names.context.move(merged)
            attempt: Attempt | None = replace(known, merged=merged)
        else:
            attempt, mistakes = _attempt(merged, values or {})
        if attempt is not None:
            made.append(attempt)
        for d in mistakes:
            named = set(re.findall(r"['`](\w+)", d.message))
            is_missing = d.code in ("E203", "E210", "E217")
            if is_whole or not (is_missing or words & named):  # else it follows from entries that were left out
                problems.append(d)
    return made, in_order({(d.code, d.span): d for d in problems}.values())


def _meant(merged: Merged) -> str:
    """Select the sections that have a meaning, with the types of their values: 1, 1.0 and True are equal otherwise."""
    sections = {}
    for section, value in merged.data.items():
        if section not in _PROSE:
            sections[section] = value
    return repr(sections)


_PROSE = ("title", "summary", "description", "capability", "keywords", "sources", "errata")


def _attempt(merged: Merged, values: Mapping[str, Any]) -> tuple[Attempt | None, Sequence[Diagnostic]]:
    mistakes: tuple[Diagnostic, ...] = ()
    try:
        validated(merged)
    except SpecError as error:
        mistakes = error.diagnostics
    attempt = None
    try:
        if mistakes:  # what is there has meanings all the same
            merged = replace(merged, data=_EMPTY | merged.data)
            validated(merged)
        attempt = Attempt(merged, Names(Context(merged, Collector())))
        task_of(attempt.names, values, "")
        attempt = replace(attempt, is_right=not mistakes)
    except SpecError as error:
        mistakes += error.diagnostics
    return attempt, mistakes


_EMPTY: dict[str, Any] = {"state": {}, "action": {}, "horizon": 1, "initial": {}, "dynamics": {}, "reward": 0}
"""Sections in the place of those that a spec does not have yet."""


def _kind(value: Any) -> tuple[str, float]:
    """Distinguish values that are one key of a dictionary: 1, 1.0 and True, 0.0 and -0.0."""
    return type(value).__name__, math.copysign(1.0, value) if isinstance(value, float) else 1.0


@lru_cache(maxsize=256)
def _built(document: Document, variant: str | None, given: tuple[Any, ...], suite: str, _within: Limits) -> Task:
    values = {name: value for name, value, _ in given}
    return _fresh(merge(document, variant), values, suite)


def _fresh(merged: Merged, parameters: Mapping[str, Any], suite: str) -> Task:
    return task_of(Names(Context(merged, Collector())), parameters, suite)


class BoundParameters(NamedTuple):
    """A task's parameters with their values, and the content hash that the task has at them."""

    parameters: tuple[Parameter, ...]
    content_hash: str


def bound_parameters(
    document: Document, variant: str | None = None, parameters: Mapping[str, Any] | None = None
) -> BoundParameters:
    """Bind the parameters of a document's task to the given values or their defaults; the rest of it is not read.

    Raises:
        SpecError: for a value that a parameter cannot have, or values that may not go together.
    """
    context = _bound(document, variant, parameters)
    return BoundParameters(tuple(context.parameters), content_hash(context))


@dataclass(frozen=True)
class Outline:
    """The entry of a task in a list, under the names that a `Task` has for it."""

    id: str
    capability: str | None
    summary: str
    parameters: tuple[Parameter, ...]
    state: tuple[Component, ...]
    action: tuple[Component, ...]
    horizon: int | None
    modifiers: tuple[Modifier, ...] = ()


def outline(document: Document, variant: str | None, parameters: Mapping[str, Any], suite: str) -> Outline:
    """Build the outline of a document's task; steps are not read.

    Raises:
        SpecError: with every mistake in what is declared.
    """
    context = _bound(document, variant, parameters)
    declarations.bind_constants(context, resolve=False)
    state = declarations.bind_components(context, "state")
    action = declarations.bind_components(context, "action")
    horizon = declarations.bind_horizon(context)
    context.collector.raise_if_errors()
    merged = context.merged
    name = task_id(suite, merged.name, merged.data.get("version", 0))
    return Outline(
        name, merged.data.get("capability"), merged.data.get("summary") or "", tuple(context.parameters), state, action, horizon
    )  # fmt: skip


def _bound(document: Document, variant: str | None, parameters: Mapping[str, Any] | None) -> Context:
    merged = shaped(document, variant)
    context = Context(merged, Collector())
    check_names(merged, context.collector)
    declarations.bind_parameters(context, dict(parameters or {}))
    context.collector.raise_if_errors()
    return context


def reduce_task(task: Task) -> tuple[Any, ...]:
    """Pickle a task: its spec's text and its parameter values, from which it is built again."""
    source = task.source
    return _unpickled, (packed(source.document), source.variant, task.values, source.suite, task.annotations.remembers)


def _unpickled(pack: Packed, variant: str | None, values: dict[str, Any], suite: str, remembers: bool) -> Task:
    task = build(unpacked(pack), variant, values, suite)
    if remembers:
        return task.remembering()
    return task


copyreg.pickle(Task, reduce_task)  # here, since a task need not know how it is built; `modifiers` adds what it changes


def build_merged(merged: Merged, parameters: Mapping[str, Any], suite: str) -> Task:
    """Build the task of sections that were merged, or changed since.

    Raises:
        SpecError: with every mistake found, or with the limit that there are too many operations for.
    """
    validated(merged)
    return _fresh(merged, parameters, suite)


# -- tasks that follow from the spec of another one


def build_abstract(task: Task) -> Task | None:
    """Build the finite stand-in that a task's spec declares under `abstraction`, for the same parameters.

    Raises:
        SpecError: with every mistake found in it.
    """
    merged = abstracted(merge(task.source.document, task.source.variant))
    if merged is None:
        return None
    try:
        return build_merged(merged, task.values, task.source.suite)
    except SpecError as error:
        note = "this is about the abstraction, which takes from the task what it does not give itself"
        diagnostics = [replace(d, notes=(*d.notes, note)) for d in error.diagnostics]
        raise SpecError(diagnostics) from None


def build_varying(task: Task, names: Sequence[str]) -> Task:
    """Build the process of a task, with numeric parameters as reads of PARAMETER, under their names."""
    for name in names:
        _check(task, name)
    given = {**task.values, **{name: Varying(task.values[name]) for name in names}}
    try:
        built = build_merged(stripped(merge(task.source.document, task.source.variant)), given, task.source.suite)
    except SpecError as error:
        raise SpecError(_refused(d, names) for d in error.diagnostics) from None
    read = set()
    for role, name in reads(built.roots):
        if role is Role.PARAMETER:
            read.add(name)
    for name in names:
        if name not in read:
            message = f"parameter {name} has no effect on what a step gives, and cannot differ between lanes"
            raise spec_error("E713", message)
    shown = replace(built.observation, space=task.observation.space)
    source = replace(built.source, content_hash=f"{built.content_hash} with open {', '.join(sorted(names))}")
    return replace(built, observation=shown, source=source)


def _check(task: Task, name: str) -> None:
    parameters = entries_by_name(task.parameters)
    if name not in parameters:
        known = ", ".join(parameters) or "none"
        raise spec_error("E702", f"{task.name} has no parameter '{name}'", f"it has {known}")
    if parameters[name].kind not in ("int", "real"):
        raise spec_error("E713", f"parameter {name} is not a number, and cannot differ between lanes")
    if task.modifiers:
        message = f"parameters of a task with modifiers, as {task.instance_id}, cannot differ between lanes"
        raise spec_error("E713", message)


def _refused(mistake: Diagnostic, names: Sequence[str]) -> Diagnostic:
    subject = f"all of the parameters {', '.join(names)}"
    if len(names) == 1:
        subject = f"parameter {names[0]}"
    why = mistake.message.partition(":")[0]
    hint = "what decides shapes, counts and bounds is bound when a task is loaded: `load(task, L=5)`"
    return Diagnostic("E713", mistake.span, f"{subject} cannot differ between lanes: {why}", hint)
