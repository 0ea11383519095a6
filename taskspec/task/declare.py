"""Parameters, constants and components: the declarations of a spec, evaluated for given parameter values."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

from taskspec import draws
from taskspec.base.diagnostics import Placed, suggest
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.lang.calls import static_shape
from taskspec.lang.evaluate import evaluate
from taskspec.lang.ir import Const, Node, Role, plain, reads
from taskspec.lang.scope import Poisoned, Scope, Value
from taskspec.lang.types import INT, INT_WIDEST, Domain, Kind, Refused, Type
from taskspec.lang.variates import WordLayout, sampler
from taskspec.source import Path
from taskspec.task.context import Context
from taskspec.task.parameters import Varying, article, brief, convert
from taskspec.task.task import Component, Parameter

_ENDLESS = {"low": -math.inf, "high": math.inf}
"""Bounds that are none."""
INSTANCE_SEED = "instance_seed"
INSTANCE = draws.RESET | 1 << 30
"""Phase of the draws made once per instance; its slots meet those of no step and no reset."""
KINDS = {"bool": Kind.BOOL, "int": Kind.INT, "real": Kind.REAL}


# -- parameters -----------------------------------------------------------------------------------------------


def bind_parameter(
    context: Context, name: str, given: Mapping[str, Any], scope: Scope
) -> tuple[Parameter, Value] | None:
    """Return a parameter bound to the given value or its default; None when it is broken (and reported)."""
    path: Path = ("parameters", name)
    entry = context.merged.data["parameters"][name]
    kind = entry.get("type", "real")
    labels = None if entry.get("values") is None else tuple(entry["values"])
    try:
        low, high = (_parameter_bound(context, entry, key, path, scope) for key in ("low", "high"))
        default = _default(context, entry, path, kind, labels, scope)
        domain = _domain(context, entry, path, scope) if kind == "choice" else None
    except Poisoned:
        return None
    asked = given.get(name, default)
    own = asked.value if isinstance(asked, Varying) else asked
    value = _converted(context, name, own, kind, labels) if name in given else default
    if value is None:
        return None
    if not _check_within(context, name, value, low, high, labels, name in given):
        if name in given or labels is not None:
            return None
        nearest = low if low is not None and not value >= low else high
        value = convert(nearest, kind)  # what reads the parameter can be checked with this one
        if value is None or not math.isfinite(value):
            return None
    shown = {k: entry.get(k) for k in ("symbol", "doc", "alias")}
    parameter = Parameter(name, kind, value, default, low, high, labels, **shown)
    if kind == "choice":
        assert labels is not None
        return parameter, Value(context.builder.scalar(labels.index(value)), domain)
    if isinstance(asked, Varying):
        ends = (-math.inf if low is None else low, math.inf if high is None else high)
        return parameter, Value(context.builder.read(Role.PARAMETER, name, Type(KINDS[kind]), *ends))
    return parameter, Value(context.builder.const(value, Type(KINDS[kind])))


def _parameter_bound(context: Context, entry: Mapping[str, Any], key: str, path: Path, scope: Scope) -> float | None:
    if entry.get(key) is None:
        return None
    expr = context.expr((*path, key))
    node = context.checker.constant(expr, scope, f"'{key}' of a parameter")
    if not node.type.is_scalar:
        context.checker.fail("E307", expr, f"'{key}' of a parameter is a single number")
    if node.value != node.value:
        context.checker.fail("E407", expr, f"'{key}' of a parameter is not a number")
    return None if node.value == _ENDLESS[key] else plain(node.value)


def _default(context: Context, entry: Mapping[str, Any], path: Path, kind: str, labels: Any, scope: Scope) -> Any:
    value = entry.get("default")
    if kind == "choice":
        if value not in (labels or ()):
            known = [str(label) for label in labels or ()]
            message = f"the default '{value}' is not one of {', '.join(known)}"
            context.collector.add("E213", context.merged.span((*path, "default")), message, suggest(str(value), known))
            raise Poisoned
        return value
    expr = context.expr((*path, "default"))
    node = context.checker.constant(expr, scope, "a default")
    found = convert(node.value, kind) if node.type.is_scalar else None
    if found is None:
        shown = f"{node.value}" if node.type.is_scalar and node.type.kind is KINDS[kind] else str(node.type)
        context.collector.add("E213", expr.place, f"the default is {shown}, but the parameter is {article(kind)}")
        raise Poisoned
    return found


def _converted(context: Context, name: str, value: Any, kind: str, labels: Any) -> Any:
    is_label = kind == "choice" and isinstance(value, str) and value in labels
    converted = str(value) if is_label else convert(value, kind)
    if converted is None:
        wanted = f"one of {', '.join(map(str, labels))}" if kind == "choice" else article(kind)
        context.collector.add("E703", None, f"parameter {name} must be {wanted}, not {brief(value)}")
    return converted


def _check_within(context: Context, name: str, value: Any, low: Any, high: Any, labels: Any, given: bool) -> bool:
    if labels is not None and value not in labels:
        problem = f"must be one of {', '.join(map(str, labels))}"
    elif labels is None and not isinstance(value, bool) and low is not None and not value >= low:
        problem = f"must be at least {low}"
    elif labels is None and not isinstance(value, bool) and high is not None and not value <= high:
        problem = f"must be at most {high}"
    else:
        return True
    path = ("parameters", name)
    if given:
        context.collector.add("E703", None, f"parameter {name} {problem}, not {value!r}",
                           notes=[f"declared at {context.merged.key_span(path)}"])  # fmt: skip
    else:
        context.collector.add("E213", context.merged.span((*path, "default")), f"the default {value!r} {problem}")
    return False


# -- constants ------------------------------------------------------------------------------------------------


def constant(context: Context, name: str, scope: Scope, seed: int | None) -> Value:
    """Return a constant: an expression, a text grid, or a draw made once per instance."""
    path: Path = ("constants", name)
    value = context.merged.data["constants"][name]
    if isinstance(value, dict) and "grid" in value:
        return Value(_grid(context, value, path, scope))
    expr = context.expr(path)
    with context.builder.written(apart=True) as written:
        found = context.checker.value(expr, scope)
    if isinstance(found.node, Const) or not written:
        return found  # one that is no constant depends on parameters that are left open
    if reads([found.node]):
        context.checker.fail("E312", expr, "what a constant is drawn from must be a constant")
    if seed is None:
        context.checker.fail("E311", expr, "this constant is drawn, but the task has no parameter 'instance_seed'",
                          "declare it: `instance_seed: {type: int, default: 0, low: 0}`")  # fmt: skip
    return Value(_drawn(context, found.node, WordLayout.dealt(written.values()), seed, name), found.domain)


def _drawn(context: Context, node: Node, layout: WordLayout, seed: int, name: str) -> Const:
    """Return the value of a constant drawn once: the same seed gives the same constant, independent of other declarations."""
    words = draws.block(seed, INSTANCE, zlib.crc32(name.encode()), 1, layout.count)[0].tolist()
    (flat,) = evaluate([node], {}, sampler(layout, words))
    return context.builder.const(flat if node.type.shape else flat[0], node.type)


def _grid(context: Context, value: dict[str, Any], path: Path, scope: Scope) -> Const:
    """Return a text grid: every character stands for what the legend says."""
    block = value["grid"] if isinstance(value["grid"], str) else None
    lines = value["grid"] if block is None else block.splitlines()
    legend = {str(k): _legend(context, k, path, scope) for k in value["legend"]}
    if len({node.type.shape for node in legend.values()}) > 1:
        _stop(context, "E307", (*path, "legend"), "the values of the legend have different shapes")
    where: Path = (*path, "grid")
    start = 0
    cells = []
    for row, line in enumerate(lines):
        here, start = ((*where, row), 0) if block is None else (where, start)
        _check_row(context, line, len(lines[0]), legend, here, start)
        cells += [legend[char] for char in line]
        start += len(line) + 1
    found = context.builder.structure("vector", cells)
    grid = context.builder.structure("reshape", [found], (len(lines), len(lines[0]), *found.type.shape[1:]))
    assert isinstance(grid, Const)
    return grid


def _check_row(context: Context, line: str, width: int, legend: Mapping[str, Node], path: Path, start: int) -> None:
    """Check a row of a text grid, which begins at a character of the text at a path."""
    if not line or len(line) != width:
        place = context.merged.span(path, start, start + len(line))
        context.collector.add("E307", place, f"this row has {len(line)} characters, the first has {width}")
        raise Poisoned
    for at, char in enumerate(line, start):
        if char not in legend:
            message = f"the legend does not say what '{char}' stands for"
            context.collector.add("E203", context.merged.span(path, at, at + 1), message, f"it has {' '.join(legend)}")
            raise Poisoned


def _legend(context: Context, key: str, path: Path, scope: Scope) -> Node:
    expr = context.expr((*path, "legend", key))
    return context.checker.constant(expr, scope, "a legend's value")


def _stop(context: Context, code: str, path: Path, message: str, hint: str | None = None) -> Any:
    context.collector.add(code, context.merged.span(path), message, hint)
    raise Poisoned


# -- components -----------------------------------------------------------------------------------------------


def component(context: Context, path: Path, scope: Scope) -> Component | None:
    """Return the state or action component declared at a path, or None when it is broken (and reported)."""
    name = str(path[-1])
    entry = context.forms.value(path)
    try:
        shape = _component_shape(context, entry, path, scope)
        shown = {k: entry.get(k) for k in ("symbol", "doc")}
        if entry["type"] == "choice":
            domain = _domain(context, entry, path, scope)
            size = Type(Kind.INT, shape).size
            top = float(len(domain.labels) - 1)
            return Component(name, Type(Kind.INT, shape), (0,) * size, (top,) * size, domain, **shown)
        type_ = Type(KINDS[entry["type"]], shape)
        low, high = _component_bounds(context, entry, path, type_, scope)
        return Component(name, type_, low, high, None, **shown)
    except Poisoned:
        return None
    except Refused as refused:
        context.collector.add(refused.code, context.merged.span(path), refused.message, refused.hint)
        return None


def broken_component(context: Context, name: str, entry: Mapping[str, Any]) -> Component:
    """Return what stands for a component that is broken: of its declaration, the labels are known."""
    values = entry.get("values")
    labels = tuple(map(str, values)) if values else ()
    domain = Domain(labels) if labels else None
    kind = Kind.REAL if domain is None else Kind.INT
    high = math.inf if domain is None else float(len(labels) - 1)
    return Component(name, Type(kind), (-math.inf if domain is None else 0.0,), (high,), domain)


def _component_shape(context: Context, entry: Mapping[str, Any], path: Path, scope: Scope) -> tuple[int, ...]:
    if entry.get("shape") in (None, []):
        return ()
    expr = context.expr((*path, "shape"))
    shape = static_shape(context.checker, expr, scope)
    if not fits(context, math.prod(shape), expr.place, "a component"):
        raise Poisoned
    return shape


def fits(context: Context, size: int, place: Placed, what: str, least: int = 0) -> bool:
    """Return whether the state, the action or the observation may have so many elements; reported (E307, E314) where
    it may not.
    """
    most = limits().width
    if size < least:
        context.collector.add(
            "E307", place, f"{what} has no element for these parameters", "add one that is always there"
        )
    if size > most:
        message = f"{what} of {count(size)} elements is too large; the limit is {most:,}"
        context.collector.add("E314", place, message, how_to_raise("width", size))
    return least <= size <= most


def _component_bounds(
    context: Context, entry: Mapping[str, Any], path: Path, type_: Type, scope: Scope
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if type_.kind is Kind.BOOL:
        return (0,) * type_.size, (1,) * type_.size
    low, high = (bound(context, entry, key, path, type_, scope) for key in ("low", "high"))
    check_order(context, low, high, path)
    return low, high


def check_order(context: Context, low: Sequence[float], high: Sequence[float], path: Path) -> None:
    """Refuse (E407) bounds between which no value lies."""
    for a, b in zip(low, high, strict=True):
        if not a <= b or a == math.inf or b == -math.inf:
            message = f"no value lies between low = {_shown(a)} and high = {_shown(b)}"
            written = context.forms.value(path)
            ends = (context.forms.expr((*path, key)) for key in ("low", "high") if written.get(key) is not None)
            context.collector.add("E407", context.merged.span(path), message, notes=context.checker.values_of(*ends))
            raise Poisoned


def bound(
    context: Context, entry: Mapping[str, Any], key: str, path: Path, type_: Type, scope: Scope
) -> tuple[float, ...]:
    if entry.get(key) is None:
        return ((-math.inf if key == "low" else math.inf),) * type_.size
    expr = context.expr((*path, key))
    node = context.builder.stretch(context.checker.constant(expr, scope, f"'{key}'"), type_.shape)
    if node.type.shape != type_.shape or not isinstance(node, Const):
        context.checker.fail(
            "E307",
            expr,
            f"'{key}' has shape {list(node.type.shape)}, the component {list(type_.shape)}",
        )
    flat = tuple(float(v) + 0.0 for v in node.flat)  # no -0.0: between 0.0 and that, NumPy draws no number
    if (
        type_.kind is Kind.INT
        and node.type.kind is Kind.REAL
        and not all(v.is_integer() or math.isinf(v) for v in flat)
    ):
        context.checker.fail("E306", expr, f"'{key}' of an int component must be an int")
    if type_.kind is Kind.INT and any(INT_WIDEST < abs(v) < math.inf for v in flat):
        context.checker.fail("E318", expr, "ints have 64 bits; this is too large", "a real has no such limit")
    return flat


def _domain(context: Context, entry: Mapping[str, Any], path: Path, scope: Scope) -> Domain:
    """Return labels of a choice, and their values when it is mapped or its labels are numbers."""
    values = entry["values"]
    symbols = None if entry.get("symbols") is None else tuple(str(x) for x in entry["symbols"])
    labels = tuple(str(v).lower() if isinstance(v, bool) else str(v) for v in values)
    if symbols is not None and len(symbols) != len(labels):
        _stop(context, "E214", (*path, "symbols"), f"{len(symbols)} symbols for {len(labels)} labels")
    if len(set(labels)) < len(labels):
        _stop(context, "E309", (*path, "values"), "a label is given twice")
    if isinstance(values, list):
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
            return Domain(labels, symbols=symbols)
        nodes: list[Node] = [context.builder.scalar(v) for v in values]
    else:
        nodes = [_mapped(context, (*path, "values", key), scope) for key in values]
    if len({n.type.shape for n in nodes}) > 1:
        _stop(context, "E307", (*path, "values"), "the values of the labels have different shapes")
    kind = max(INT.kind, *(n.type.kind for n in nodes)) if len(nodes) > 1 else max(INT.kind, nodes[0].type.kind)
    constants = [context.builder.cast(n, kind) for n in nodes]
    flats = tuple(_value(c) for c in constants)
    return Domain(labels, flats, Type(kind, nodes[0].type.shape), symbols)


def _mapped(context: Context, path: Path, scope: Scope) -> Node:
    expr = context.expr(path)
    return context.checker.constant(expr, scope, "the value of a label")


def _value(node: Node) -> Any:
    assert isinstance(node, Const)
    return node.flat if node.type.shape else node.value


def _shown(value: float) -> str:
    return f"{value:g}"
