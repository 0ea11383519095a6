"""Declarations of a spec for given parameter values: parameters, constants, components, horizon and discount."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

from taskspec.base.diagnostics import Placed, suggest
from taskspec.base.limits import Limits, count, how_to_raise, limits
from taskspec.language import draws
from taskspec.language.expressions.calls import static_shape
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Const, Node, have_one_shape, plain, reads
from taskspec.language.expressions.scope import Lazy, Poisoned, Scope, Value
from taskspec.language.expressions.types import BOOL, INT, INT_WIDEST, Domain, Kind, Refused, Role, Type, total_size
from taskspec.language.expressions.variates import WordLayout, sampler
from taskspec.language.source import Path
from taskspec.language.task.context import Context, poison
from taskspec.language.task.parts import Component, Parameter, Varying, article, brief, convert

OPTIONS = frozenset({"task", "path", "variant", "render_mode", "ending", "observe_time", "modifiers", "num_envs",
                     "vectorization_mode", "vector_kwargs", "wrappers", "backend", "max_episode_steps",
                     "disable_env_checker"})  # fmt: skip
"""Keyword arguments of `gym.make`, `gym.make_vec` and our own makers, which no parameter may be called."""
_ENDLESS = {"low": -math.inf, "high": math.inf}
"""Bounds that are none."""
INSTANCE_SEED = "instance_seed"
INSTANCE = draws.RESET | 1 << 30
"""Phase of the draws made once per instance; no step and no reset has its slots."""
KINDS = {"bool": Kind.BOOL, "int": Kind.INT, "real": Kind.REAL}


# -- parameters -----------------------------------------------------------------------------------------------


def bind_parameters(context: Context, given: dict[str, Any]) -> None:
    """Bind all parameters to the given values or their defaults, and check the conditions across them.

    Raises:
        SpecError: for given values that parameters cannot have, or that may not go together.
    """
    entries = context.data.get("parameters") or {}
    names = []
    for name in entries:
        if name != "require":
            names.append(name)
    given = _by_own_names(context, given, {entries[name].get("alias") or name: name for name in names})
    scope = context.constant_scope("parameters are fixed numbers")
    for name in names:
        _check_option(context, name)
        parameter = _bind_parameter(context, name, given, scope)
        if parameter is None:
            context.constants[name] = Lazy(poison)
            continue
        context.parameters.append(parameter[0])
        context.constants[name] = parameter[1]
        context.checker.parameters[name] = parameter[0].value
    without_place = []
    for d in context.collector.diagnostics:
        if d.span is None:
            without_place.append(d)
    if without_place:  # of values that were given: there is no task for them
        context.collector.raise_if_errors()
    if context.collector.has_errors:
        return  # requirements are about values that parameters can have
    for i, _ in enumerate(entries.get("require") or ()):
        _require(context, ("parameters", "require", i), scope)
    context.collector.raise_if_errors()


def _by_own_names(context: Context, given: dict[str, Any], aliases: dict[str, str]) -> dict[str, Any]:
    names = list(aliases.values())
    values = dict[str, Any]()
    for key, value in given.items():
        name = aliases.get(key, key)
        if name not in names:
            known = suggest(key, [*names, *aliases]) or f"its parameters are {', '.join(names) or 'none'}"
            context.collector.add("E702", None, f"{context.merged.name} has no parameter '{key}'", known)
        elif name in values:
            context.collector.add("E702", None, f"'{name}' and '{key}' are one parameter; give it once")
        values[name] = value
    return values


def _check_option(context: Context, name: str) -> None:
    entry = context.data["parameters"][name]
    path: Path = ("parameters", name)
    for place, each in ((path, name), ((*path, "alias"), entry.get("alias"))):
        if each in OPTIONS:
            message = f"'{each}' is an option of `gym.make` and of `taskspec.load`; a parameter cannot have its name"
            context.report_key("E309", place, message)
    if name == INSTANCE_SEED and entry["type"] != "int":
        hint = f"{name}: {{type: int, default: 0, low: 0}}"
        context.report("E204", (*path, "type"), "the seed of an instance is an int", hint)


def _require(context: Context, path: Path, scope: Scope) -> None:
    expr = context.forms.expr((*path, "condition"))
    value = context.checker.check(expr, scope)
    if expr is None or value is None:
        return
    message = context.forms.value((*path, "message"))
    if value.node.type == BOOL and reads([value.node]):  # it depends on parameters that are left open
        context.required.append((value.node, message))
    elif not isinstance(value.node, Const) or value.node.type != BOOL:
        context.collector.add("E306", expr.place, "a requirement is a condition on parameters")
    elif not value.node.value:
        values = ", ".join(f"{p.name}={p.value!r}" for p in context.parameters)
        context.collector.add("E704", expr.place, f"{message} ({values})")


def _bind_parameter(
    context: Context, name: str, given: Mapping[str, Any], scope: Scope
) -> tuple[Parameter, Value] | None:
    path: Path = ("parameters", name)
    entry = context.data["parameters"][name]
    kind = entry.get("type", "real")
    labels = None
    if entry.get("values") is not None:
        labels = tuple(entry["values"])
    try:
        low = _parameter_bound(context, "low", path, scope)
        high = _parameter_bound(context, "high", path, scope)
        if low is not None and high is not None:
            check_order(context, [low], [high], path)
        default = _default(context, entry, path, labels, scope)
        domain = None
        if kind == "choice":
            domain = _domain(context, entry, path, scope)
        asked = given.get(name, default)
        value = default
        if name in given:
            value = _converted(context, name, asked, kind, labels)
    except Poisoned:
        return None
    if not _check_within(context, name, value, low, high, labels, name in given):
        return None
    shown = {key: entry.get(key) for key in ("symbol", "doc", "alias")}
    parameter = Parameter(name, kind, value, default, low, high, labels, **shown)
    if labels is not None:
        return parameter, Value(context.builder.scalar(labels.index(value)), domain)
    if isinstance(asked, Varying):
        return parameter, Value(context.builder.read(Role.PARAMETER, name, Type(KINDS[kind]), *parameter.ends))
    return parameter, Value(context.builder.const(value, Type(KINDS[kind])))


def _parameter_bound(context: Context, key: str, path: Path, scope: Scope) -> float | None:
    if context.forms.value(path).get(key) is None:
        return None
    expr = context.expr((*path, key))
    node = context.checker.constant(expr, scope, f"'{key}' of a parameter")
    if not node.type.is_scalar:
        context.checker.fail("E307", expr, f"'{key}' of a parameter is a single number")
    if node.value != node.value:
        context.checker.fail("E407", expr, f"'{key}' of a parameter is not a number")
    if node.value == _ENDLESS[key]:
        return None
    return plain(node.value)


def _default(context: Context, entry: Mapping[str, Any], path: Path, labels: Any, scope: Scope) -> Any:
    value = entry.get("default")
    kind = entry.get("type", "real")
    if kind == "choice":
        if value not in labels:
            known = list(map(str, labels))
            message = f"the default '{value}' is not one of {', '.join(known)}"
            context.stop("E213", (*path, "default"), message, suggest(str(value), known))
        return value
    expr = context.expr((*path, "default"))
    node = context.checker.constant(expr, scope, "a default")
    converted = convert(node.value, kind)
    if converted is None:
        message = f"the default is {brief(node.value)} ({node.type}), but the parameter is {article(kind)}"
        context.collector.add("E213", expr.place, message)
        raise Poisoned
    return converted


def _converted(context: Context, name: str, value: Any, kind: str, labels: Any) -> Any:
    if isinstance(value, Varying):
        value = value.value
    if kind == "choice" and isinstance(value, str) and value in labels:
        return value
    converted = convert(value, kind)
    if converted is None:
        if kind != "choice":
            wanted = article(kind)
        else:
            wanted = f"one of {', '.join(map(str, labels))}"
        context.collector.add("E703", None, f"parameter {name} must be {wanted}, not {brief(value)}")
        raise Poisoned
    return converted


def _check_within(context: Context, name: str, value: Any, low: Any, high: Any, labels: Any, given: bool) -> bool:
    problem = None
    if labels is None and low is not None and not value >= low:
        problem = f"must be at least {low}"
    elif labels is None and high is not None and not value <= high:
        problem = f"must be at most {high}"
    if problem is None:
        return True
    path = ("parameters", name)
    if given:
        notes = [f"declared at {context.merged.key_span(path)}"]
        context.collector.add("E703", None, f"parameter {name} {problem}, not {value!r}", notes=notes)
    else:
        context.report("E213", (*path, "default"), f"the default {value!r} {problem}")
    return False


# -- constants ------------------------------------------------------------------------------------------------


def bind_constants(context: Context, resolve: bool = True) -> None:
    """Bind the constants, each worked out on first use; then `resolve` those that were not used, for their mistakes."""
    seed = next((p.value for p in context.parameters if p.name == INSTANCE_SEED), None)
    scope = context.constant_scope()
    scope.used.add(INSTANCE_SEED)
    names = list(context.data.get("constants") or {})
    for name in names:
        make = lambda n=name: _constant(context, n, scope, seed)  # noqa: E731
        context.constants[name] = context.lazy(name, make)
    for name in names if resolve else ():
        context.resolve(context.constants[name], context.place("constants", name))


def fixed_constants(context: Context) -> dict[str, Const]:
    constants = {name: context.constant(name) for name in context.data.get("constants") or {}}
    return {name: value.node for name, value in constants.items() if value and isinstance(value.node, Const)}


def _constant(context: Context, name: str, scope: Scope, seed: int | None) -> Value:
    path: Path = ("constants", name)
    value = context.data["constants"][name]
    if isinstance(value, dict) and "grid" in value:
        return Value(_grid(context, value, path, scope))
    expr = context.expr(path)
    with context.builder.written(apart=True) as written:
        result = context.checker.value(expr, scope)
    if isinstance(result.node, Const) or not written:
        return result  # one that is no constant depends on parameters that are left open
    if reads([result.node]):
        context.checker.fail("E312", expr, "what a constant is drawn from must be a constant")
    if seed is None:
        hint = "declare it: `instance_seed: {type: int, default: 0, low: 0}`"
        context.checker.fail(
            "E311", expr, "this constant is drawn, but the task has no parameter 'instance_seed'", hint
        )
    # The same seed gives the same constant, independent of other declarations.
    layout = WordLayout.dealt(written.values())
    words = draws.block(seed, INSTANCE, zlib.crc32(name.encode()), 1, layout.count)[0].tolist()
    (flat,) = evaluate([result.node], {}, sampler(layout, words))
    return Value(context.builder.constant(flat, result.node.type), result.domain)


def _grid(context: Context, value: dict[str, Any], path: Path, scope: Scope) -> Const:
    is_block = isinstance(value["grid"], str)
    if is_block:
        lines = value["grid"].splitlines()
    else:
        lines = value["grid"]
    legend = {}
    for key in value["legend"]:
        legend[str(key)] = context.checker.constant(context.expr((*path, "legend", key)), scope, "a legend's value")
    if not have_one_shape(legend.values()):
        context.stop("E307", (*path, "legend"), "the values of the legend have different shapes")
    start = 0
    cells = []
    for row, line in enumerate(lines):
        here: Path = (*path, "grid", row)
        if is_block:
            here = (*path, "grid")
        if not line or len(line) != len(lines[0]):
            message = f"this row has {len(line)} characters, the first has {len(lines[0])}"
            context.collector.add("E307", context.merged.span(here, start, start + len(line)), message)
            raise Poisoned
        for at, char in enumerate(line, start):
            if char not in legend:
                message = f"the legend, which has {' '.join(legend)}, does not say what '{char}' stands for"
                context.collector.add("E203", context.merged.span(here, at, at + 1), message)
                raise Poisoned
            cells.append(legend[char])
        start += (len(line) + 1) * is_block
    vector = context.builder.structure("vector", cells)
    grid = context.builder.structure("reshape", [vector], (len(lines), len(lines[0]), *vector.type.shape[1:]))
    assert isinstance(grid, Const)
    return grid


# -- components -----------------------------------------------------------------------------------------------


def bind_components(context: Context, section: str) -> tuple[Component, ...]:
    """Read the components of a section; of a broken one (reported), the labels are known."""
    if not context.data[section]:
        hint = "where there is nothing to tell apart, one value is enough: `s: {type: choice, values: [only]}`"
        context.report_key("E210", (section,), f"`{section}:` names no component", hint)
        return ()
    scope = context.constant_scope("domains are fixed")
    components: list[Component] = []
    for name, entry in context.data[section].items():
        c = component(context, (section, name), scope)
        if c is None:
            context.broken.add(name)
            labels = tuple(map(str, entry.get("values") or ()))
            c = Component(name, Type(Kind.REAL), (-math.inf,), (math.inf,))
            if labels:
                c = Component(name, Type(Kind.INT), (0.0,), (float(len(labels) - 1),), Domain(labels))
        components.append(c)
    size = total_size(components)
    fits(context, size, context.merged.key_span((section,)), f"`{section}:`", int(section != "memory"))
    return tuple(components)


def component(context: Context, path: Path, scope: Scope) -> Component | None:
    """Read the component declared at a path; None for a broken one (reported)."""
    name = str(path[-1])
    entry = context.forms.value(path)
    shown = {k: entry.get(k) for k in ("symbol", "doc")}
    try:
        shape: tuple[int, ...] = ()
        if entry.get("shape") not in (None, []):
            expr = context.expr((*path, "shape"))
            shape = static_shape(context.checker, expr, scope)
            if not fits(context, math.prod(shape), expr.place, "a component"):
                return None
        if entry["type"] == "choice":
            domain = _domain(context, entry, path, scope)
            type_ = Type(Kind.INT, shape)
            top = float(len(domain.labels) - 1)
            return Component(name, type_, (0,) * type_.size, (top,) * type_.size, domain, **shown)
        type_ = Type(KINDS[entry["type"]], shape)
        if type_.kind is Kind.BOOL:
            return Component(name, type_, (0,) * type_.size, (1,) * type_.size, None, **shown)
        low = bound(context, "low", path, type_, scope)
        high = bound(context, "high", path, type_, scope)
        check_order(context, low, high, path)
        return Component(name, type_, low, high, None, **shown)
    except Poisoned:
        return None
    except Refused as refused:
        context.report(refused.code, path, refused.message, refused.hint)
        return None


def fits(context: Context, size: int, place: Placed, what: str, least: int = 0) -> bool:
    """Test whether something may have so many elements; reported (E307, E314) where it may not."""
    most = limits().width
    if size < least:
        message = f"{what} has no element for these parameters"
        context.collector.add("E307", place, message, "add one that is always there")
    if size > most:
        message = f"{what} of {count(size)} elements is too large; the limit is {most:,}"
        context.collector.add("E314", place, message, how_to_raise("width", size))
    return least <= size <= most


def check_order(context: Context, low: Sequence[float], high: Sequence[float], path: Path) -> None:
    """Refuse (E407) bounds between which no value lies."""
    for a, b in zip(low, high, strict=True):
        if not a <= b or a == math.inf or b == -math.inf:
            message = f"no value lies between low = {a:g} and high = {b:g}"
            written = context.forms.value(path)
            ends = []
            for key in ("low", "high"):
                if written.get(key) is not None:
                    ends.append(context.forms.expr((*path, key)))
            context.collector.add("E407", context.merged.span(path), message, notes=context.checker.values_of(*ends))
            raise Poisoned


def bound(context: Context, key: str, path: Path, type_: Type, scope: Scope) -> tuple[float, ...]:
    """Read a bound of the component declared at a path, one number for each element."""
    if context.forms.value(path).get(key) is None:
        return (_ENDLESS[key],) * type_.size
    expr = context.expr((*path, key))
    node = context.builder.stretch(context.checker.constant(expr, scope, f"'{key}'"), type_.shape)
    if node.type.shape != type_.shape or not isinstance(node, Const):
        message = f"'{key}' has shape {list(node.type.shape)}, the component {list(type_.shape)}"
        context.checker.fail("E307", expr, message)
    flat = tuple(float(v) + 0.0 for v in node.flat)  # no -0.0: between 0.0 and that, NumPy draws no number
    if type_.kind is Kind.INT:
        if not all(v.is_integer() or math.isinf(v) for v in flat):
            context.checker.fail("E306", expr, f"'{key}' of an int component must be an int")
        if any(INT_WIDEST < abs(v) < math.inf for v in flat):
            context.checker.fail("E318", expr, "ints have 64 bits; this is too large", "a real has no such limit")
    return flat


def _domain(context: Context, entry: Mapping[str, Any], path: Path, scope: Scope) -> Domain:
    values = entry["values"]
    here: Path = (*path, "values")
    symbols = None
    if entry.get("symbols") is not None:
        symbols = tuple(entry["symbols"])
    labels = tuple(map(str, values))
    if isinstance(values, list):
        return Domain(labels, symbols=symbols)
    nodes = []
    for key in values:
        nodes.append(context.checker.constant(context.expr((*here, key)), scope, "the value of a label"))
    if not have_one_shape(nodes):
        context.stop("E307", here, "the values of the labels have different shapes")
    kind = max(INT.kind, *(n.type.kind for n in nodes))
    flats = []
    for node in nodes:
        number: Node = context.builder.cast(node, kind)
        assert isinstance(number, Const)
        flats.append(number.flat if number.type.shape else number.value)
    return Domain(labels, tuple(flats), Type(kind, nodes[0].type.shape), symbols)


# -- horizon and discount -------------------------------------------------------------------------------------


def bind_horizon(context: Context) -> int | None:
    if context.data["horizon"] in (None, "none"):
        return None
    try:
        expr = context.expr(("horizon",))
        steps = context.checker.integer(expr, context.constant_scope("the horizon is fixed"), "the horizon")
    except Poisoned:
        context.constants["T"] = Lazy(poison)
        return None
    if not 1 <= steps <= Limits.horizon:
        hint = f"between 1 and {Limits.horizon:,}, or `none`"
        context.collector.add("E407", expr.place, f"a horizon of {steps:,} steps is not possible", hint)
    return min(max(steps, 1), Limits.horizon)  # so that the time has values, and the rest is read with them


def bind_discount(context: Context) -> float:
    """Read the discount; 1 where it is not given, or broken (reported)."""
    if "discount" not in context.data:
        return 1.0
    try:
        expr = context.expr(("discount",))
        node = context.checker.constant(expr, context.constant_scope("it is fixed"), "the discount")
    except Poisoned:
        return 1.0
    if node.type.is_scalar and 0 <= node.value <= 1:
        return float(node.value)
    context.collector.add("E411", expr.place, "the discount is a number between 0 and 1")
    return 1.0
