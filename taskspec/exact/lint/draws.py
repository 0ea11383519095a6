"""Draws that leave nothing to chance."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec.diagnostics import Collector
from taskspec.exact.checks.places import SectionScope, distributions
from taskspec.exact.lint.case import Linted
from taskspec.exact.lint.names import followed
from taskspec.lang import syntax as s
from taskspec.lang.dists import CATEGORICAL, DISTS
from taskspec.lang.ir import Const, Draw, Node, draws
from taskspec.task.task import Task

SECTIONS = ("noise", "initial", "dynamics", "reward", "terminal", "observation", "expert")


def certain(case: Linted, collector: Collector) -> None:
    """W512: a draw with a single outcome. Where a real parameter has a say, its ends may be why."""
    reals = {p.name for p in case.task.parameters if p.kind == "real"}
    for written, where in _written(case.task):
        words = {n.id for n in s.names(written) if isinstance(n, s.Name)}
        if _is_certain(written, where) and not followed(case.task, words) & reals:
            collector.add("W512", written.place, "this draw has only one outcome", "write the value itself")


def _written(task: Task) -> Iterator[tuple[s.Call | s.Weights, SectionScope]]:
    """Every distribution of the spec, with the section it stands in."""
    for section in SECTIONS:
        entries = task.surface.sections.get(section)
        where = SectionScope(task, section)
        for expr in entries.values() if isinstance(entries, dict) else [entries]:
            for written in distributions(expr, where) if expr is not None else ():
                yield written.expr, where


def _is_certain(expr: s.Call | s.Weights, where: SectionScope) -> bool:
    match expr:
        case s.Weights(pairs=pairs) | s.Call(args=(s.Weights(pairs=pairs),)):
            return _one_weight(pairs, where)
        case s.Call(args=(s.Comprehension(),)):
            return False  # what is left of a set may be a matter of the map that it is made from
        case s.Call(args=(s.SetOf(),)):
            return _one_element(expr, where)
        case s.Call(function=name, args=args, keywords=keywords):
            dist = CATEGORICAL if name == CATEGORICAL.name else DISTS[name]
            names = [a.name for a in dist.arguments]
            given = dict(zip(names, args, strict=False)) | dict(keywords)
            return dist.certain({key: where.number(value) for key, value in given.items() if key in names})


def _one_weight(pairs: tuple[tuple[s.Expr, s.Expr], ...], where: SectionScope) -> bool:
    """Whether one value alone has a probability above 0."""
    weights = [where.number(p) for _, p in pairs]
    return all(isinstance(w, Const) for w in weights) and sum(_above_zero(w) for w in weights) == 1


def _one_element(expr: s.Call, where: SectionScope) -> bool:
    """Whether the set that is drawn from has one element."""
    value = where.value(expr)
    found = [] if value is None else draws([value.node])
    return value is not None and all(_counts(draw) == 1 for draw in found)


def _counts(draw: Draw) -> int | None:
    """How many outcomes a draw from a set has, where that is fixed."""
    first = draw.args[0] if draw.args else None
    return int(first.value) if draw.base == "index" and isinstance(first, Const) and first.type.is_scalar else None


def _above_zero(node: Node | None) -> bool:
    return isinstance(node, Const) and any(v > 0 for v in node.flat)
