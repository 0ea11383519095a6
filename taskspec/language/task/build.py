"""Spec + parameters -> Task: every section checked in one pass, all mistakes reported together."""

from __future__ import annotations

import copyreg
import hashlib
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

from taskspec.base.diagnostics import Collector, Diagnostic, SpecError, in_order, raise_if_errors, spec_error
from taskspec.base.limits import Limits, limits
from taskspec.base.named import entries_by_name
from taskspec.language.expressions.check import check_uncalled
from taskspec.language.expressions.ir import reads
from taskspec.language.expressions.scope import FunctionDef
from taskspec.language.expressions.types import REAL, Refused, Role
from taskspec.language.source import Document, Packed, packed, unpacked
from taskspec.language.task import declarations, sections
from taskspec.language.task.annotations import figure, looking, read_examples, remembered, symmetries
from taskspec.language.task.context import Context
from taskspec.language.task.legal import legal_condition
from taskspec.language.task.merge import Merged, abstracted, merge, stripped, variant_names
from taskspec.language.task.names import Names, check_names, signature
from taskspec.language.task.parts import Component, Modifier, Parameter, Varying
from taskspec.language.task.schema.check import check_shape, remainder, validated
from taskspec.language.task.task import Annotations, Process, Task, TaskSource, task_id

SEMANTIC = (
    "constants", "definitions", "noise", "state", "action", "legal", "observation", "horizon", "terminal", "discount", "initial",
    "dynamics", "reward", "absorbing_reward", "memory", "expert", "abstraction", "info",
    "symmetries", "measures",
)  # fmt: skip
"""Sections that decide what a task does; the content hash covers these and the parameter values."""


def build(
    document: Document,
    variant: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    suite: str = "",
) -> Task:
    """Return the task that a document describes, for given parameter values; it is built once, for tasks are immutable.

    Raises:
        SpecError: with every mistake found.
    """
    values = parameters or {}
    check_document(document, [variant], values)
    validated(merge(document, variant))
    given = tuple((name, value, _kind(value)) for name, value in values.items())
    try:
        hash(given)
        built: Callable[..., Task] = _built
    except TypeError:  # a list, say: no parameter takes one, and the build says so
        built = _built.__wrapped__
    return built(document, variant, given, suite, limits())


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
    """Return what can be made of a document, and its mistakes; what does not have the shape of a spec is left out.

    Args:
        variants: the tasks that are meant, all of them unless given.
        before: what was made, for the same values, of the text before its last change; what is right and still the same
            is taken from there, and its places become those of this document.
    """
    found = list(check_shape(document))
    is_whole = not found
    rest: Document | None = document
    words: set[str] = set()
    if not is_whole:
        rest, words = remainder(document)
    if rest is None:
        return [], in_order(found)
    made = []
    right = {each.merged.variant: each for each in before if each.is_right}
    for variant in variants or variant_names(rest.data).values():
        merged = merge(rest, variant)
        mistakes: Sequence[Diagnostic] = ()
        attempt = _taken(right.get(merged.variant), merged)
        if attempt is None:
            attempt, mistakes = _attempt(merged, values or {})
        if attempt is not None:
            made.append(attempt)
        found += [d for d in mistakes if is_whole or not _follows(d, words)]
    return made, in_order({(d.code, d.span): d for d in found}.values())


def _taken(known: Attempt | None, merged: Merged) -> Attempt | None:
    """Return what was made of a spec whose places and prose alone have changed; None where more has."""
    if known is None or _meant(known.merged) != _meant(merged):
        return None
    known.names.context.move(merged)
    return replace(known, merged=merged)


def _meant(merged: Merged) -> str:
    """Return the sections that have a meaning, with the types of their values: 1, 1.0 and True are equal otherwise."""
    return repr({section: value for section, value in merged.data.items() if section not in _PROSE})


_PROSE = ("title", "summary", "description", "capability", "sources", "errata")


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
        _checked(attempt.names, values, "")
        attempt = replace(attempt, is_right=not mistakes)
    except SpecError as error:
        mistakes += error.diagnostics
    return attempt, mistakes


_EMPTY: dict[str, Any] = {"state": {}, "action": {}, "horizon": 1, "initial": {}, "dynamics": {}, "reward": 0}
"""Sections in the place of those that a spec does not have yet."""


def _follows(found: Diagnostic, words: set[str]) -> bool:
    """Return whether a mistake follows from entries that were left out: it names one, or something is missing."""
    return found.code in ("E203", "E210", "E217") or bool(words & set(re.findall(r"['`](\w+)", found.message)))


def _kind(value: Any) -> tuple[str, float]:
    """Return what distinguishes values that are one key of a dictionary: 1, 1.0 and True, 0.0 and -0.0."""
    return type(value).__name__, math.copysign(1.0, value) if isinstance(value, float) else 1.0


