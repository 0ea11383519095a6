"""Spec + parameters -> Task: every section checked in one pass, all mistakes reported together."""

from __future__ import annotations

import copyreg
import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from taskspec.base.diagnostics import Collector, Diagnostic, SpecError, has_errors, raise_if_errors, suggest
from taskspec.base.limits import Limits, limits
from taskspec.lang.basechecker import Poisoned
from taskspec.lang.check import check_uncalled
from taskspec.lang.ir import Const, reads
from taskspec.lang.scope import FunctionDef, Lazy, Scope
from taskspec.lang.types import BOOL, REAL, Refused
from taskspec.source import Document, Packed, Path, packed, unpacked
from taskspec.task.annotations import figure, read_examples, symmetries
from taskspec.task.context import Context, poison
from taskspec.task.declare import INSTANCE_SEED
from taskspec.task.forms import is_word
from taskspec.task.invariants import check_on_request
from taskspec.task.merge import Merged, merge, variant_names
from taskspec.task.names import Names, check_names, signature
from taskspec.task.observe import remembered
from taskspec.task.sections import SectionBuilder
from taskspec.task.task import Component, Parameter, Task

OPTIONS = frozenset({"task", "path", "variant", "render_mode", "ending", "observe_time", "modifiers", "num_envs",
                     "vectorization_mode", "vector_kwargs", "wrappers", "backend", "max_episode_steps",
                     "disable_env_checker"})  # fmt: skip
"""Keyword arguments of `gym.make`, `gym.make_vec` and our own makers, which no parameter may be called."""

SEMANTIC = (
    "constants", "definitions", "noise", "state", "action", "observation", "horizon", "terminal", "discount", "initial",
    "dynamics", "reward", "absorbing_reward", "memory", "expert", "abstraction", "info",
    "symmetries",
)  # fmt: skip
"""Sections that decide what a task does; the content hash covers these and the parameter values."""


def build(
    document: Document,
    variant: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    suite: str = "",
    *,
    well_formed: bool = False,
) -> Task:
    """Return the task that a document describes, for given parameter values; it is built once, for tasks are immutable.

    Args:
        well_formed: the document is known to have the shape of a spec, as shipped ones do (a test checks them all). The
            shape is then checked only where the build fails, and pydantic is not imported.

    Raises:
        SpecError: with every mistake found.
    """
    values = parameters or {}
    if not well_formed:
        _check_form(document, variant, values)
    try:
        return _built_once(document, variant, values, suite)
    except Exception:
        if well_formed:
            _check_form(document, variant, values)
        raise


def _check_form(document: Document, variant: str | None, parameters: Mapping[str, Any]) -> None:
    """Raise SpecError where a document, or a variant of it, has not the shape of a spec."""
    from taskspec.task.schema.check import check_shape, validated

    if has_errors(check_shape(document)):
        raise SpecError(mistakes(document, [variant], parameters))
    validated(merge(document, variant))


def _built_once(document: Document, variant: str | None, parameters: Mapping[str, Any], suite: str) -> Task:
    given = tuple((name, value, _kind(value)) for name, value in parameters.items())
    try:
        hash(given)
    except TypeError:  # a list, say: no parameter takes one, and the build says so
        return _built.__wrapped__(document, variant, given, suite, limits())
    return _built(document, variant, given, suite, limits())


def _kind(value: Any) -> tuple[str, float]:
    """Return what distinguishes values that are one key of a dictionary: 1, 1.0 and True, 0.0 and -0.0."""
    return type(value).__name__, math.copysign(1.0, value) if isinstance(value, float) else 1.0


@lru_cache(maxsize=256)
def _built(document: Document, variant: str | None, given: tuple[Any, ...], suite: str, _within: Limits) -> Task:
    values = {name: value for name, value, _ in given}
    return _Build(merge(document, variant), Collector()).checked(values, suite)


def mistakes(
    document: Document, variants: Iterable[str | None] | None = None, parameters: Mapping[str, Any] | None = None
) -> list[Diagnostic]:
    """What is wrong with the shape of a document, and with its tasks (all of them unless variants are given) in other parts."""
    from taskspec.task.schema.check import check_shape, remainder

    found = list(check_shape(document))
    rest = remainder(document)
    if rest is None:
        return found
    if variants is None:
        named = list(variant_names(rest.data).values())
        variants = named[1:] if len(named) > 1 and merge(rest).missing else named
    known = {(d.code, d.span) for d in found}
    for variant in variants:
        try:
            rebuilt(merge(rest, variant), parameters or {}, "")
        except SpecError as error:
            others = [d for d in error.diagnostics if d.severity == "error" and d.span is not None]
            found += [d for d in others if (d.code, d.span) not in known]
            known |= {(d.code, d.span) for d in others}
    return found


