"""Slices that do not divide a vector as they seem to."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec.diagnostics import Collector
from taskspec.exact.checks.places import SectionScope
from taskspec.exact.lint.case import Linted
from taskspec.lang import syntax as s
from taskspec.lang.ir import Const
from taskspec.lang.scope import Value
from taskspec.lang.types import INT
from taskspec.task.task import Task

Cut = tuple[s.Subscript, s.Slice]
MOST = 1000
"""Slices that are looked at."""
SECTIONS = ("noise", "initial", "dynamics", "reward", "terminal", "observation", "memory", "expert")


def past_the_end(case: Linted, collector: Collector) -> None:
    """W514: a slice that asks for more than there is."""
    for _, nodes, where in _sliced(case.task):
        for node, cut in nodes:
            _check_ends(node, cut, where, collector)


def _sliced(task: Task) -> Iterator[tuple[s.Expr, list[Cut], SectionScope]]:
    """The slices of every expression, as long as there are not too many."""
    left = MOST
    for expr, where in expressions(task):
        subscripts = (n for n in s.below(expr) if isinstance(n, s.Subscript))
        found = [(n, n.indices[0]) for n in subscripts if isinstance(n.indices[0], s.Slice)]
        if found and left > 0:
            left -= len(found)
            yield expr, found, where


def _check_ends(node: s.Subscript, cut: s.Slice, where: SectionScope, collector: Collector) -> None:
    length = _length(node, where)
    for end in (cut.start, cut.stop):
        at = None if end is None else _constant(end, where)
        if end is not None and at is not None and length is not None and not -length <= at <= length:
            message = f"this slice goes to {at}, but the vector has {length} elements"
            collector.add("W514", end.place, message)
            return
    numbers = all(end is None or not list(s.names(end)) for end in (cut.start, cut.stop, cut.step))
    ends = [None if end is None else _constant(end, where) for end in (cut.start, cut.stop, cut.step)]
    if numbers and length and not range(length)[slice(*ends)]:
        collector.add("W514", cut.place, "this slice has no elements for any parameters")


def uneven(case: Linted, collector: Collector) -> None:
    """W515: a first and a last part of one vector that overlap, or that leave something out between them.

    `v[1:]` beside `v[:-1]` sets neighbours side by side, and `concat(v[:i], v[j:])` cuts a piece out: both are meant so.
    """
    for expr, nodes, where in _sliced(case.task):
        joined = {id(arg) for call in s.below(expr) if _is_concat(call) for arg in call.args}
        _check_halves([(node, cut) for node, cut in nodes if id(node) not in joined], where, collector)


def _is_concat(node: object) -> bool:
    return isinstance(node, s.Call) and node.function == "concat"


def _check_halves(found: list[Cut], where: SectionScope, collector: Collector) -> None:
    heads = {id(v.node): (i, node) for v, i, node in _parts(found, where, head=True)}
    for vector, start, node in _parts(found, where, head=False):
        stop, _ = heads.get(id(vector.node), (start, node))
        length = vector.node.type.shape[0]
        if stop != start and stop + start != length:
            what = f"both hold elements {start} to {stop - 1}" if stop > start else f"leave out {stop} to {start - 1}"
            message = f"the parts before {stop} and from {start} of this vector {what}"
            collector.add("W515", node.place, message, "use the same index for both")


def _parts(found: list[Cut], where: SectionScope, head: bool) -> Iterator[tuple[Value, int, s.Subscript]]:
    """First parts `v[:i]`, or last parts `v[i:]`: the vector, `i` counted from its beginning, the slice."""
    for node, cut in found:
        end, other = (cut.stop, cut.start) if head else (cut.start, cut.stop)
        if end is None or other is not None or cut.step is not None or len(node.indices) > 1:
            continue
        vector, at = where.value(node.value), _constant(end, where)
        if vector is not None and at is not None and vector.node.type.shape:
            yield vector, at + vector.node.type.shape[0] * (at < 0), node


def _length(node: s.Subscript, where: SectionScope) -> int | None:
    value = where.value(node.value)
    return value.node.type.shape[0] if value is not None and value.node.type.shape else None


def _constant(expr: s.Expr, where: SectionScope) -> int | None:
    node = where.number(expr)
    return int(node.value) if isinstance(node, Const) and node.type == INT else None


def expressions(task: Task) -> Iterator[tuple[s.Expr, SectionScope]]:
    """Every expression of the sections that act, and of the definitions, with a section whose names it can use."""
    for section in SECTIONS:
        found = task.surface.sections.get(section)
        for expr in found.values() if isinstance(found, dict) else [found]:
            if isinstance(expr, s.Expr):
                yield expr, SectionScope(task, section)
    for expr in (task.surface.sections.get("definitions") or {}).values():
        if expr is not None:
            yield expr, SectionScope(task, "reward")