@lru_cache(maxsize=256)
def _built(document: Document, variant: str | None, given: tuple[Any, ...], suite: str, _within: Limits) -> Task:
    values = {name: value for name, value, _ in given}
    return _fresh(merge(document, variant), values, suite)


class BoundParameters(NamedTuple):
    """A task's parameters with their values, and the content hash that the task has at them."""

    parameters: tuple[Parameter, ...]
    content_hash: str


def bound_parameters(
    document: Document, variant: str | None = None, parameters: Mapping[str, Any] | None = None
) -> BoundParameters:
    """Return the parameters of a document's task, bound to the given values or their defaults; the rest of it is not looked at.

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
    """Return the outline of a document's task; what happens in a step is not looked at.

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
    """Return a document's task with its parameters bound, and nothing else."""
    raise_if_errors(check_shape(document))
    merged = merge(document, variant)
    validated(merged)
    context = Context(merged, Collector())
    check_names(merged, context.collector)
    declarations.bind_parameters(context, dict(parameters or {}))
    context.collector.raise_if_errors()
    return context


def reduce_task(task: Task) -> tuple[Any, ...]:
    """Return a pickled task: its spec's text and its parameter values, from which it is built again."""
    source = task.source
    return _unpickled, (packed(source.document), source.variant, task.values, source.suite, task.annotations.remembers)


def _unpickled(pack: Packed, variant: str | None, values: dict[str, Any], suite: str, remembers: bool) -> Task:
    task = build(unpacked(pack), variant, values, suite)
    if remembers:
        return task.remembering()
    return task


copyreg.pickle(Task, reduce_task)  # here, since a task need not know how it is built; `modifiers` adds what it changes


def build_merged(merged: Merged, parameters: Mapping[str, Any], suite: str) -> Task:
    """Return the task of sections that were merged, or changed since.

    Raises:
        SpecError: with every mistake found, or with the limit that there are too many operations for.
    """
    validated(merged)
    return _fresh(merged, parameters, suite)


def _fresh(merged: Merged, parameters: Mapping[str, Any], suite: str) -> Task:
    """Return the task of merged sections whose shape is right."""
    return _checked(Names(Context(merged, Collector())), parameters, suite)


def _checked(names: Names, parameters: Mapping[str, Any], suite: str) -> Task:
    context = names.context
    try:
        return _pipeline(context, names, dict(parameters), suite)
    except SpecError as error:
        lacking = [d for d in error.diagnostics if d.code == "E407" and d.span is not None]
        if len(lacking) < 2:
            raise
        others = [d for d in error.diagnostics if d not in lacking]
        raise SpecError([*others, _first(lacking)]) from None
    except Refused as refused:  # a limit of the whole task, reached outside of any expression
        context.collector.raise_if_errors()
        place = context.merged.span(("name",))
        raise SpecError([Diagnostic(refused.code, place, refused.message, refused.hint)]) from None


def _first(lacking: Sequence[Diagnostic]) -> Diagnostic:
    """Return the first of several mistakes that have one cause, with the places of the others."""
    first, *others = lacking
    places = dict.fromkeys(_line(d, first) for d in others)
    note = f"a value is missing in {', '.join(places)} as well"
    return replace(first, notes=(*first.notes, note))


def _line(d: Diagnostic, beside: Diagnostic) -> str:
    """Return the place of a diagnostic, in short if it is in the same file as another one."""
    assert d.span is not None and beside.span is not None
    if d.span.origin == beside.span.origin:
        return f"line {d.span.line}"
    return str(d.span)