class BoundParameters(NamedTuple):
    """A task's parameters with their values, and the content hash that the task has at them."""

    parameters: tuple[Parameter, ...]
    content_hash: str


def bind(
    document: Document, variant: str | None = None, parameters: Mapping[str, Any] | None = None
) -> BoundParameters:
    """The parameters of a document's task, bound to the given values or their defaults; the rest of it is not looked at.

    Raises:
        SpecError: for a value that a parameter cannot have, or values that may not go together.
    """
    from taskspec.task.schema.check import check_shape, validated

    raise_if_errors(check_shape(document))
    merged = merge(document, variant)
    validated(merged)
    return _Build(merged, Collector()).bound(dict(parameters or {}))


def reduce_task(task: Task) -> tuple[Any, ...]:
    """Return a pickled task: its spec's text and its parameter values, from which it is built again."""
    return _unpickled, (packed(task.document), task.variant, task.values, task.suite, task.remembers)


def _unpickled(pack: Packed, variant: str | None, values: dict[str, Any], suite: str, remembers: bool) -> Task:
    task = build(unpacked(pack), variant, values, suite)
    return task.remembering() if remembers else task


copyreg.pickle(Task, reduce_task)  # here, since a task need not know how it is built; `modifiers` adds what it changes


def rebuilt(merged: Merged, parameters: Mapping[str, Any], suite: str) -> Task:
    """The task of sections that were merged, or changed since.

    Raises:
        SpecError: with every mistake found.
    """
    from taskspec.task.schema.check import validated

    validated(merged)
    return _Build(merged, Collector()).checked(dict(parameters), suite)


