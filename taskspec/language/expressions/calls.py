"""Calls (functions of the table, distributions, `fold`, an author's own definitions) and subscripts.

One rule holds for indices outside a vector, of elements as of `put` and `swap`: an index that is known before the task runs
counts from the end when it is negative; one that depends on the state, the action, the time or a draw is moved to the nearest
end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from taskspec.base.diagnostics import Collector, suggest
from taskspec.base.named import all_names
from taskspec.language.expressions import alternatives, dists, sets, types
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.ir import Const, Node, have_one_shape, reads
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.parse import advice
from taskspec.language.expressions.scope import (
    BaseChecker,
    ClampedIndex,
    FunctionDef,
    Lazy,
    Poisoned,
    Scope,
    Value,
    named,
    varies,
)
from taskspec.language.expressions.types import Domain, Kind, NoElement, Role, Shape, Type

FOLDS = ("fold", "scan")
SET_FUNCTIONS = ("box", "range")
NO_DRAWS = "a definition draws nothing, so name the draw under `noise`"


def is_function(name: str) -> bool:
    return name in FUNCTIONS or dists.is_distribution(name) or name in SET_FUNCTIONS or name in FOLDS


def call(checker: BaseChecker, expr: s.Call, scope: Scope, want: Domain | None) -> Value:
    binding = scope.lookup(expr.function)
    if isinstance(binding, FunctionDef):
        return _own(checker, binding, expr, scope, want)
    if isinstance(binding, Lazy):  # a function whose body is broken goes no further
        binding.resolve(s.Name(expr.function, False, expr.name_place))
    if binding is not None:
        checker.collector.add("E303", expr.name_place, f"'{expr.function}' is a value, not a function")
        _give_up(checker, expr, scope)
    if expr.function in FUNCTIONS:
        return _built_in(checker, expr, scope, want)
    if dists.is_distribution(expr.function):
        return _distribution(checker, expr, scope, want)
    if expr.function in FOLDS:
        return _fold(checker, expr, scope)
    if expr.function in SET_FUNCTIONS:
        hint = f"use it in a comprehension: `{{x for x in {expr.function}(...)}}`"
        checker.fail("E306", expr, f"`{expr.function}(...)` is a set, not a value", hint)
    no_function(checker.collector, expr, scope)
    _give_up(checker, expr, scope)


def no_function(collector: Collector, expr: s.Call, scope: Scope) -> None:
    """Report a function that does not exist."""
    known = advice(expr.function, len(expr.args))
    hint = known or suggest(expr.function, (*FUNCTIONS, *dists.DISTS, dists.CATEGORICAL.name, *_definitions(scope)))
    collector.add("E303", expr.name_place, f"there is no function '{expr.function}'", hint)


def _definitions(scope: Scope) -> list[str]:
    definitions = []
    for n in scope.names():
        if isinstance(scope.lookup(n), FunctionDef):
            definitions.append(n)
    return definitions


def _give_up(checker: BaseChecker, expr: s.Call, scope: Scope) -> NoReturn:
    """Give up on a call after looking for mistakes in its arguments too."""
    plain = []
    for e in expr.args:
        if not isinstance(e, s.Weights | s.SetOf | s.Comprehension):
            plain.append(e)
    checker.numerics(plain, scope)
    raise Poisoned


def refuse_keywords(collector: Collector, expr: s.Call) -> None:
    """Report the keyword arguments of a function that takes none."""
    for name, value in expr.keywords:
        message = f"'{expr.function}' takes no keyword arguments"
        collector.add("E305", _keyword(name, value), message, f"write it without `{name}=`; `==` compares")


def _keyword(name: str, value: s.Expr) -> s.Place:
    """Place of the name before `=`, which stands directly before its value."""
    start = value.place.text.value.rfind(name, 0, value.place.start)
    if start >= 0:
        return s.Place(value.place.text, start, start + len(name))
    return value.place


def _built_in(checker: BaseChecker, expr: s.Call, scope: Scope, want: Domain | None) -> Value:
    function = FUNCTIONS[expr.function]
    _check_positional(checker, expr)
    nodes, domain = _operands(checker, expr, scope, want)
    _check_count(checker, expr, function.signature, function.accepts(len(nodes)))
    for index in function.static:
        if not isinstance(nodes[index], Const):
            message = f"'{function.arguments[index]}' of {expr.function} must be a constant"
            checker.fail("E312", expr.args[index], message)
    for i in function.indices:
        nodes[i] = _index_argument(checker, nodes[i], nodes[0], expr.args[i], scope)
    return Value(function.build(checker.builder, nodes), domain)


def _operands(
    checker: BaseChecker, expr: s.Call, scope: Scope, want: Domain | None
) -> tuple[list[Node], Domain | None]:
    """Check arguments; elements that are moved are labels where these are wanted, else numbers."""
    moved = [i for i in FUNCTIONS[expr.function].moved if i < len(expr.args)]
    if want is None or not moved:
        return checker.operands(expr.args, scope), None
    jobs = []
    for i, e in enumerate(expr.args):
        jobs.append((e, scope, want if i in moved else None))
    values = checker.each(checker.value, jobs)
    labels, domain = alternatives.unify(checker, [values[i] for i in moved], [expr.args[i] for i in moved], want)
    nodes = list(map(checker.number_of, values))
    for i, label in zip(moved, labels, strict=True):
        nodes[i] = label
    return nodes, domain


def _check_positional(checker: BaseChecker, expr: s.Call) -> None:
    refuse_keywords(checker.collector, expr)
    if expr.keywords:
        raise Poisoned


def _check_count(checker: BaseChecker, expr: s.Call, signature: str, fits: bool) -> None:
    if not fits:
        checker.fail("E304", expr, f"{signature} was given {count_of(len(expr.args))}")


def count_of(n: int) -> str:
    """`1 argument`, `2 arguments`."""
    return f"{n} argument" + "s" * (n != 1)


# -- definitions with arguments -----------------------------------------------------------------------------------


def _own(checker: BaseChecker, function: FunctionDef, expr: s.Call, scope: Scope, want: Domain | None) -> Value:
    _check_positional(checker, expr)
    checker.expand(expr)
    values = checker.each(checker.value, [(e, scope) for e in expr.args])
    _check_count(checker, expr, function.signature, function.accepts(len(values)))
    given = [named(v, e, scope) for v, e in zip(values, expr.args, strict=True)]
    return _applied(checker, function, expr, given, want)


def _applied(
    checker: BaseChecker, function: FunctionDef, expr: s.Call, given: list[Value], want: Domain | None = None
) -> Value:
    with function.enter(expr):
        for name, value in zip(function.arguments, given, strict=True):
            axes = len(types.shape(value.node.type, value.domain))
            known = checker.argument_axes.get((function.name, name), 0)
            checker.argument_axes[function.name, name] = max(axes, known)
        inner = function.scope.child(dict(zip(function.arguments, given, strict=True)))
        inner.draws = NO_DRAWS
        return checker.value(function.body, inner, want)


def _fold(checker: BaseChecker, expr: s.Call, scope: Scope) -> Value:
    _check_positional(checker, expr)
    _check_count(checker, expr, f"{expr.function}(f, start, x)", len(expr.args) == 3)
    written, start, vector = expr.args
    step = None
    near = None
    if isinstance(written, s.Name):
        step = scope.lookup(written.written)
        near = suggest(written.id, _definitions(scope))
    if isinstance(step, Lazy) and isinstance(written, s.Name):
        step.resolve(written)  # gives up where it is broken
    if not isinstance(step, FunctionDef) or len(step.arguments) != 2:
        hint = near or f'`definitions: {{"f(value, element)": value + element}}`, then `{expr.function}(f, 0, x)`'
        checker.fail("E306", written, f"{expr.function} needs a definition with two arguments first", hint)
    value, elements = checker.each(checker.value, [(start, scope), (vector, scope)])
    value = named(value, start, scope)
    x = checker.number_of(elements)
    if x.type.is_scalar:
        checker.fail("E306", vector, f"{expr.function} goes through a vector, not {x.type}")
    checker.expand(expr, x.type.shape[0])
    results = []
    is_late = varies(expr, scope)
    for i in range(x.type.shape[0]):
        element = Value(checker.builder.structure("element", [x], (i,)), late=varies(vector, scope))
        value = replace(_applied(checker, step, expr, [value, element]), late=is_late)
        results.append(checker.number_of(value))
    if expr.function == "fold":
        return value
    if not have_one_shape(results):
        checker.fail("E307", expr, "the intermediate values have different shapes")
    return Value(checker.stack(results, expr))


# -- distributions ------------------------------------------------------------------------------------------------


def _distribution(checker: BaseChecker, expr: s.Call, scope: Scope, want: Domain | None) -> Value:
    if scope.draws is not None:
        checker.fail("E311", expr, f"{expr.function} is a random draw; {scope.draws}")
    match expr:
        case s.Call(function="Uniform", args=((s.SetOf() | s.Comprehension()) as values,), keywords=()):
            return sets.uniform(checker, values, scope, want)
        case s.Call(function="Categorical", args=(s.Weights() as weights,), keywords=()):
            return alternatives.weighted(checker, weights, scope, want)
        case s.Call(function="Uniform", args=(s.SetOf(), *_)) | s.Call(function="Categorical", args=(s.Weights(), *_)):
            hint = f"for several draws, write a comprehension: `[{expr.function}({{...}}) for i in range(n)]`"
            checker.fail("E304", expr, f"{expr.function} takes nothing beside values in braces", hint)
    dist = dists.DISTS.get(expr.function, dists.CATEGORICAL)
    nodes, shape = _arguments(checker, dist, expr, scope)
    if dist is dists.CATEGORICAL:
        if len(nodes["p"].type.shape) != 1:
            checker.fail("E306", expr, "Categorical needs a vector of probabilities, or `{value: probability, ...}`")
        nodes["p"] = checker.builder.cast(nodes["p"], Kind.REAL)
        alternatives.check_row(checker, nodes["p"], expr)
    else:
        _check_parameters(checker, dist, nodes, expr)
    return Value(dist.build(checker.builder, nodes, shape))


def _arguments(checker: BaseChecker, dist: dists.Dist, expr: s.Call, scope: Scope) -> tuple[dict[str, Node], Shape]:
    given, shape = _given(checker, dist, expr, scope)
    nodes = dict(zip(given, checker.numerics(given.values(), scope), strict=True))
    for argument in dist.arguments:
        name = argument.name
        if name not in nodes:
            if argument.default is None:
                checker.fail("E304", expr, f"{dist.name} needs '{name}'", dist.signature)
            nodes[name] = checker.builder.scalar(argument.default)
        node = nodes[name]
        place = given.get(name, expr)
        is_int = isinstance(node, Const) and node.type.is_scalar and node.type.kind is not Kind.REAL
        if argument.static and not is_int:
            checker.fail("E312", place, f"'{name}' of {dist.name} must be a constant int")
        if argument.vector and len(node.type.shape) != 1:
            checker.fail("E306", place, f"'{name}' of {dist.name} must be a vector")
    if dist is dists.CATEGORICAL or not dist.shaped:
        return nodes, shape or ()
    return nodes, _joint_shape(checker, nodes.values(), shape, expr)


def _joint_shape(checker: BaseChecker, nodes: Iterable[Node], asked: Shape | None, expr: s.Expr) -> Shape:
    shapes = set()
    for node in nodes:
        if not node.type.is_scalar:
            shapes.add(node.type.shape)
    if asked is not None:
        shapes.add(asked)
    if len(shapes) > 1:
        listed = " and ".join(str(list(shape)) for shape in sorted(shapes))
        checker.fail("E307", expr, f"the shapes {listed} do not match")
    return max(shapes, default=())


def _given(
    checker: BaseChecker, dist: dists.Dist, expr: s.Call, scope: Scope
) -> tuple[dict[str, s.Expr], Shape | None]:
    names = all_names(dist.arguments)
    _check_count(checker, expr, dist.signature, len(expr.args) <= len(names))
    given = dict(zip(names, expr.args, strict=False))
    shape = None
    for name, value in expr.keywords:
        if name == "shape" and dist.shaped:
            shape = static_shape(checker, value, scope)
        elif name not in names:
            known = names
            if dist.shaped:
                known = [*names, "shape"]
            hint = suggest(name, known) or f"it takes {', '.join(known)}"
            checker.collector.add("E305", _keyword(name, value), f"{dist.name} has no argument '{name}'", hint)
            raise Poisoned
        elif name in given:
            checker.fail("E304", value, f"'{name}' of {dist.name} is given twice")
        else:
            given[name] = value
    return given, shape


def static_shape(checker: BaseChecker, expr: s.Expr, scope: Scope) -> Shape:
    """Read a shape: a constant int or a short vector of them."""
    node = checker.constant(expr, scope, "a shape")
    if node.type.kind is Kind.REAL or len(node.type.shape) > 1 or node.type.size > 4:
        checker.fail("E306", expr, "a shape is an int or a list of a few ints")
    shape = tuple(map(int, node.flat))
    if any(n < 0 for n in shape):
        checker.fail("E307", expr, f"a shape is made of sizes, not {list(shape)}")
    return shape


def _check_parameters(checker: BaseChecker, dist: dists.Dist, nodes: dict[str, Node], expr: s.Call) -> None:
    """Refuse impossible constants at once; values that depend on the state are checked by enumeration."""
    for argument in dist.arguments:
        node = nodes[argument.name]
        if isinstance(node, Const) and node.type.size:
            _check_argument(checker, dist, argument, node, expr)
    ends = []
    for n in (nodes.get("low"), nodes.get("high")):
        if isinstance(n, Const) and n.type.is_scalar:
            ends.append(n)
    if len(ends) == 2:
        low, high = ends
        if low.value > high.value:
            message = f"'low' of {dist.name} is {float(low.value):g}, above 'high' {float(high.value):g}"
            checker.fail("E408", expr, message)
    if dist.name == "UniformInt" and any(n.type.kind is Kind.REAL for n in nodes.values()):
        hint = "`floor(x)` gives an int; `Uniform(low, high)` draws a real"
        checker.fail("E306", expr, "UniformInt needs ints", hint)


def _check_argument(
    checker: BaseChecker, dist: dists.Dist, argument: dists.Argument, node: Const, expr: s.Call
) -> None:
    name = argument.name
    least = min(node.flat)
    most = max(node.flat)
    if math.isinf(argument.high) and not all(map(math.isfinite, node.flat)):
        checker.fail("E408", expr, f"'{name}' of {dist.name} is not finite")
    if not least >= argument.low or (argument.open and least == argument.low):
        limit = f"{'above' if argument.open else 'at least'} {argument.low:g}"
        checker.fail("E408", expr, f"'{name}' of {dist.name} is {float(least):g}; it must be {limit}")
    if most > argument.high:
        checker.fail("E402", expr, f"a probability of {float(most):g} is above 1")


# -- subscripts ---------------------------------------------------------------------------------------------------


def subscript(checker: BaseChecker, expr: s.Subscript, scope: Scope, want: Domain | None) -> Value:
    """`x[i]`, `x[i, j]`, `x[a:b]`, `x[:, j]`: constant indices are checked, others are brought into range.

    Elements of a vector of labels are labels where these are wanted, else numbers.
    """
    vector = checker.value(expr.value, scope)
    if vector.domain is not None and vector.domain == want and vector.node.type.shape:
        return Value(_elements(checker, vector.node, expr, scope), want)
    return Value(_elements(checker, checker.number_of(vector), expr, scope))


def _elements(checker: BaseChecker, node: Node, expr: s.Subscript, scope: Scope) -> Node:
    b = checker.builder
    if len(expr.indices) > len(node.type.shape):
        what = f"a vector of {len(node.type.shape)} axis"
        if node.type.is_scalar:
            what = "a single value"
        checker.fail("E307", expr, f"{what} cannot take {len(expr.indices)} indices")
    if len(expr.indices) > 1:
        return _block(checker, node, expr, scope)
    index = expr.indices[0]
    if isinstance(index, s.Slice):
        chosen = _slice_range(checker, index, node.type.shape[0], scope)
        return b.structure("slice", [node], (chosen.start, len(chosen), chosen.step))
    i = _index(checker, index, node.type.shape[0], scope)
    if len(i.type.shape) > 1:
        checker.fail("E307", index, "an index is an int or a vector of ints")
    return b.structure("index", [node, i])


def _block(checker: BaseChecker, node: Node, expr: s.Subscript, scope: Scope) -> Node:
    """Pick a block of a matrix by several indices, an axis for each slice: elements of its rows laid end to end."""
    b = checker.builder
    axes = node.type.shape[: len(expr.indices)]
    jobs = [(checker, i, n, scope) for i, n in zip(expr.indices, axes, strict=True)]
    places = checker.each(_places, jobs)
    if any(p.type.shape and not isinstance(i, s.Slice) for i, p in zip(expr.indices, places, strict=True)):
        hint = "pair them in a comprehension: `[m[i, j] for (i, j) in ...]`"
        checker.fail("E307", expr, "each of several indices must be an int or a slice", hint)
    kept = tuple(p.type.size for p in places if p.type.shape)
    # Places of elements when rows are laid end to end; places of a slice are constants, one after the other.
    number: Node = b.scalar(0)
    slices = iter(np.indices(kept).reshape(len(kept), math.prod(kept)))
    for place, length in zip(places, axes, strict=True):
        if isinstance(place, Const) and place.type.shape:
            place = b.const([place.flat[k] for k in next(slices)], Type(Kind.INT, (math.prod(kept),)))
        number = b.apply("add", b.apply("mul", number, b.scalar(length)), place)
    rest = node.type.shape[len(axes) :]
    flat = b.structure("reshape", [node], (math.prod(axes), *rest))
    return b.structure("reshape", [b.structure("index", [flat, number])], (*kept, *rest))


def _places(checker: BaseChecker, index: s.Expr | s.Slice, length: int, scope: Scope) -> Node:
    """Places of an index along one axis: a number, or the numbers of a slice."""
    if not isinstance(index, s.Slice):
        return _index(checker, index, length, scope)
    chosen = _slice_range(checker, index, length, scope)
    return checker.builder.const(chosen, Type(Kind.INT, (len(chosen),)))


def _slice_range(checker: BaseChecker, index: s.Slice, length: int, scope: Scope) -> range:
    parts: list[int | None] = [None, None, None]
    for i, expr in enumerate((index.start, index.stop, index.step)):
        if expr is not None:
            parts[i] = checker.integer(expr, scope, "the bounds of a slice")
    if parts[2] == 0:
        checker.fail("E315", index, "the step of a slice cannot be 0")
    return range(length)[slice(*parts)]


def _index(checker: BaseChecker, expr: s.Expr, length: int, scope: Scope) -> Node:
    node = checker.numeric(expr, scope)
    if node.type.kind is Kind.REAL:
        checker.fail("E306", expr, "an index must be an int, not a real", "`floor(x)` gives an int")
    node = checker.builder.cast(node, Kind.INT)
    if not isinstance(node, Const) or varies(expr, scope):
        return _moved(checker, node, length, expr)
    for i in node.flat:
        if not -length <= i < length:
            if not length:
                raise NoElement
            message = f"index {i} is outside a vector of {length} element{'s' * (length != 1)}"
            checker.fail("E315", expr, message, f"indices go from 0 to {length - 1}")
    return checker.builder.position(node, length)


def _index_argument(checker: BaseChecker, index: Node, x: Node, expr: s.Expr, scope: Scope) -> Node:
    """Return the argument of a function that is an index of x, or one for each axis; else it is left as it is."""
    axes = x.type.shape
    if not axes:
        return index
    if len(axes) == 1 or index.type.shape != (len(axes),):
        return _index_of_axis(checker, index, axes[0], expr, scope)
    written: Sequence[s.Expr] = expr.items if isinstance(expr, s.Vector) else [expr] * len(axes)
    indices = []
    for k, length in enumerate(axes):
        part = checker.builder.structure("element", [index], (k,))
        indices.append(_index_of_axis(checker, part, length, written[k], scope))
    return checker.builder.structure("vector", indices)


def _index_of_axis(checker: BaseChecker, index: Node, length: int, expr: s.Expr, scope: Scope) -> Node:
    known = isinstance(index, Const) and not varies(expr, scope)
    if known or not index.type.is_scalar or index.type.kind is Kind.REAL:
        return index
    return _moved(checker, checker.builder.cast(index, Kind.INT), length, expr)


def _moved(checker: BaseChecker, index: Node, length: int, expr: s.Expr) -> Node:
    """Clamp an index to the ends of a vector; recorded for the warnings."""
    if any(role is Role.PARAMETER for role, _ in reads([index])):  # a known one would count from the end
        checker.fail("E312", expr, "an index must be a constant where it depends on parameters")
    clamped = checker.builder.within(index, 0, length - 1)
    if clamped is not index:
        checker.moved.setdefault(id(clamped), ClampedIndex(clamped, index, length, expr.place))
    return clamped
