"""Calls and subscripts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NoReturn

import numpy as np

from taskspec.base.diagnostics import Collector, suggest
from taskspec.lang import alternatives, dists, sets
from taskspec.lang import scope as basechecker
from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Const, Node, Role, reads
from taskspec.lang.operators import FUNCTIONS
from taskspec.lang.parse import advice
from taskspec.lang.scope import BaseChecker, ClampedIndex, FunctionDef, Lazy, Scope, Value, varies
from taskspec.lang.types import Domain, Kind, Shape, Type

# ---------- subscripts
# Subscripts: elements, rows and slices, and what becomes of an index that lies outside.
#
# One rule, for elements as for `put` and `swap`: an index that is known before the task runs counts from the end when it is
# negative; one that depends on the state, the action, the time or a draw is moved to the nearest end.


def subscript(checker: BaseChecker, expr: s.Subscript, scope: Scope) -> Node:
    """`x[i]`, `x[i, j]`, `x[a:b]`, `x[:, j]`: constant indices are checked, others are brought into range."""
    node = checker.numeric(expr.value, scope)
    if len(expr.indices) > len(node.type.shape):
        what = "a single value" if node.type.is_scalar else f"a vector of {len(node.type.shape)} axis"
        checker.fail("E307", expr, f"{what} cannot take {len(expr.indices)} indices")
    if len(expr.indices) == 1:
        return _row(checker, node, expr.indices[0], scope)
    return _block(checker, node, expr, scope)


def _row(checker: BaseChecker, node: Node, index: s.Expr | s.Slice, scope: Scope) -> Node:
    b = checker.builder
    n = node.type.shape[0]
    if isinstance(index, s.Slice):
        start, count, step = _slice_bounds(checker, index, n, scope)
        return b.structure("slice", [node], (start, count, step))
    i = _index(checker, index, n, scope)
    if len(i.type.shape) > 1:
        checker.fail("E307", index, "an index is an int or a vector of ints")
    return b.structure("index", [node, i])


def rows_for_an_element(checker: BaseChecker, expr: s.Expr, scope: Scope) -> str | None:
    """Return what to write where a vector with an index for each axis picks rows of a matrix, and so is no place in it."""
    for part in s.below(expr):
        if not isinstance(part, s.Subscript) or len(part.indices) > 1 or isinstance(part.indices[0], s.Slice):
            continue
        value = checker.check(part.value, scope)
        index = checker.check(part.indices[0], scope)
        if value is None or index is None or len(value.node.type.shape) < 2:
            continue
        if index.node.type.shape == (len(value.node.type.shape),):
            at = part.indices[0]
            n = len(value.node.type.shape)
            name = at.place.written
            written = [i.place.written for i in at.items] if isinstance(at, s.Vector) else None
            places = ", ".join(written or [f"{name}[{i}]" for i in range(n)])
            return f"a vector of indices picks rows; one element has an index for each axis: `[{places}]`"
    return None


def _block(checker: BaseChecker, node: Node, expr: s.Subscript, scope: Scope) -> Node:
    """Return what several indices leave of a matrix, an axis for each slice: elements of its rows laid end to end."""
    b = checker.builder
    axes = node.type.shape[: len(expr.indices)]
    jobs = [partial(_places, checker, i, n, scope) for i, n in zip(expr.indices, axes, strict=True)]
    places = checker.each(jobs)
    if any(p.type.shape and not isinstance(i, s.Slice) for i, p in zip(expr.indices, places, strict=True)):
        hint = "pair them in a comprehension: `[m[i, j] for (i, j) in ...]`"
        checker.fail("E307", expr, "each of several indices must be an int or a slice", hint)
    kept = tuple(p.type.size for p in places if p.type.shape)
    flat = b.structure("reshape", [node], (math.prod(axes), *node.type.shape[len(axes) :]))
    found = b.structure("index", [flat, _numbers(b, places, axes, kept)])
    return b.structure("reshape", [found], (*kept, *node.type.shape[len(axes) :]))


def _places(checker: BaseChecker, index: s.Expr | s.Slice, length: int, scope: Scope) -> Node:
    """Return where an index points along one axis: a number, or the numbers of a slice."""
    if not isinstance(index, s.Slice):
        return _index(checker, index, length, scope)
    start, count, step = _slice_bounds(checker, index, length, scope)
    return checker.builder.const(range(start, start + count * step, step), Type(Kind.INT, (count,)))


def _numbers(b: Builder, places: Sequence[Node], axes: Shape, kept: Shape) -> Node:
    """Return where elements stand when rows are laid end to end; those of slices are constants, one after the other."""
    number: Node = b.scalar(0)
    slices = iter(np.indices(kept).reshape(len(kept), math.prod(kept)))
    for place, length in zip(places, axes, strict=True):
        if isinstance(place, Const) and place.type.shape:
            place = b.const([place.flat[k] for k in next(slices)], Type(Kind.INT, (math.prod(kept),)))
        number = b.apply("add", b.apply("mul", number, b.scalar(length)), place)
    return number


def _index(checker: BaseChecker, expr: s.Expr, length: int, scope: Scope) -> Node:
    node = checker.numeric(expr, scope)
    if node.type.kind is Kind.REAL:
        checker.fail("E306", expr, "an index must be an int, not a real", "`floor(x)` gives an int")
    node = checker.builder.cast(node, Kind.INT)
    if isinstance(node, Const) and not varies(expr, scope):
        for i in node.flat:
            if not -length <= i < length:
                checker.fail(
                    "E315",
                    expr,
                    f"index {i} is outside a vector of {length or 'no'} element{'s' * (length != 1)}",
                    f"indices go from 0 to {length - 1}" if length else None,
                )
        return checker.builder.position(node, length)
    return moved(checker, node, length, expr)


def index_argument(checker: BaseChecker, index: Node, x: Node, expr: s.Expr, scope: Scope) -> Node:
    """Return the argument of a function that is an index of x, or one for each axis; what cannot be one is left to
    the function.
    """
    axes = x.type.shape
    if len(axes) > 1 and index.type.shape == (len(axes),):
        written = expr.items if isinstance(expr, s.Vector) else [expr] * len(axes)
        parts = [checker.builder.structure("element", [index], (k,)) for k in range(len(axes))]
        found = [_argument(checker, *each, scope) for each in zip(parts, axes, written, strict=True)]
        return checker.builder.structure("vector", found)
    return index if x.type.is_scalar else _argument(checker, index, axes[0], expr, scope)


def _argument(checker: BaseChecker, index: Node, length: int, expr: s.Expr, scope: Scope) -> Node:
    known = isinstance(index, Const) and not varies(expr, scope)
    if known or not index.type.is_scalar or index.type.kind is Kind.REAL:
        return index
    return moved(checker, checker.builder.cast(index, Kind.INT), length, expr)


def moved(checker: BaseChecker, index: Node, length: int, expr: s.Expr) -> Node:
    """Return an index that depends on the state, moved to the nearest end of a vector if it lies outside; kept for the lints."""
    if Role.PARAMETER in {role for role, _ in reads([index])}:  # a known one would count from the end
        checker.fail("E312", expr, "an index must be a constant where it depends on parameters")
    found = checker.builder.within(index, 0, length - 1)
    if found is not index:
        checker.moved.setdefault(id(found), ClampedIndex(found, index, length, expr.place))
    return found


def _slice_bounds(checker: BaseChecker, index: s.Slice, length: int, scope: Scope) -> tuple[int, int, int]:
    ends = ((index.start, "i >="), (index.stop, "i <"), (index.step, None))
    parts = [None if part is None else _bound(checker, part, test, scope) for part, test in ends]
    if parts[2] == 0:
        checker.fail("E315", index, "the step of a slice cannot be 0")
    chosen = range(length)[slice(*parts)]
    return chosen.start, len(chosen), chosen.step


def _bound(checker: BaseChecker, expr: s.Expr, test: str | None, scope: Scope) -> int:
    """Return one of the numbers of a slice; `test` is the start of a condition that does the same."""
    inside = f"`[x[i] if {test} {expr.place.written} else 0 for i in range(len(x))]`"
    instead = None if test is None else f"take all and test inside: {inside}"
    return checker.integer(expr, scope, "the bounds of a slice", instead)


# ---------- calls
# Calls: functions of the table, distributions, `fold`, and an author's own definitions.

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
        nodes[i] = index_argument(checker, nodes[i], nodes[0], expr.args[i], scope)
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
        return alternatives.weighted(checker, first, scope, want)
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
    alternatives.check_row(checker, p, expr)
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
