"""Alternatives that parameters exclude: they may be without a value, as `max(x)` in `max(x) if n > 0 else 0` is where n is 0."""

from __future__ import annotations

from collections.abc import Sequence

from taskspec.lang import late
from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker, Poisoned
from taskspec.lang.dists import is_distribution
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import FunctionDef, Lazy, Scope, Value
from taskspec.lang.types import Domain


def excluded(conditions: Sequence[tuple[s.Expr, Node]], scope: Scope) -> list[bool]:
    """Whether each alternative is excluded by conditions known once parameters are; the last is what is left without them."""
    found, decided = [], False
    for expr, node in conditions:
        known = isinstance(node, Const) and not late.varies(expr, scope)
        found.append(decided or (known and not node.value))  # type: ignore[union-attr]
        decided |= known and node.value  # type: ignore[union-attr]
    return [*found, decided]


def value(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None) -> Value | None:
    """The value of an excluded alternative; None where it has none, and draws nothing that would take random words."""
    with checker.lenient(), checker.builder.written() as made:
        found = checker.check(expr, scope, want)
    if found is None and (made or _draws(checker, expr, scope, set())):
        return checker.value(expr, scope, want)
    return found


def _draws(checker: BaseChecker, expr: s.Expr, scope: Scope, known: set[str]) -> bool:
    """Whether something is drawn in an expression, or in what it names."""
    with checker.builder.written(apart=True) as made:
        for part in s.below(expr):
            if isinstance(part, s.Weights) or (isinstance(part, s.Call) and is_distribution(part.function)):
                return True
            if not isinstance(part, s.Name | s.Call):
                continue
            binding = scope.lookup(part.written if isinstance(part, s.Name) else part.function)
            match binding:
                case Lazy() if isinstance(part, s.Name):
                    _resolve(binding, part)
                case FunctionDef(name=name, body=body, scope=own) if name not in known:
                    if _draws(checker, body, own, {*known, name}):
                        return True
    return bool(made)


def _resolve(binding: Lazy, at: s.Name) -> None:
    try:
        binding.resolve(at)
    except Poisoned:
        return
