"""Merged sections + parameters -> Task: every section checked in one pass, all mistakes reported together."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language.expressions.check import check_uncalled
from taskspec.language.expressions.scope import FunctionDef
from taskspec.language.expressions.types import REAL, Refused
from taskspec.language.task import declarations, sections
from taskspec.language.task.annotations import figure, looking, read_examples, remembered, symmetries
from taskspec.language.task.context import Context
from taskspec.language.task.legal import legal_condition
from taskspec.language.task.names import Names, check_names, signature
from taskspec.language.task.task import Annotations, Process, Task, TaskSource

SEMANTIC = (
    "constants", "definitions", "noise", "state", "action", "legal", "observation", "horizon", "terminal", "discount", "initial",
    "dynamics", "reward", "absorbing_reward", "memory", "expert", "abstraction", "info",
    "symmetries", "measures",
)  # fmt: skip
"""Sections that decide what a task does; the content hash covers these and the parameter values."""


def task_of(names: Names, parameters: Mapping[str, Any], suite: str) -> Task:
    """Build the task of merged sections whose shape is right.

    Raises:
        SpecError: with every mistake found, or with the limit that there are too many operations for.
    """
    context = names.context
    try:
        return _pipeline(context, names, dict(parameters), suite)
    except SpecError as error:
        lacking = []
        for d in error.diagnostics:
            if d.code == "E407" and d.span is not None:
                lacking.append(d)
        if len(lacking) < 2:
            raise
        others = []
        for d in error.diagnostics:
            if d not in lacking:
                others.append(d)
        first, *rest = lacking
        places = dict.fromkeys(_line(d, first) for d in rest)
        note = f"a value is missing in {', '.join(places)} as well"
        raise SpecError([*others, replace(first, notes=(*first.notes, note))]) from None
    except Refused as refused:  # a limit of the whole task, reached outside of any expression
        context.collector.raise_if_errors()
        place = context.merged.span(("name",))
        raise SpecError([Diagnostic(refused.code, place, refused.message, refused.hint)]) from None


def _line(d: Diagnostic, beside: Diagnostic) -> str:
    assert d.span is not None and beside.span is not None
    if d.span.origin == beside.span.origin:
        return f"line {d.span.line}"
    return str(d.span)


def _pipeline(context: Context, names: Names, given: dict[str, Any], suite: str) -> Task:
    """Build the task of a merged spec: everything declared is bound, then each section becomes nodes, in this order.

    Mistakes are collected in `context` and raised together, as soon as nothing more can be read without what is broken.
    """
    collector = context.collector
    builder = context.builder

    # Names and declarations, before any section.
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

    # Statements of the spec about the process.
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

    # Sections as written, before ints are moved into range.
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
    content = {}
    for section in SEMANTIC:
        if section in context.data:
            content[section] = context.data[section]
    content["format"] = context.data.get("taskspec", 1)
    content["values"] = {p.name: p.value for p in context.parameters}
    return hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest()
