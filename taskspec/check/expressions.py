"""Warnings about expressions: indices and slices outside a vector, draws without chance, reals that are whole."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.check.context import Doubt, LintContext
from taskspec.check.names import followed, mentioned
from taskspec.lang import syntax as s
from taskspec.lang.batch import evaluate
from taskspec.lang.dists import CATEGORICAL, DISTS
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, draws, reads, walk
from taskspec.lang.operators import entry_of
from taskspec.lang.scope import ClampedIndex, Value
from taskspec.lang.types import INT, Kind
from taskspec.lang.variates import WordLayout, batch_sampler
from taskspec.model.space import Reads, shown, words
from taskspec.rollout.rollout import visited
from taskspec.soundness.places import SectionScope, distributions
from taskspec.task.task import Component, Task

# -- indices --------------------------------------------------------------------------------------

POINTS = 100_000
"""States, actions and times that are evaluated, at most."""
BATCH = 4096


def moved(context: LintContext) -> Iterator[Doubt]:
    """Yield an index that lies outside in a state in which episodes act, where its value matters."""
    task = context.task
    left = {id(m.node): m for m in task.surface.moved}
    for roots in (task.observation.nodes, _expert(task), (*task.raw_next, task.reward, task.terminal)):
        found = [left[id(n)] for n in walk(roots) if id(n) in left]
        for points in _points(context, roots) if found else ():
            for each in _outside(roots, found, points, task):
                del left[id(each[0].node)]
                yield _problem(*each)
            found = [m for m in found if id(m.node) in left]


def _expert(task: Task) -> tuple[Node, ...]:
    return task.expert if isinstance(task.expert, tuple) else ()


def _problem(m: ClampedIndex, index: int, reads: Reads, task: Task) -> Doubt:
    components = ((r, c) for r, cs in ((Role.STATE, task.state), (Role.ACTION, task.action)) for c in cs)
    where = [f"{c.name} = {shown(c, reads[r, c.name][..., 0])}" for r, c in components if (r, c.name) in reads]
    where += [f"t = {words(int(v[0]))}" for (r, _), v in reads.items() if r is Role.TIME]
    place = f"for {', '.join(where)}, " if where else ""
    end = 0 if index < 0 else m.length - 1
    message = f"{place}this index is {index}; it is moved to {end}, the nearest of 0 ... {m.length - 1}"
    return Doubt(m.place, message, "if this is intended, write `clip(i, 0, n - 1)`")


# -- points -------------------------------------------------------------------------------------------------------


def _points(context: LintContext, roots: Sequence[Node]) -> Iterator[Reads]:
    """Yield the values read at points at which episodes act: all if there is an exact model, otherwise samples."""
    model = context.model
    read = reads(roots)
    if model is None:
        found = visited(context.task)
        yield from _batches({k: v for k, v in found.items() if k in read}, max(v.shape[-1] for v in found.values()))
        return
    timed = (Role.TIME, "t") in read
    acts = any(role is Role.ACTION for role, _ in read)
    left = POINTS
    for t, level in model.levels() if timed or model.is_timed else [(0, model.acting)]:
        codes = model.codes[level]
        every = np.arange(len(codes) * (model.actions.size if acts else 1))[: max(0, left)]
        left -= len(every)
        point = model.states.decode(codes[every % len(codes)], read) | model.actions.decode(every // len(codes), read)
        yield from _batches(point | ({(Role.TIME, "t"): np.array([t])} if timed else {}), len(every))


def _batches(found: Mapping[Any, Array], lanes: int) -> Iterator[Reads]:
    for low in range(0, lanes, BATCH):
        yield {k: v if v.shape[-1] == 1 else v[..., low : low + BATCH] for k, v in found.items()}


# -- what matters there -------------------------------------------------------------------------------------------


def _outside(
    roots: Sequence[Node], found: Sequence[ClampedIndex], points: Reads, task: Task
) -> Iterator[tuple[ClampedIndex, int, Reads, Task]]:
    """Yield the indices that lie outside at a point where they matter: the value, and what is read there."""
    lanes = max((v.shape[-1] for v in points.values()), default=1)
    layout = WordLayout.of(roots)
    sample = batch_sampler(layout, np.random.default_rng(0).integers(0, 2**32, (layout.count, lanes), dtype=np.uint32))
    order = list(walk(roots))
    asked = [n for n in order if _choice(n)]
    values = evaluate([*(n.args[0] for n in asked), *(m.index for m in found)], points, sample)  # type: ignore[union-attr]
    needed = _needed(roots, order, dict(zip(map(id, asked), values, strict=False)), lanes)
    for m, value in zip(found, values[len(asked) :], strict=True):
        rows = np.broadcast_to(value.reshape(-1, value.shape[-1]), (m.index.type.size, lanes))
        wrong = ((rows < 0) | (rows >= m.length)) & needed[id(m.node)]
        if wrong.any():
            row, lane = (int(i[0]) for i in np.nonzero(wrong))
            here = reads([m.index])
            at = {k: v if v.shape[-1] == 1 else v[..., lane : lane + 1] for k, v in points.items() if k in here}
            yield m, int(rows[row, lane]), at, task


def _choice(node: Node) -> bool:
    """Return whether the first argument decides which of the others matter."""
    return isinstance(node, Apply) and node.op in ("where", "and", "or") and node.type.is_scalar


def _needed(
    roots: Iterable[Node], order: Sequence[Node], conditions: Mapping[int, Array], lanes: int
) -> dict[int, Array]:
    """For every node the points at which its value matters: not in a branch that is not taken."""
    needed = {id(n): np.zeros(lanes, np.bool_) for n in order} | {id(r): np.ones(lanes, np.bool_) for r in roots}
    for node in reversed(order):
        here = needed[id(node)]
        each: Sequence[Any] = [here] * len(children(node))
        if id(node) in conditions and isinstance(node, Apply):
            holds = conditions[id(node)]
            each = [here, here & (~holds if node.op == "or" else holds), here & ~holds]
        for child, matters in zip(children(node), each, strict=False):
            needed[id(child)] = needed[id(child)] | matters
    return needed


# -- slices ---------------------------------------------------------------------------------------

Cut = tuple[s.Subscript, s.Slice]
MOST = 1000
"""Slices that are checked, at most."""
SECTIONS = ("noise", "initial", "dynamics", "reward", "terminal", "observation", "memory", "expert")


def past_the_end(context: LintContext) -> Iterator[Doubt]:
    """Yield a slice that asks for more than there is."""
    for _, nodes, where in _sliced(context.task):
        for node, cut in nodes:
            yield from _check_ends(node, cut, where)


def _sliced(task: Task) -> Iterator[tuple[s.Expr, list[Cut], SectionScope]]:
    """Yield the slices of every expression, as long as there are not too many."""
    left = MOST
    for expr, where in expressions(task):
        subscripts = (n for n in s.below(expr) if isinstance(n, s.Subscript))
        found = [(n, n.indices[0]) for n in subscripts if isinstance(n.indices[0], s.Slice)]
        if found and left > 0:
            left -= len(found)
            yield expr, found, where


def _check_ends(node: s.Subscript, cut: s.Slice, where: SectionScope) -> Iterator[Doubt]:
    length = _length(node, where)
    for end in (cut.start, cut.stop):
        at = None if end is None else _constant(end, where)
        if end is not None and at is not None and length is not None and not -length <= at <= length:
            message = f"this slice goes to {at}, but the vector has {length} elements"
            yield Doubt(end.place, message)
            return
    numbers = all(end is None or not list(s.names(end)) for end in (cut.start, cut.stop, cut.step))
    ends = [None if end is None else _constant(end, where) for end in (cut.start, cut.stop, cut.step)]
    if numbers and length and not range(length)[slice(*ends)]:
        yield Doubt(cut.place, "this slice has no elements for any parameters")


def uneven(context: LintContext) -> Iterator[Doubt]:
    """Yield a first and a last part of one vector that overlap, or that leave something out between them.

    `v[1:]` beside `v[:-1]` sets neighbours side by side, and `concat(v[:i], v[j:])` cuts a piece out: both are meant so.
    """
    for expr, nodes, where in _sliced(context.task):
        joined = {id(arg) for call in s.below(expr) if _is_concat(call) for arg in call.args}
        separate = [(node, cut) for node, cut in nodes if id(node) not in joined]
        yield from _check_halves(separate, where)


def _is_concat(node: object) -> bool:
    return isinstance(node, s.Call) and node.function == "concat"


def _check_halves(found: list[Cut], where: SectionScope) -> Iterator[Doubt]:
    heads = {id(v.node): (i, node) for v, i, node in _parts(found, where, head=True)}
    for vector, start, node in _parts(found, where, head=False):
        stop, _ = heads.get(id(vector.node), (start, node))
        length = vector.node.type.shape[0]
        if stop != start and stop + start != length:
            what = f"both hold elements {start} to {stop - 1}" if stop > start else f"leave out {stop} to {start - 1}"
            message = f"the parts before {stop} and from {start} of this vector {what}"
            yield Doubt(node.place, message, "use the same index for both")


def _parts(found: list[Cut], where: SectionScope, head: bool) -> Iterator[tuple[Value, int, s.Subscript]]:
    """First parts `v[:i]`, or last parts `v[i:]`: the vector, `i` counted from its beginning, the slice."""
    for node, cut in found:
        end, other = (cut.stop, cut.start) if head else (cut.start, cut.stop)
        if end is None or other is not None or cut.step is not None or len(node.indices) > 1:
            continue
        vector = where.value(node.value)
        at = _constant(end, where)
        if vector is not None and at is not None and vector.node.type.shape:
            yield vector, at + vector.node.type.shape[0] * (at < 0), node


def _length(node: s.Subscript, where: SectionScope) -> int | None:
    value = where.value(node.value)
    return value.node.type.shape[0] if value is not None and value.node.type.shape else None


def _constant(expr: s.Expr, where: SectionScope) -> int | None:
    node = where.number(expr)
    return int(node.value) if isinstance(node, Const) and node.type == INT else None


def expressions(task: Task) -> Iterator[tuple[s.Expr, SectionScope]]:
    """Yield every expression of the sections that act, and of the definitions, with a section whose names it can use."""
    for section in SECTIONS:
        found = task.surface.sections.get(section)
        for expr in found.values() if isinstance(found, dict) else [found]:
            if isinstance(expr, s.Expr):
                yield expr, SectionScope(task, section)
    for expr in (task.surface.sections.get("definitions") or {}).values():
        if expr is not None:
            yield expr, SectionScope(task, "reward")


# -- draws ----------------------------------------------------------------------------------------


def certain(context: LintContext) -> Iterator[Doubt]:
    """Yield a draw with a single outcome. Where a real parameter has a say, its ends may be why."""
    reals = {p.name for p in context.task.parameters if p.kind == "real"}
    for written, where in _written(context.task):
        words = {n.id for n in s.names(written) if isinstance(n, s.Name)}
        if _is_certain(written, where) and not followed(context.task, words) & reals:
            yield Doubt(written.place, "this draw has only one outcome", "write the value itself")


def _written(task: Task) -> Iterator[tuple[s.Call | s.Weights, SectionScope]]:
    """Yield every distribution of the spec, with the section it stands in."""
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
    """Return whether a single value has a probability above 0."""
    weights = [where.number(p) for _, p in pairs]
    return all(isinstance(w, Const) for w in weights) and sum(_above_zero(w) for w in weights) == 1


def _one_element(expr: s.Call, where: SectionScope) -> bool:
    """Return whether a set that is drawn from has one element."""
    value = where.value(expr)
    found = [] if value is None else draws([value.node])
    return value is not None and all(_counts(draw) == 1 for draw in found)


def _counts(draw: Draw) -> int | None:
    """Return the number of outcomes of a draw from a set; None if it varies."""
    first = draw.args[0] if draw.args else None
    return int(first.value) if draw.base == "index" and isinstance(first, Const) and first.type.is_scalar else None


def _above_zero(node: Node | None) -> bool:
    return isinstance(node, Const) and any(v > 0 for v in node.flat)


# -- reals ----------------------------------------------------------------------------------------


def whole(context: LintContext) -> Iterator[Doubt]:
    """Yield a real component of the state that is whole in every state of every episode."""
    for c in _whole_components(context.task):
        message = f"'{c.name}' is declared real, but only takes whole values"
        yield Doubt(context.key("state", c.name), message, "declare it `type: int`")


def _whole_components(task: Task) -> list[Component]:
    """Return the largest set of real components that start whole and stay whole while all of them are."""
    reals = {p.name for p in task.parameters if p.kind == "real"}
    nodes = {c.name: pair for c, *pair in zip(task.state, task.initial, task.next, strict=True)}
    found = {
        c.name: c for c in task.state if c.type.kind is Kind.REAL and c.type.size and not _words(task, c.name) & reals
    }
    while broken := [name for name in found if not all(_is_whole(node, found.keys()) for node in nodes[name])]:
        for name in broken:
            del found[name]
    return [c for name, c in found.items() if not _is_fixed(name, *nodes[name])]


def _is_fixed(name: str, first: Node, following: Node) -> bool:
    """Return whether a component starts as a constant and never changes."""
    return isinstance(first, Const) and isinstance(following, Read) and (following.name == name)


def _words(task: Task, name: str) -> set[str]:
    """Return the words in the equations of a component; a real parameter among them need not be whole."""
    return mentioned(task, "initial", name) | mentioned(task, "dynamics", name + "'")


def _is_whole(root: Node, assumed: object) -> bool:
    """Return whether a value is whole if the components in `assumed` are."""
    whole: dict[int, bool] = {}
    for node in walk([root]):
        whole[id(node)] = node.type.kind is not Kind.REAL or _keeps(node, whole, assumed)
    return whole[id(root)]


def _keeps(node: Node, whole: dict[int, bool], assumed: object) -> bool:
    match node:
        case Const():
            return all(math.isfinite(v) and v == int(v) for v in node.flat)
        case Read(role=role, name=name):
            return role is Role.STATE and name in assumed  # type: ignore[operator]
        case Apply(op=op, args=args):
            return entry_of(op).whole and all(whole[id(a)] for a in args)
        case Draw():
            return False