class _Build:
    """One build, section after section, into one context."""

    def __init__(self, merged: Merged, collector: Collector) -> None:
        self.context = Context(merged, collector)
        self.names = Names(self.context)
        self.sections = SectionBuilder(self.context, self.names)
        self.merged, self.data, self.collector = merged, merged.data, collector

    def checked(self, given: dict[str, Any], suite: str) -> Task:
        """The task.

        Raises:
            SpecError: with every mistake found, or with the limit that there are too many operations for.
        """
        try:
            return check_on_request(self.task(given, suite))
        except Refused as refused:  # a limit of the whole task, reached outside of any expression
            self.collector.raise_if_errors()
            place = self.merged.span(("name",))
            raise SpecError([Diagnostic(refused.code, place, refused.message, refused.hint)]) from None

    def bound(self, given: dict[str, Any]) -> BoundParameters:
        """The parameters alone.

        Raises:
            SpecError: with every mistake found.
        """
        check_names(self.merged, self.collector)
        self._bind_parameters(given)
        self.collector.raise_if_errors()
        return BoundParameters(tuple(self.context.parameters), self._hash())

    def _declare(self, given: dict[str, Any]) -> float:
        """What the sections stand on: parameters, constants, components, horizon; then reads them, and gives the discount."""
        context = self.context
        check_names(self.merged, self.collector)
        self._bind_parameters(given)
        self._bind_constants()
        context.state = self._components("state")
        context.action = self._components("action")
        context.memory = self._components("memory") if self.data.get("memory") else ()
        everything = (*context.state, *context.action, *context.memory)
        context.domains = [c.domain for c in everything if c.domain is not None]
        context.forms.labels = frozenset(x for d in context.domains for x in d.labels if not is_word(x))
        context.horizon, discount = self._horizon(), self._discount()
        self.sections.parse()
        return discount

    def task(self, given: dict[str, Any], suite: str) -> Task:
        """The whole pipeline, in order."""
        context, sections, scope = self.context, self.sections, self.names.scope
        discount = self._declare(given)
        with context.builder.written() as first:
            initial = sections.initial()
        with context.builder.written() as later:
            changed = sections.dynamics()
            following = sections.saturate(initial, changed)
            reward = sections.single("reward", REAL, scope("reward"))
            terminal = sections.terminal()
        absorbing = sections.single("absorbing_reward", REAL, scope("absorbing"), default=0)
        with context.builder.written() as seen:
            observation = sections.observation(initial, following)
        memory, expert = remembered(context, self.names, observation), sections.expert()
        self._check_unused()
        mapped, mirrors = sections.abstraction(), symmetries(context, self.names, observation)
        drawn = figure(context, scope("figure"))
        claims, examples = tuple(sections.claims()), tuple(read_examples(context))
        scope("claims")
        self.collector.raise_if_errors()
        if context.forms.is_partial:
            raise SpecError([])
        assert reward is not None and terminal is not None and absorbing is not None
        raw_initial = tuple(sections.raw_initial[c.name] for c in context.state)
        raw_next = tuple(self.names.raw_next[c.name] for c in context.state)
        sections.check_widths(
            initial=raw_initial, dynamics=raw_next, reward=[reward], terminal=[terminal], absorbing_reward=[absorbing],
            abstraction=mapped, observation=observation.nodes, expert=expert if isinstance(expert, tuple) else (),
            memory=() if memory is None else memory.lines,
        )  # fmt: skip
        self.collector.raise_if_errors()
        context.builder.settle(context.checker.checked)
        return Task(
            name=self.merged.name, suite=suite, version=self.data.get("version", 0), variant=self.merged.variant,
            parameters=tuple(context.parameters), state=context.state, action=context.action, observation=observation,
            horizon=context.horizon, discount=discount, initial=tuple(initial), next=tuple(following), reward=reward,
            raw_initial=raw_initial, raw_next=raw_next, terminal=terminal, absorbing_reward=absorbing, expert=expert,
            claims=claims, examples=examples, figure=drawn, builder=context.builder, reset_draws=tuple((first | seen).values()),
            step_draws=tuple((later | seen).values()), merged=self.merged, document=self.merged.document,
            content_hash=self._hash(), surface=context.surface(),
            fixed=self._fixed(), memory=memory, symmetries=mirrors, required=tuple(context.required),
        )  # fmt: skip

    def _bind_parameters(self, given: dict[str, Any]) -> None:
        context = self.context
        entries = self.data.get("parameters") or {}
        names = [name for name in entries if name != "require"]
        given = self._by_own_names(given, {entries[name].get("alias") or name: name for name in names})
        scope = context.constant_scope("parameters are fixed numbers")
        for name in names:
            self._check_option(name)
            found = context.declare.parameter(name, given, scope)
            if found is None:
                context.constants[name] = Lazy(poison)
                continue
            context.parameters.append(found[0])
            context.constants[name] = found[1]
            context.checker.parameters[name] = found[0].value
        if any(
            d.span is None for d in self.collector.diagnostics
        ):  # of values that were given, for which there is no task
            self.collector.raise_if_errors()
        if self.collector.has_errors:
            return  # requirements are about values that parameters can have
        for i, _ in enumerate(entries.get("require") or ()):
            self._require(("parameters", "require", i), scope)
        self.collector.raise_if_errors()

    def _by_own_names(self, given: dict[str, Any], aliases: dict[str, str]) -> dict[str, Any]:
        """Values by the names that the spec itself uses; those of no parameter, and those given twice, are reported."""
        names, found = list(aliases.values()), dict[str, Any]()
        for key, value in given.items():
            name = aliases.get(key, key)
            if name not in names:
                known = f"its parameters are {', '.join(names)}" if names else "it has no parameters"
                message = f"{self.merged.name} has no parameter '{key}'"
                self.collector.add("E702", None, message, suggest(key, [*names, *aliases]) or known)
            elif name in found:
                self.collector.add("E702", None, f"'{name}' and '{key}' are one parameter; give it once")
            found[name] = value
        return found

    def _check_option(self, name: str) -> None:
        for path, each in (((name,), name), ((name, "alias"), self.data["parameters"][name].get("alias"))):
            if each in OPTIONS:
                span = self.merged.key_span(("parameters", *path))
                message = (
                    f"'{each}' is an option of `gym.make` and of `taskspec.load`; a parameter cannot have its name"
                )
                self.collector.add("E309", span, message)
        if name == INSTANCE_SEED and self.data["parameters"][name]["type"] != "int":
            span = self.merged.span(("parameters", name, "type"))
            self.collector.add(
                "E204", span, "the seed of an instance is an int", f"{name}: {{type: int, default: 0, low: 0}}"
            )

    def _require(self, path: Path, scope: Scope) -> None:
        context = self.context
        expr = context.forms.expr((*path, "condition"))
        value = None if expr is None else context.checker.check(expr, scope)
        if expr is None or value is None:
            return
        if value.node.type == BOOL and reads([value.node]):
            context.required.append((value.node, context.forms.value((*path, "message"))))
            return  # it hangs on parameters that are left open
        if not isinstance(value.node, Const) or value.node.type != BOOL:
            self.collector.add("E306", expr.place, "a requirement is a condition on parameters")
        elif not value.node.value:
            message = context.forms.value((*path, "message"))
            values = ", ".join(f"{p.name}={p.value!r}" for p in context.parameters)
            self.collector.add("E704", expr.place, f"{message} ({values})")

    def _bind_constants(self) -> None:
        context = self.context
        seed = next((p.value for p in context.parameters if p.name == INSTANCE_SEED), None)
        scope = context.constant_scope()
        scope.used.add(INSTANCE_SEED)
        names = list(self.data.get("constants") or {})
        for name in names:
            make = lambda n=name: context.declare.constant(n, scope, seed)  # noqa: E731
            context.constants[name] = context.lazy(name, make)
        for name in names:
            context.resolve(context.constants[name], context.place("constants", name))

    def _fixed(self) -> dict[str, Const]:
        """The values of the constants."""
        found = {name: self.context.constant(name) for name in self.data.get("constants") or {}}
        return {name: value.node for name, value in found.items() if value and isinstance(value.node, Const)}

    def _components(self, section: str) -> tuple[Component, ...]:
        if not self.data[section]:
            hint = "where there is nothing to tell apart, one value is enough: `s: {type: choice, values: [only]}`"
            self.collector.add("E210", self.merged.key_span((section,)), f"`{section}:` names no component", hint)
        scope = self.context.constant_scope("domains are fixed")
        found: list[Component] = []
        for name in self.data[section]:
            component = self.context.declare.component((section, name), scope)
            if component is None:
                self.context.broken.add(name)
                component = self.context.declare.unknown(name, self.data[section][name])
            found.append(component)
        if not found:
            self.collector.raise_if_errors()
        size = sum(c.type.size for c in found)
        least = int(section != "memory" and bool(found))
        self.context.declare.fits(size, self.merged.key_span((section,)), f"`{section}:`", least)
        return tuple(found)

    def _horizon(self) -> int | None:
        value = self.data["horizon"]
        if value in (None, "none"):
            return None
        expr = self.context.forms.expr(("horizon",))
        scope = self.context.constant_scope("the horizon is fixed")
        try:
            steps = None if expr is None else self.context.checker.integer(expr, scope, "the horizon")
        except Poisoned:
            steps = None
        if expr is None or steps is None:
            self.context.constants["T"] = Lazy(poison)
            return None
        if not 1 <= steps <= Limits.horizon:
            self.collector.add("E407", expr.place, f"a horizon of {steps:,} steps is not possible",
                               f"between 1 and {Limits.horizon:,}, or `none`")  # fmt: skip
        return min(max(steps, 1), Limits.horizon)  # so that the time has values, and the rest is read with them

    def _discount(self) -> float:
        expr = self.context.forms.expr(("discount",)) if "discount" in self.data else None
        if expr is None:
            return 1.0
        try:
            node = self.context.checker.constant(expr, self.context.constant_scope("it is fixed"), "the discount")
        except Poisoned:
            return 1.0
        value = float(node.value) if node.type.is_scalar else -1.0
        if not 0 <= value <= 1:
            self.collector.add("E703", expr.place, "the discount is a number between 0 and 1")
        return value

    def _check_unused(self) -> None:
        """Definitions and noise that nothing uses are checked all the same."""
        context, scope = self.context, self.names.scope("reward")
        unused = [d for d in context.exprs["definitions"] if not any(signature(d)[0] in x.used for x in context.scopes)]
        for name in self.data.get("noise") or {}:
            context.resolve(scope.bindings[name], context.place("noise", name))
        for written in unused:
            name, binding = signature(written)[0], scope.bindings[signature(written)[0]]
            if isinstance(binding, FunctionDef):
                check_uncalled(self.collector, binding)
            else:
                context.resolve(binding, context.place("definitions", written))

    def _hash(self) -> str:
        """SHA-256 of what decides the task's behaviour: its semantic sections and its parameter values."""
        content = {section: self.data[section] for section in SEMANTIC if section in self.data}
        content["format"] = self.data.get("taskspec", 1)
        content["values"] = {p.name: p.value for p in self.context.parameters}
        return hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest()
