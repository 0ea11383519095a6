"""Going through a vector with a function of two arguments: `fold` gives the last value, `scan` all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from taskspec.diagnostics import suggest
from taskspec.lang import late
from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker
from taskspec.lang.scope import FunctionDef, Scope, Value

NAMES = ("fold", "scan")
Applied = Callable[[BaseChecker, FunctionDef, s.Call, list[Value]], Value]


def folded(checker: BaseChecker, expr: s.Call, scope: Scope, apply: Applied) -> Value:
    """The value of `fold(f, start, x)` or `scan(f, start, x)`; `apply` is a call of f, with values for its arguments."""
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
    value, x = late.named(values[0], start, scope), values[1].node
    if x.type.is_scalar:
        checker.fail("E306", vector, f"{expr.function} goes through a vector, not {x.type}")
    checker.expand(expr, x.type.shape[0])
    found, is_late = [], late.varies(expr, scope)
    for i in range(x.type.shape[0]):
        element = Value(checker.builder.structure("element", [x], (i,)), late=late.varies(vector, scope))
        value = replace(apply(checker, step, expr, [value, element]), late=is_late)
        found.append(value)
    if expr.function == "fold":
        return value
    nodes = [checker.number_of(v) for v in found]
    if len({n.type.shape for n in nodes}) > 1:
        checker.fail("E307", expr, "the intermediate values have different shapes")
    return Value(checker.stack(nodes, expr))
