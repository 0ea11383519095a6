"""What is known before the task runs, and what is not, whatever it comes to: the state, the action, the time, a draw.

It decides which indices count from the end (`lang.subscripts`), and where fractions end: what is known late is computed in
floats, even where its value can be told when the task is built.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker
from taskspec.lang.dists import is_distribution
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import Binding, FunctionDef, Lazy, Scope, Unavailable, Value
from taskspec.lang.types import Kind


def operands(checker: BaseChecker, exprs: Sequence[s.Expr], scope: Scope) -> list[Node]:
    """The operands of an operation; among those that are known late, fractions are floats."""
    nodes = checker.numerics(exprs, scope)
    if not all(isinstance(n, Const) for n in nodes) or not any(map(_has_fractions, nodes)):
        return nodes
    if not any(varies(e, scope) for e in exprs):
        return nodes
    return [checker.builder.held(n) for n in nodes]


def _has_fractions(node: Node) -> bool:
    return isinstance(node, Const) and node.type.kind is Kind.REAL and any(type(v) is Fraction for v in node.flat)


def named(value: Value, expr: s.Expr, scope: Scope) -> Value:
    """The value of an expression as that of a name, for which a definition or an argument lets it stand."""
    return replace(value, late=True) if isinstance(value.node, Const) and varies(expr, scope) else value


def varies(expr: s.Expr, scope: Scope) -> bool:
    """Whether an expression names what is known only when the task runs, whatever its value comes to."""
    if isinstance(expr, s.Name):  # most arguments are names
        return _known_late(expr, scope.lookup(expr.written))
    names = list(s.names(expr))
    measured = {
        id(n) for call in names if isinstance(call, s.Call) and call.function == "len" for n in s.names(call.args)
    }
    own = set(s.targets(expr))
    relevant = (n for n in names if id(n) not in measured and not (isinstance(n, s.Name) and n.id in own))
    return any(_known_late(n, scope.lookup(n.written if isinstance(n, s.Name) else n.function)) for n in relevant)


def _known_late(at: s.Name | s.Call, binding: Binding | None) -> bool:
    match binding:
        case Value(node=node, late=late):
            return late or not isinstance(node, Const)
        case Lazy(resolve=resolve) if isinstance(at, s.Name):
            return _known_late(at, resolve(at))
        case FunctionDef(arguments=arguments, body=body, scope=scope):
            return varies(body, scope.child({a: Unavailable("", "") for a in arguments}))
        case _:
            return isinstance(at, s.Call) and is_distribution(at.function)
