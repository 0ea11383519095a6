"""Expressions as values of components: of the right domain, kind and shape."""

from __future__ import annotations

from taskspec.lang import syntax as s
from taskspec.lang.basechecker import Poisoned
from taskspec.lang.check import Checker
from taskspec.lang.ir import Node
from taskspec.lang.labels import numbered
from taskspec.lang.scope import Scope, Value
from taskspec.lang.types import Kind, Refused
from taskspec.task.task import Component


def assign(checker: Checker, expr: s.Expr, scope: Scope, component: Component) -> Node | None:
    """An expression as a value of a component; None when it is broken (and reported to the checker's collector)."""
    value = checker.check(expr, scope, component.domain)
    if value is None:
        return None
    try:
        return _fit(checker, value, expr, component)
    except Poisoned:
        return None
    except Refused as refused:
        _blame(checker, refused, expr, scope, component)
        return None


def _blame(checker: Checker, refused: Refused, expr: s.Expr, scope: Scope, component: Component) -> None:
    """Report a value that does not fit: at the alternatives that do not, where it is one of several."""
    blamed = False
    for part in s.alternatives(expr):
        try:
            _fit(checker, checker.value(part, scope, component.domain), part, component)
        except Poisoned:
            blamed = True
        except Refused as own:
            checker.collector.add(own.code, part.place, own.message, own.hint)
            blamed = True
    if not blamed:
        checker.collector.add(refused.code, expr.place, refused.message, refused.hint)


def _fit(checker: Checker, value: Value, expr: s.Expr, c: Component) -> Node:
    """The value as one of a component; Refused when it cannot be."""
    node = checker.number_of(value) if c.domain is None else numbered(checker, value, expr, c.domain)
    if node.type.kind > c.type.kind:
        message = f"'{c.name}' is {_NAMED[c.type.kind]}, but this is {_NAMED[node.type.kind]}"
        raise Refused(message, "E306", "compare it, e.g. `x > 0`" if c.type.kind is Kind.BOOL else _whole(expr, c))
    b = checker.builder
    node = b.held(b.stretch(b.cast(node, c.type.kind), c.type.shape))
    if not node.type.size and not c.type.size:  # `[...]` with no element has one axis
        node = b.structure("reshape", [node], c.type.shape)
    if node.type.shape != c.type.shape:
        message = f"'{c.name}' has shape {list(c.type.shape)}, but this has {list(node.type.shape)}"
        raise Refused(message, "E307")
    return node


_NAMED = {Kind.BOOL: "a bool", Kind.INT: "an int", Kind.REAL: "a real"}


def _whole(expr: s.Expr, c: Component) -> str:
    """What to do about a real that is to be an int."""
    if isinstance(expr, s.Call) and expr.function in ("put", "concat"):
        return f"declare '{c.name}' `type: real` if it is to hold reals"
    if isinstance(expr, s.Binary) and expr.op == "/":
        return "`x // y` divides ints, rounded down"
    return "`floor(x)` and `round(x)` give ints"
