"""Calls: functions of the table, distributions, `fold`, and an author's own definitions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NoReturn

from taskspec.base.diagnostics import Collector, suggest
from taskspec.lang import basechecker, dists, sets, subscripts, tables
from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker
from taskspec.lang.hints import advice
from taskspec.lang.ir import Const, Node
from taskspec.lang.operators import FUNCTIONS
from taskspec.lang.scope import FunctionDef, Lazy, Scope, Value
from taskspec.lang.types import Domain, Kind, Shape, Type

NAMES = ("fold", "scan")
Applied = Callable[[BaseChecker, FunctionDef, s.Call, list[Value]], Value]


def folded(checker: BaseChecker, expr: s.Call, scope: Scope, apply: Applied) -> Value:
    """Return the value of `fold(f, start, x)` or `scan(f, start, x)`; `apply` is a call of f, with values for its arguments."""
    if len(expr.args) != 3 or expr.keywords:
        checker.fail("E304", expr, f"{expr.function}(f, start, x) was given the wrong arguments")
    written, start, vector = expr.args
    step = scope.lookup(written.id) if isinstance(written, s.Name) and not written.primed else None
    if not isinstance(step, FunctionDef) or len(step.arguments) != 2:
        own = [n for n in scope.names() if isinstance(scope.lookup(n), FunctionDef)]
        near = suggest(written.id, own) if isinstance(written, s.Name) else None
        hint = near or '`definitions: {"f(value, element)": value + element}`, then `fold(f, 0, x)`'
        checker.fail("E306", written, f"{expr.function} needs a definition with two arguments first", hint)
    values = checker.each([lambda: checker.value(start, scope), lambda: Value(checker.numeric(vector, scope))])
    value = basechecker.named(values[0], start, scope)
    x = values[1].node
    if x.type.is_scalar:
        checker.fail("E306", vector, f"{expr.function} goes through a vector, not {x.type}")
    checker.expand(expr, x.type.shape[0])
    found = []
    is_late = basechecker.varies(expr, scope)
    for i in range(x.type.shape[0]):
        element = Value(checker.builder.structure("element", [x], (i,)), late=basechecker.varies(vector, scope))
        value = replace(apply(checker, step, expr, [value, element]), late=is_late)
        found.append(value)
    if expr.function == "fold":
        return value
    nodes = [checker.number_of(v) for v in found]
    if len({n.type.shape for n in nodes}) > 1:
        checker.fail("E307", expr, "the intermediate values have different shapes")
    return Value(checker.stack(nodes, expr))


# Calls: functions of the table, distributions, an author's own definitions.

NO_DRAWS = "a definition draws nothing, so name the draw under `noise`"
SET_FUNCTIONS = ("box", "range")


def is_function(name: str) -> bool:
    """Return whether the language itself has a function or distribution of this name."""
    return name in FUNCTIONS or dists.is_distribution(name) or name in SET_FUNCTIONS or name in NAMES


def call(checker: BaseChecker, expr: s.Call, scope: Scope, want: Domain | None) -> Value:
    """Return the value of a call."""
    binding = scope.lookup(expr.function)
    if isinstance(binding, FunctionDef):
        return _own(checker, binding, expr, scope, want)
    if isinstance(binding, Lazy):
        binding.resolve(
            s.Name(expr.function, False, expr.name_place)
        )  # a function whose body is broken goes no further
    if binding is not None:
        checker.collector.add("E303", expr.name_place, f"'{expr.function}' is a value, not a function")
        _poison(checker, expr, scope)
    if expr.function in FUNCTIONS:
        return Value(_built_in(checker, expr, scope))
    if dists.is_distribution(expr.function):
        return _distribution(checker, expr, scope, want)
    if expr.function in NAMES:
        return folded(checker, expr, scope, _applied)
    if expr.function in SET_FUNCTIONS:
        checker.fail("E306", expr, f"`{expr.function}(...)` is a set, not a value",
                     f"use it in a comprehension: `{{x for x in {expr.function}(...)}}`")  # fmt: skip
    no_function(checker.collector, expr, scope)
    _poison(checker, expr, scope)


def no_function(collector: Collector, expr: s.Call, scope: Scope) -> None:
    """Report a function that does not exist."""
    own = (n for n in scope.names() if isinstance(scope.lookup(n), FunctionDef))
    known = advice(expr.function, dict(expr.keywords))
    hint = known or suggest(expr.function, (*FUNCTIONS, *dists.DISTS, dists.CATEGORICAL.name, *own))
    collector.add("E303", expr.name_place, f"there is no function '{expr.function}'", hint)


def _poison(checker: BaseChecker, expr: s.Call, scope: Scope) -> NoReturn:
    """Give up on a call after looking for mistakes in its arguments too."""
    checker.numerics([e for e in expr.args if not isinstance(e, s.Weights | s.SetOf | s.Comprehension)], scope)
    checker.poison()


def _no_keywords(checker: BaseChecker, expr: s.Call) -> None:
    refuse_keywords(checker.collector, expr)
    if expr.keywords:
        checker.poison()


def refuse_keywords(collector: Collector, expr: s.Call) -> None:
    """Report the keyword arguments of a function that takes none."""
    for name, value in expr.keywords:
        message = f"'{expr.function}' takes no keyword arguments"
        collector.add("E305", _keyword(name, value), message, f"write it without `{name}=`; `==` compares")


def _keyword(name: str, value: s.Expr) -> s.Place:
    """Return the place of the name before `=`, which stands directly before its value."""
    text = value.place.text
    end = value.place.start
    start = text.value.rfind(name, 0, end)
    return s.Place(text, start, start + len(name)) if start >= 0 else value.place


def _built_in(checker: BaseChecker, expr: s.Call, scope: Scope) -> Node:
    function = FUNCTIONS[expr.function]
    _no_keywords(checker, expr)
    nodes = basechecker.operands(checker, expr.args, scope)
    if not function.accepts(len(nodes)):
        checker.fail("E304", expr, f"{function.signature} was given {count_of(len(nodes))}")
    for index in function.static:
        if not isinstance(nodes[index], Const):
            checker.fail(
                "E312",
                expr.args[index],
                f"'{function.arguments[index]}' of {expr.function} must be a constant",
            )
    for i in function.indices:
        nodes[i] = subscripts.argument(checker, nodes[i], nodes[0], expr.args[i], scope)
    return function.build(checker.builder, nodes)


def count_of(n: int) -> str:
    """`1 argument`, `2 arguments`."""
    return f"{n} argument{'' if n == 1 else 's'}"


def _own(checker: BaseChecker, function: FunctionDef, expr: s.Call, scope: Scope, want: Domain | None) -> Value:
    _no_keywords(checker, expr)
    checker.expand(expr)
    values = checker.each([(lambda e=e: checker.value(e, scope)) for e in expr.args])  # type: ignore[misc]
    if not function.accepts(len(values)):
        checker.fail("E304", expr, f"{function.signature} was given {count_of(len(values))}")
    given = [basechecker.named(v, e, scope) for v, e in zip(values, expr.args, strict=True)]
    return _applied(checker, function, expr, given, want)


def _applied(
    checker: BaseChecker, function: FunctionDef, expr: s.Call, given: list[Value], want: Domain | None = None
) -> Value:
    """Return a definition with these values for its arguments."""
    leave = function.enter(expr)
    try:
        inner = function.scope.child(dict(zip(function.arguments, given, strict=True)))
        inner.draws = NO_DRAWS
        return checker.value(function.body, inner, want)
    finally:
        leave()


# -- distributions ------------------------------------------------------------------------------------------------


def _distribution(checker: BaseChecker, expr: s.Call, scope: Scope, want: Domain | None) -> Value:
    if scope.draws is not None:
        checker.fail("E311", expr, f"{expr.function} is a random draw; {scope.draws}")
    first = expr.args[0] if len(expr.args) == 1 and not expr.keywords else None
    if expr.function == "Uniform" and isinstance(first, s.SetOf | s.Comprehension):
        return sets.uniform(checker, first, expr, scope, want)
    if expr.function == "Categorical" and isinstance(first, s.Weights):
        return tables.weighted(checker, first, scope, want)
    if expr.function == "Categorical":
        return Value(_categorical(checker, expr, scope))
    dist = dists.DISTS[expr.function]
    nodes, shape = _bind(checker, dist, expr, scope)
    _check_parameters(checker, dist, nodes, expr)
    return Value(dist.build(checker.builder, nodes, shape))


def _categorical(checker: BaseChecker, expr: s.Call, scope: Scope) -> Node:
    nodes, shape = _bind(checker, dists.CATEGORICAL, expr, scope)
    p = nodes["p"]
    if len(p.type.shape) != 1:
        checker.fail(
            "E306",
            expr,
            "Categorical needs a vector of probabilities, or `{value: probability, ...}`",
        )
    p = checker.builder.cast(p, Kind.REAL)
    tables.check_row(checker, p, expr)
    return dists.CATEGORICAL.build(checker.builder, {"p": p}, shape)


def _bind(checker: BaseChecker, dist: dists.Dist, expr: s.Call, scope: Scope) -> tuple[dict[str, Node], Shape]:
    """Return arguments by name, defaults filled in, all of one shape or scalar; and the shape of the draw."""
    given, shape = _given(checker, dist, expr, scope)
    names = [a.name for a in dist.arguments]
    nodes = dict(zip(given, checker.numerics(given.values(), scope), strict=True))
    for argument in dist.arguments:
        if argument.name not in nodes:
            if argument.default is None:
                checker.fail(
                    "E304",
                    expr,
                    f"{dist.name} needs '{argument.name}'",
                    f"{dist.name}({', '.join(names)})",
                )
            nodes[argument.name] = checker.builder.scalar(argument.default)
        node = nodes[argument.name]
        place = given.get(argument.name, expr)
        if argument.static and not (
            isinstance(node, Const) and node.type.is_scalar and node.type.kind is not Kind.REAL
        ):
            checker.fail("E312", place, f"'{argument.name}' of {dist.name} must be a constant int", argument.otherwise)
        if argument.vector and len(node.type.shape) != 1:
            checker.fail("E306", place, f"'{argument.name}' of {dist.name} must be a vector")
    return nodes, _draw_shape(checker, dist, nodes, shape, expr)


def _given(
    checker: BaseChecker, dist: dists.Dist, expr: s.Call, scope: Scope
) -> tuple[dict[str, s.Expr], Shape | None]:
    names = [a.name for a in dist.arguments]
    if len(expr.args) > len(names):
        checker.fail("E304", expr, f"{dist.name}({', '.join(names)}) was given {count_of(len(expr.args))}")
    given = dict(zip(names, expr.args, strict=False))
    shape = None
    for name, value in expr.keywords:
        if name == "shape" and dist.shaped:
            shape = static_shape(checker, value, scope)
        elif name not in names:
            known = [*names, *(["shape"] if dist.shaped else [])]
            hint = suggest(name, known) or f"it takes {', '.join(known)}"
            checker.collector.add("E305", _keyword(name, value), f"{dist.name} has no argument '{name}'", hint)
            checker.poison()
        elif name in given:
            checker.fail("E304", value, f"'{name}' of {dist.name} is given twice")
        else:
            given[name] = value
    return given, shape


def static_shape(checker: BaseChecker, expr: s.Expr, scope: Scope) -> Shape:
    """Return a shape: a constant int or a short vector of them."""
    node = checker.constant(expr, scope, "a shape")
    if node.type.kind is Kind.REAL or len(node.type.shape) > 1 or node.type.size > 4:
        checker.fail("E306", expr, "a shape is an int or a list of a few ints")
    shape = tuple(int(n) for n in node.flat)
    if any(n < 0 for n in shape):
        checker.fail("E307", expr, f"a shape is made of sizes, not {list(shape)}")
    return shape


def _draw_shape(
    checker: BaseChecker, dist: dists.Dist, nodes: dict[str, Node], shape: Shape | None, expr: s.Call
) -> Shape:
    if dist is dists.CATEGORICAL or not dist.shaped:
        return shape or ()
    shapes = {n.type.shape for n in nodes.values() if n.type.shape}
    found = shapes | ({shape} if shape is not None else set())
    if len(found) > 1:
        checker.fail(
            "E307",
            expr,
            f"the shapes {' and '.join(str(list(x)) for x in sorted(found))} do not match",
        )
    return found.pop() if found else ()


def _check_argument(
    checker: BaseChecker, dist: dists.Dist, argument: dists.Argument, node: Const, expr: s.Call
) -> None:
    name = argument.name
    least = min(node.flat)
    most = max(node.flat)
    if math.isinf(argument.high) and not all(math.isfinite(v) for v in node.flat):
        checker.fail("E408", expr, f"'{name}' of {dist.name} is not finite")
    if not (least > argument.low if argument.open else least >= argument.low):
        limit = f"{'above' if argument.open else 'at least'} {argument.low:g}"
        checker.fail("E408", expr, f"'{name}' of {dist.name} is {float(least):g}; it must be {limit}")
    if most > argument.high:
        checker.fail("E402", expr, f"a probability of {float(most):g} is above 1")


def _check_parameters(checker: BaseChecker, dist: dists.Dist, nodes: dict[str, Node], expr: s.Call) -> None:
    """Refuse impossible constants at once; values that depend on the state are checked by enumeration."""
    for argument in dist.arguments:
        node = nodes[argument.name]
        if isinstance(node, Const) and node.type.size:
            _check_argument(checker, dist, argument, node, expr)
    match nodes:
        case {"low": Const(value=bottom, type=Type(shape=())), "high": Const(value=top, type=Type(shape=()))} if (
            bottom > top
        ):
            checker.fail(
                "E408",
                expr,
                f"'low' of {dist.name} is {float(bottom):g}, above 'high' {float(top):g}",
            )
    if dist.name == "UniformInt" and any(n.type.kind is Kind.REAL for n in nodes.values()):
        checker.fail(
            "E306",
            expr,
            "UniformInt needs ints",
            "`floor(x)` gives an int; `Uniform(low, high)` draws a real",
        )
