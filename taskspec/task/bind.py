"""What a spec declares for given parameter values: parameters, constants, components, horizon and discount."""

from __future__ import annotations

from typing import Any

from taskspec.base.diagnostics import suggest
from taskspec.base.limits import Limits
from taskspec.lang.ir import Const, reads
from taskspec.lang.scope import Lazy, Poisoned, Scope
from taskspec.lang.types import BOOL
from taskspec.source import Path
from taskspec.task import declare
from taskspec.task.context import Context, poison
from taskspec.task.declare import INSTANCE_SEED
from taskspec.task.task import Component

OPTIONS = frozenset({"task", "path", "variant", "render_mode", "ending", "observe_time", "modifiers", "num_envs",
                     "vectorization_mode", "vector_kwargs", "wrappers", "backend", "max_episode_steps",
                     "disable_env_checker"})  # fmt: skip
"""Keyword arguments of `gym.make`, `gym.make_vec` and our own makers, which no parameter may be called."""


def bind_parameters(context: Context, given: dict[str, Any]) -> None:
    entries = context.data.get("parameters") or {}
    names = [name for name in entries if name != "require"]
    given = _by_own_names(context, given, {entries[name].get("alias") or name: name for name in names})
    scope = context.constant_scope("parameters are fixed numbers")
    for name in names:
        _check_option(context, name)
        found = declare.bind_parameter(context, name, given, scope)
        if found is None:
            context.constants[name] = Lazy(poison)
            continue
        context.parameters.append(found[0])
        context.constants[name] = found[1]
        context.checker.parameters[name] = found[0].value
    if any(
        d.span is None for d in context.collector.diagnostics
    ):  # of values that were given, for which there is no task
        context.collector.raise_if_errors()
    if context.collector.has_errors:
        return  # requirements are about values that parameters can have
    for i, _ in enumerate(entries.get("require") or ()):
        _require(context, ("parameters", "require", i), scope)
    context.collector.raise_if_errors()


def _by_own_names(context: Context, given: dict[str, Any], aliases: dict[str, str]) -> dict[str, Any]:
    """Return values by the names that the spec itself uses; those of no parameter, and those given twice, are reported."""
    names = list(aliases.values())
    found = dict[str, Any]()
    for key, value in given.items():
        name = aliases.get(key, key)
        if name not in names:
            known = f"its parameters are {', '.join(names)}" if names else "it has no parameters"
            message = f"{context.merged.name} has no parameter '{key}'"
            context.collector.add("E702", None, message, suggest(key, [*names, *aliases]) or known)
        elif name in found:
            context.collector.add("E702", None, f"'{name}' and '{key}' are one parameter; give it once")
        found[name] = value
    return found


def _check_option(context: Context, name: str) -> None:
    for path, each in (((name,), name), ((name, "alias"), context.data["parameters"][name].get("alias"))):
        if each in OPTIONS:
            span = context.merged.key_span(("parameters", *path))
            message = f"'{each}' is an option of `gym.make` and of `taskspec.load`; a parameter cannot have its name"
            context.collector.add("E309", span, message)
    if name == INSTANCE_SEED and context.data["parameters"][name]["type"] != "int":
        span = context.merged.span(("parameters", name, "type"))
        context.collector.add(
            "E204", span, "the seed of an instance is an int", f"{name}: {{type: int, default: 0, low: 0}}"
        )


def _require(context: Context, path: Path, scope: Scope) -> None:
    expr = context.forms.expr((*path, "condition"))
    value = None if expr is None else context.checker.check(expr, scope)
    if expr is None or value is None:
        return
    if value.node.type == BOOL and reads([value.node]):
        context.required.append((value.node, context.forms.value((*path, "message"))))
        return  # it hangs on parameters that are left open
    if not isinstance(value.node, Const) or value.node.type != BOOL:
        context.collector.add("E306", expr.place, "a requirement is a condition on parameters")
    elif not value.node.value:
        message = context.forms.value((*path, "message"))
        values = ", ".join(f"{p.name}={p.value!r}" for p in context.parameters)
        context.collector.add("E704", expr.place, f"{message} ({values})")


def bind_constants(context: Context) -> None:
    seed = next((p.value for p in context.parameters if p.name == INSTANCE_SEED), None)
    scope = context.constant_scope()
    scope.used.add(INSTANCE_SEED)
    names = list(context.data.get("constants") or {})
    for name in names:
        make = lambda n=name: declare.constant(context, n, scope, seed)  # noqa: E731
        context.constants[name] = context.lazy(name, make)
    for name in names:
        context.resolve(context.constants[name], context.place("constants", name))


def fixed_constants(context: Context) -> dict[str, Const]:
    """Return the values of the constants."""
    found = {name: context.constant(name) for name in context.data.get("constants") or {}}
    return {name: value.node for name, value in found.items() if value and isinstance(value.node, Const)}


def bind_components(context: Context, section: str) -> tuple[Component, ...]:
    if not context.data[section]:
        hint = "where there is nothing to tell apart, one value is enough: `s: {type: choice, values: [only]}`"
        context.collector.add("E210", context.merged.key_span((section,)), f"`{section}:` names no component", hint)
    scope = context.constant_scope("domains are fixed")
    found: list[Component] = []
    for name in context.data[section]:
        component = declare.component(context, (section, name), scope)
        if component is None:
            context.broken.add(name)
            component = declare.broken_component(context, name, context.data[section][name])
        found.append(component)
    if not found:
        context.collector.raise_if_errors()
    size = sum(c.type.size for c in found)
    least = int(section != "memory" and bool(found))
    declare.fits(context, size, context.merged.key_span((section,)), f"`{section}:`", least)
    return tuple(found)


def bind_horizon(context: Context) -> int | None:
    value = context.data["horizon"]
    if value in (None, "none"):
        return None
    expr = context.forms.expr(("horizon",))
    scope = context.constant_scope("the horizon is fixed")
    try:
        steps = None if expr is None else context.checker.integer(expr, scope, "the horizon")
    except Poisoned:
        steps = None
    if expr is None or steps is None:
        context.constants["T"] = Lazy(poison)
        return None
    if not 1 <= steps <= Limits.horizon:
        context.collector.add("E407", expr.place, f"a horizon of {steps:,} steps is not possible",
                           f"between 1 and {Limits.horizon:,}, or `none`")  # fmt: skip
    return min(max(steps, 1), Limits.horizon)  # so that the time has values, and the rest is read with them


def bind_discount(context: Context) -> float:
    expr = context.forms.expr(("discount",)) if "discount" in context.data else None
    if expr is None:
        return 1.0
    try:
        node = context.checker.constant(expr, context.constant_scope("it is fixed"), "the discount")
    except Poisoned:
        return 1.0
    value = float(node.value) if node.type.is_scalar else -1.0
    if not 0 <= value <= 1:
        context.collector.add("E703", expr.place, "the discount is a number between 0 and 1")
    return value
