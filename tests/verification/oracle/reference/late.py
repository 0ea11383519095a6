"""Names of what is known only when the task runs, where nothing is evaluated that would tell: for no points at all."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from tests.verification.oracle.reference.distributions import DISTRIBUTIONS
from tests.verification.oracle.reference.syntax import parse
from tests.verification.oracle.reference.values import scalar

if TYPE_CHECKING:
    from tests.verification.oracle.reference.expressions import Scope


def names_late(node: ast.expr, scope: Scope) -> bool:
    """Whether an expression names the state, the action, the time or a draw; lengths are known before."""
    own = {n.id for part in ast.walk(node) if isinstance(part, ast.comprehension) for n in ast.walk(part.target)
           if isinstance(n, ast.Name)}  # fmt: skip
    return any(_is_late(name, scope) for name in _names(node) if name not in own)


def _names(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "len":
        return
    if isinstance(node, ast.Name):
        yield node.id
    for part in ast.iter_child_nodes(node):
        yield from _names(part)


def _is_late(name: str, scope: Scope) -> bool:
    if name in scope.local:
        return not scope.local[name].fixed
    if name in DISTRIBUTIONS:
        return True
    if name in scope.functions:
        f = scope.functions[name]
        return form_names_late(f.body, scope.body({a: scalar(0) for a in f.arguments}))  # the call names what these are
    return scope.late(name)


def form_names_late(form: Any, scope: Scope) -> bool:
    """The same of what stands in the place of an expression."""
    return any(names_late(node, scope) for text in _texts(form) for node in _parsed(text))


def _parsed(text: str) -> Iterator[ast.expr]:
    with suppress(SyntaxError):  # a label may be any text
        yield parse(text)


def _texts(form: Any) -> Iterator[str]:
    match form:
        case str():
            yield form
        case list():
            for part in form:
                yield from _texts(part)
        case dict():
            for key, part in form.items():
                yield from _texts(key)
                yield from _texts(part)