def _pipeline(context: Context, names: Names, given: dict[str, Any], suite: str) -> Task:
    """Return the task of a merged spec: everything declared is bound, then each section becomes nodes, in this order.

    Mistakes are collected in `context` and raised together, as soon as nothing more can be read without what is broken.
    """
    collector = context.collector
    builder = context.builder

    # What the sections stand on.
    check_names(context.merged, collector)
    declarations.bind_parameters(context, given)
    declarations.bind_constants(context)
    context.state = declarations.bind_components(context, "state")
    context.action = declarations.bind_components(context, "action")
    if context.data.get("memory"):
        context.memory = declarations.bind_components(context, "memory")
    context.collect_labels()
    context.horizon = declarations.bind_horizon(context)
    discount = declarations.bind_discount(context)
    sections.parse_sections(context)

    # The process itself. The draws that each part names decide which random words it takes.
    with builder.written() as initial_draws:
        initial = sections.initial_values(context, names)
    with builder.written() as dynamics_draws:
        changed = sections.next_values(context, names)
        following = sections.saturate(context, names, initial, changed)
        reward = sections.single_number(context, "reward", REAL, names.scope("reward"))
        terminal = sections.end_condition(context, names)
    legal = legal_condition(context, names)
    absorbing = sections.single_number(context, "absorbing_reward", REAL, names.scope("absorbing"), default=0)
    with builder.written() as observation_draws:
        observation = sections.observed(context, names, initial, following)
    with builder.written() as measure_draws:
        measures = sections.measures(context, names)

    # What the spec states about it.
    memory = remembered(context, names, observation)
    expert = sections.expert_action(context, names)
    if memory is not None and isinstance(expert, tuple):
        memory = looking(context, memory, observation, expert)
    check_unused(context, names)
    mapped = sections.abstraction_map(context, names)
    mirrors = symmetries(context, names, observation)
    drawn = figure(context, names.scope("figure"))
    claims = tuple(sections.claims(context))
    examples = tuple(read_examples(context))
    names.scope("claims")
    collector.raise_if_errors()
    assert reward is not None and terminal is not None and absorbing is not None

    # What is written, before ints are moved into range.
    raw_initial = tuple(context.raw_initial[c.name] for c in context.state)
    raw_next = tuple(names.raw_next[c.name] for c in context.state)
    sections.check_widths(
        context,
        initial=raw_initial, dynamics=raw_next, reward=[reward], terminal=[terminal], absorbing_reward=[absorbing],
        abstraction=mapped, observation=observation.nodes, expert=expert if isinstance(expert, tuple) else (),
        memory=() if memory is None else memory.lines, measures=tuple(measures.values()),
        legal=() if legal is None else (legal,),
    )  # fmt: skip
    collector.raise_if_errors()
    constants = declarations.fixed_constants(context)
    parameters = tuple(context.parameters)
    source = TaskSource(context.merged, suite, parameters, context.surface(), content_hash(context), constants)
    process = Process(
        tuple(initial), tuple(following), raw_initial, raw_next, reward, terminal, absorbing,
        reset_draws=tuple((initial_draws | observation_draws).values()),
        step_draws=tuple((dynamics_draws | observation_draws | measure_draws).values()),
        required=tuple(context.required), measures=measures, legal=legal,
    )  # fmt: skip
    annotations = Annotations(expert, memory, claims=claims, examples=examples, figure=drawn, symmetries=mirrors)
    return Task(source, context.state, context.action, observation, context.horizon, discount, process, annotations)


def check_unused(context: Context, names: Names) -> None:
    """Definitions and noise that nothing uses are checked all the same."""
    scope = names.scope("reward")
    used = {name for each in context.scopes for name in each.used}  # before the checks below use more
    for name in context.data.get("noise") or {}:
        context.resolve(scope.bindings[name], context.place("noise", name))
    for written in context.exprs["definitions"]:
        name = signature(written)[0]
        binding = scope.bindings[name]
        if name not in used and isinstance(binding, FunctionDef):
            check_uncalled(context.collector, binding)
        elif name not in used:
            context.resolve(binding, context.place("definitions", written))


def content_hash(context: Context) -> str:
    """SHA-256 of what decides the task's behaviour: its semantic sections and its parameter values."""
    content = {section: context.data[section] for section in SEMANTIC if section in context.data}
    content["format"] = context.data.get("taskspec", 1)
    content["values"] = {p.name: p.value for p in context.parameters}
    return hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest()


# -- tasks that follow from the spec of another one


def build_abstract(task: Task) -> Task | None:
    """Return the finite stand-in that a task's spec declares under `abstraction`, for the same parameters; None without one.

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
        raise SpecError(replace(d, notes=(*d.notes, note)) for d in error.diagnostics) from None


def build_varying(task: Task, names: Sequence[str]) -> Task:
    """Return what resets and steps a task, with numeric parameters as reads of PARAMETER, under their names; nothing else
    is built.

    Raises:
        SpecError: E702 for a parameter that there is not, E713 for one that is no number, has no effect on steps, or decides what
            is fixed once and for all, and for a task with modifiers.
    """
    for name in names:
        _check(task, name)
    given = {**task.values, **{name: Varying(task.values[name]) for name in names}}
    try:
        built = build_merged(stripped(merge(task.source.document, task.source.variant)), given, task.source.suite)
    except SpecError as error:
        raise SpecError(_refused(d, names) for d in error.diagnostics) from None
    read = {name for role, name in reads(built.roots) if role is Role.PARAMETER}
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


def _refused(found: Diagnostic, names: Sequence[str]) -> Diagnostic:
    """Return a mistake that there is because parameters are open."""
    subject = f"all of the parameters {', '.join(names)}"
    if len(names) == 1:
        subject = f"parameter {names[0]}"
    why = found.message.partition(":")[0]
    hint = "what decides shapes, counts and bounds is bound when a task is loaded: `load(task, L=5)`"
    return Diagnostic("E713", found.span, f"{subject} cannot differ between lanes: {why}", hint)
