"""Values with alternatives: branches, cells of tables, outcomes of draws, and those that parameters exclude."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial

from taskspec.lang import basechecker
from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker, Poisoned, check_comparable, numbered
from taskspec.lang.dists import is_distribution
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import FunctionDef, Lazy, Scope, Value
from taskspec.lang.types import Domain, Refused, Shape


def excluded_by_parameters(conditions: Sequence[tuple[s.Expr, Node]], scope: Scope) -> list[bool]:
    """Return whether each alternative is excluded by conditions known once parameters are; the last is what is left
    without them.
    """
    found = []
    decided = False
    for expr, node in conditions:
        known = isinstance(node, Const) and not basechecker.varies(expr, scope)
        found.append(decided or (known and not node.value))  # type: ignore[union-attr]
        decided |= known and node.value  # type: ignore[union-attr]
    return [*found, decided]


def excluded_value(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None) -> Value | None:
    """Return the value of an excluded alternative; None where it has none, and draws nothing that would take random words."""
    with checker.lenient(), checker.builder.written() as made:
        found = checker.check(expr, scope, want)
    if found is None and (made or _draws(checker, expr, scope, set())):
        return checker.value(expr, scope, want)
    return found


def _draws(checker: BaseChecker, expr: s.Expr, scope: Scope, known: set[str]) -> bool:
    """Return whether something is drawn in an expression, or in what it names."""
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


# One of several values is taken: branches, cells of a table, outcomes of a draw. All are of one choice, or all numbers.


def select(
    checker: BaseChecker,
    branches: Iterable[tuple[s.Expr, s.Expr]],
    otherwise: s.Expr,
    scope: Scope,
    want: Domain | None,
) -> Value:
    """Return the first branch whose condition holds; one that parameters exclude may be without a value."""
    branches = tuple(branches)
    where = partial(_where, checker, branches, otherwise, scope) if want is None else None
    conditions = checker.each([partial(checker.condition, c, scope, where) for c, _ in branches])
    exprs = [*(e for _, e in branches), otherwise]
    without = excluded_by_parameters([(c, node) for (c, _), node in zip(branches, conditions, strict=True)], scope)
    jobs = [
        partial(excluded_value if no else _value, checker, e, scope, w)
        for e, w, no in zip(exprs, wanted(exprs, scope, want), without, strict=True)
    ]
    found = [(v, e, c) for v, e, c in zip(checker.each(jobs), exprs, [*conditions, None], strict=True) if v is not None]
    nodes, domain = unify(checker, [v for v, _, _ in found], [e for _, e, _ in found], want)
    result = nodes[-1]  # where that of `otherwise` is missing, a condition above holds
    for (_, _, condition), node in zip(reversed(found[:-1]), reversed(nodes[:-1]), strict=True):
        result = _either(checker, condition, node, result)
    return Value(result, domain)


def _where(
    checker: BaseChecker, branches: Sequence[tuple[s.Expr, s.Expr]], otherwise: s.Expr, scope: Scope, shape: Shape
) -> str | None:
    """Return how one of two numbers is chosen for each element, where the condition is of some shape; None where
    that is impossible.
    """
    condition, then = branches[0]
    found = [checker.check(e, scope) for e in (then, otherwise)]
    if len(branches) > 1 or any(v is None or v.domain or v.node.type.shape not in ((), shape) for v in found):
        return None
    each = f"`where({', '.join(e.place.written for e in (condition, then, otherwise))})`"
    return f"{each} chooses element by element; `all(...)` or `any(...)` makes one condition of several"


def _value(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None) -> Value | None:
    return checker.value(expr, scope, want)


def _either(checker: BaseChecker, condition: Node | None, node: Node, otherwise: Node) -> Node:
    """Return one of two values. Between vectors of different shapes a condition decides when the task is built, or
    it is an error.
    """
    assert condition is not None  # that is `otherwise`, the last one
    shapes = {node.type.shape, otherwise.type.shape}
    if isinstance(condition, Const) and len(shapes - {()}) == 2:
        return node if condition.value else otherwise
    return checker.builder.apply("where", condition, node, otherwise)


def values(checker: BaseChecker, exprs: Sequence[s.Expr], scope: Scope, want: Domain | None) -> list[Value]:
    """Return the values of alternatives."""
    wants = wanted(exprs, scope, want)
    return checker.each([partial(checker.value, e, scope, w) for e, w in zip(exprs, wants, strict=True)])


def wanted(exprs: Sequence[s.Expr], scope: Scope, want: Domain | None) -> list[Domain | None]:
    """Return the domain in which each of several alternatives finds its labels.

    That is `want`, if something is wanted; else bare labels mean what the first component among the others makes of them.
    """
    if want is not None or len(exprs) < 2:
        return [want] * len(exprs)
    parts = [tuple(s.alternatives(e)) for e in exprs]
    beside = next((d for group in parts for part in group if (d := domain_of(part, scope)) is not None), None)
    return [beside if all(_is_label(part, scope) for part in group) else None for group in parts]


def domain_of(expr: s.Expr, scope: Scope) -> Domain | None:
    """Return the domain of a choice that is named."""
    binding = scope.lookup(expr.written) if isinstance(expr, s.Name) else None
    return binding.domain if isinstance(binding, Value | Lazy) else None


def _is_label(expr: s.Expr, scope: Scope) -> bool:
    return isinstance(expr, s.Quoted) or (isinstance(expr, s.Name) and scope.lookup(expr.written) is None)


def unify(
    checker: BaseChecker, values: Sequence[Value], exprs: Sequence[s.Expr], want: Domain | None = None
) -> tuple[list[Node], Domain | None]:
    """Return nodes of alternatives that may stand for each other: all of one choice, or all numbers.

    Beside numbers, labels of another choice than is wanted are refused (E306): as numbers they would pass for its positions.
    """
    domains = {v.domain for v in values}
    if len(domains) == 1:
        return [v.node for v in values], values[0].domain
    if want is not None and want.values is None and want in domains:
        return [_labelled(checker, v, e, want) for v, e in zip(values, exprs, strict=True)], want
    for value, expr in zip(values, exprs, strict=True):
        if value.domain != want:
            _comparable(checker, value, expr, want)
    return [checker.number_of(v) for v in values], None


def _comparable(checker: BaseChecker, value: Value, expr: s.Expr, want: Domain | None) -> None:
    try:
        check_comparable(value.domain, want)
    except Refused as refused:
        checker.fail(refused.code, expr, refused.message, refused.hint)


def _labelled(checker: BaseChecker, value: Value, expr: s.Expr, want: Domain) -> Node:
    try:
        return numbered(checker, value, expr, want)
    except Refused as refused:
        checker.fail(refused.code, expr, refused.message, refused.hint)
