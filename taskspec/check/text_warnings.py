"""Warnings about the text of a spec: names, indices and slices, draws without chance, reals that are whole."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.check.warning_context import Doubt, LintContext
from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.dists import CATEGORICAL, DISTS
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, draws, reads, walk
from taskspec.lang.operators import entry_of
from taskspec.lang.scope import ClampedIndex
from taskspec.lang.types import INT, Kind
from taskspec.model.points import Samples, columns
from taskspec.model.space import Reads, words
from taskspec.printers import plain
from taskspec.printers.names import of_task
from taskspec.rollout.rollout import visited
from taskspec.soundness.phases import Check, CheckPhase, Examination, Violation, entries
from taskspec.soundness.places import SectionScope, distributions
from taskspec.soundness.soundness import in_words
from taskspec.task.merge import before
from taskspec.task.task import Task

NAMED = ("parameters", "constants", "definitions", "noise")
ROOTS = (
    "state", "action", "observation", "horizon", "terminal", "discount", "initial", "dynamics", "reward",
    "absorbing_reward", "memory", "expert", "abstraction", "symmetries",
)  # fmt: skip
PROSE = frozenset({"doc", "symbol", "symbols", "message"})
INSTANCE_SEED = "instance_seed"
_KINDS = {
    "parameters": "parameter", "constants": "constant", "definitions": "definition", "noise": "noise", "state": "component",
    "action": "action",
}  # fmt: skip
_WORD = re.compile(r"[^\W\d]\w*")


def unused_names(context: LintContext) -> Iterator[Doubt]:
    """Yield parameters, constants, definitions and noise that nothing depends on."""
    data = context.task.written
    wanted = {INSTANCE_SEED, *_words((data.get("parameters") or {}).get("require"))}
    for section in ROOTS:
        wanted |= set(_words(data.get(section)))
    used = followed(context.task, wanted, NAMED)
    for section in NAMED:
        for name in data.get(section) or {}:
            if name != "require" and str(name).partition("(")[0].strip() not in used:
                yield Doubt(context.key(section, name), f"nothing uses the {_KINDS[section]} '{name}'")


def mentioned(task: Task, section: str, name: str | None = None) -> set[str]:
    """Return every word of a section (or of one of its entries), and of the definitions, constants and noises that it names."""
    value = task.written.get(section)
    if name is not None:
        value = value.get(name) if isinstance(value, dict) else None
    return followed(task, set(_words(value)))


def followed(task: Task, words: set[str], sections: Sequence[str] = NAMED[1:]) -> set[str]:
    """Return some words, and every word of the entries of some sections that they name."""
    entries = {}
    for section in sections:
        for written, value in (task.written.get(section) or {}).items():
            entries[str(written).partition("(")[0].strip()] = value
    found = set(words)
    used: set[str] = set()
    while fresh := (found & entries.keys()) - used:
        used |= fresh
        for word in fresh:
            found |= set(_words(entries[word]))
    return found


def _words(value: Any) -> Iterator[str]:
    """Yield every word in the expressions of a section, keys included, prose excluded."""
    match value:
        case str():
            yield from _WORD.findall(value)
        case dict():
            for key, inner in value.items():
                if key not in PROSE:
                    yield from _words(str(key))
                    yield from _words(inner)
        case list():
            for inner in value:
                yield from _words(inner)
        case _:
            return


def printed_alike(context: LintContext) -> Iterator[Doubt]:
    """Yield two names with one symbol, or a name and a label; labels of different components may share theirs."""
    notation = of_task(context.task)
    printed = []
    for section, written, name in _names(context):
        printed.append((section, written, notation.symbol(name), f"the {_KINDS[section]} '{name}'"))
    names = len(printed)
    for section, components in (("state", context.task.state), ("action", context.task.action)):
        for c in components:
            for label, tree in notation.labels.get(c.name, {}).items():
                printed.append((section, c.name, tree, f"the label '{label}' of '{c.name}'"))
    seen: dict[str, str] = {}
    for i, (section, written, tree, what) in enumerate(printed):
        symbol = plain(tree)
        if symbol in seen:
            message = f"pages print `{symbol}` for {seen[symbol]} and for {what}"
            hint = "give one of them another `symbol`, or labels other `symbols`"
            yield Doubt(context.key(section, written), message, hint)
        elif i < names:
            seen[symbol] = what


ALIKE = str.maketrans(
    "\u0430\u0435\u043e\u0440\u0441\u0443\u0445\u0455\u0456\u0458\u04bb\u051b\u051d\u0501"  # Cyrillic, small
    "\u0410\u0412\u0415\u041a\u041c\u041d\u041e\u0420\u0421\u0422\u0423\u0425\u0405\u0406\u0408"  # and capital
    "\u03bf\u0391\u0392\u0395\u0396\u0397\u0399\u039a\u039c\u039d\u039f\u03a1\u03a4\u03a5\u03a7\u0585",  # Greek; Armenian
    "aeopcyxsijhqwdABEKMHOPCTYXSIJoABEZHIKMNOPTYXo",
)
"""Letters of other alphabets, and the Latin letters that they look like."""


def foreign_letters(context: LintContext) -> Iterator[Doubt]:
    """Yield a name that looks like one in Latin letters."""
    names = [((section, written), name) for section, written, name in _names(context)]
    for section, components in (("state", context.task.state), ("action", context.task.action)):
        labels = [((section, c.name), str(label)) for c in components if c.domain for label in c.domain.labels]
        names += labels
    for place, name in names:
        latin = name.translate(ALIKE)
        if latin != name and latin.isascii():
            letter = next(a for a, b in zip(name, latin, strict=True) if a != b)
            message = f"'{name}' is not '{latin}': its '{letter}' is {unicodedata.name(letter)}, U+{ord(letter):04X}"
            yield Doubt(context.key(*place), message, "write it in Latin letters, here and where it is used")


def _names(context: LintContext) -> Iterator[tuple[str, str, str]]:
    """Yield every name: the section that declares it, the key there, and the name."""
    spec = context.task.spec
    parts = (spec.parameters.entries, spec.constants, spec.definitions, spec.noise, spec.state, spec.action)
    for section, declared in zip(_KINDS, parts, strict=True):
        for written in declared:
            yield section, written, written.partition("(")[0].strip()


def idle_errata(context: LintContext) -> Iterator[Doubt]:
    """Yield an erratum of a variant about a section that is as it is without the variant."""
    task = context.task
    merged = context.merged
    based = before(task.source.document, task.source.variant)
    if based is None or not merged.data.get("errata") or not merged.is_own(("errata",)):
        return
    for i, entry in enumerate(merged.data["errata"]):
        for j, section in enumerate(entry.get("about") or ()):
            if merged.data.get(section) == based.data.get(section):
                message = f"this erratum is about `{section}`, which this variant does not change"
                yield Doubt(merged.span(("errata", i, "about", j)), message)


# -- indices --------------------------------------------------------------------------------------

POINTS = 100_000
"""States, actions and times that are evaluated, at most."""


def moved(context: LintContext) -> Iterator[Doubt]:
    """Yield an index that lies outside in a state in which episodes act, where its value matters."""
    task = context.task
    left = {id(m.node): m for m in task.source.surface.moved}
    if not left:
        return
    expert = task.annotations.expert if isinstance(task.annotations.expert, tuple) else ()
    step = (*task.process.raw_next, task.process.reward, task.process.terminal)
    for phase, roots in (("observation", task.observation.nodes), ("expert", expert), ("step", step)):
        checks = {}
        for node, guard in _guards(roots, task.new_builder(roots)):
            if id(node) in left:
                m = left[id(node)]
                size = m.index.type.size
                check = Check(
                    "W510", m.index, (0,) * size, (m.length - 1,) * size, phase, guards=(guard,), what=str(id(node))
                )
                checks[check.what] = check
        if not checks:
            continue
        points = Samples(_acting_points(context, roots), {})
        for violation in Examination(CheckPhase(task, phase, tuple(checks.values()), points, False)).violations():
            yield _moved(left.pop(int(violation.check.what)), violation, task)


def _acting_points(context: LintContext, roots: Sequence[Node]) -> Reads:
    """Return the values read at points at which episodes act: all if there is an exact model, otherwise samples."""
    model = context.model
    if model is None:
        return visited(context.task)
    read = reads(roots)
    actions = 1
    if any(role is Role.ACTION for role, _ in read):
        actions = model.n_actions
    levels: Iterable[tuple[int, Array]] = [(0, model.acting)]
    if (Role.TIME, "t") in read or model.is_timed:
        levels = model.levels()
    parts = []
    left = POINTS
    for t, level in levels:
        codes = model.codes[level]
        every = np.arange(len(codes) * actions)[:left]
        left -= len(every)
        point = model.states.decode(codes[every % len(codes)], read) | model.actions.decode(every // len(codes), read)
        parts.append(point | {(Role.TIME, "t"): np.full(len(every), t)})
    return columns(parts)


def _moved(m: ClampedIndex, violation: Violation, task: Task) -> Doubt:
    read = reads([m.index])
    known = {key: value for key, value in violation.reads.items() if key in read}
    where = [in_words(task.state, Role.STATE, known), in_words(task.action, Role.ACTION, known)]
    where += [f"t = {words(int(v[0]))}" for (role, _), v in known.items() if role is Role.TIME]
    found = ", ".join(filter(None, where))
    values = violation.value.reshape(-1)
    index = int(values[(values < 0) | (values >= m.length)][0])
    end = 0 if index < 0 else m.length - 1
    place = f"for {found}, " * bool(found)
    message = f"{place}this index is {index}; it is moved to {end}, the nearest of 0 ... {m.length - 1}"
    return Doubt(m.place, message, "if this is intended, write `clip(i, 0, n - 1)`")


def _guards(roots: Sequence[Node], b: Builder) -> Iterator[tuple[Node, Node]]:
    """Yield every node with the condition under which its value matters: not in a branch that is not taken."""
    never = b.scalar(False)
    guards: dict[int, Node] = {id(root): b.scalar(True) for root in roots}
    for node in reversed(list(walk(roots))):
        here = guards[id(node)]
        yield node, here
        needed = [here] * len(children(node))
        if isinstance(node, Apply) and node.op in ("where", "and", "or") and node.type.is_scalar:
            holds = node.args[0]
            fails = b.apply("not", holds)
            needed[1] = b.apply("and", here, fails if node.op == "or" else holds)
            if node.op == "where":
                needed[2] = b.apply("and", here, fails)
        for child, guard in zip(children(node), needed, strict=True):
            guards[id(child)] = b.apply("or", guards.get(id(child), never), guard)


# -- slices ---------------------------------------------------------------------------------------

MOST = 1000
"""Slices that are checked, at most."""
SECTIONS = ("noise", "initial", "dynamics", "reward", "terminal", "observation", "memory", "expert")


@dataclass(frozen=True)
class _Slice:
    """A slice of a vector as it is written; the vector and its length where they are known."""

    node: s.Subscript
    cut: s.Slice
    where: SectionScope

    @property
    def vector(self) -> Node | None:
        value = self.where.value(self.node.value)
        if value is not None and value.node.type.shape:
            return value.node
        return None

    def end(self, expr: s.Expr | None) -> int | None:
        """Return an end of the slice if it is a constant."""
        node = None if expr is None else self.where.number(expr)
        if isinstance(node, Const) and node.type == INT:
            return int(node.value)
        return None


def past_the_end(context: LintContext) -> Iterator[Doubt]:
    """Yield a slice that asks for more than there is."""
    for expr in _sliced(context.task):
        for each in expr:
            vector = each.vector
            if vector is not None:
                yield from _past_the_end(each, vector.type.shape[0])


def _past_the_end(each: _Slice, length: int) -> Iterator[Doubt]:
    cut = each.cut
    for end in (cut.start, cut.stop):
        at = each.end(end)
        if end is not None and at is not None and not -length <= at <= length:
            yield Doubt(end.place, f"this slice goes to {at}, but the vector has {length} elements")
            return
    ends = (cut.start, cut.stop, cut.step)
    is_literal = all(end is None or not list(s.names(end)) for end in ends)
    if is_literal and length and not range(length)[slice(*map(each.end, ends))]:
        yield Doubt(cut.place, "this slice has no elements for any parameters")


def uneven(context: LintContext) -> Iterator[Doubt]:
    """Yield a first and a last part of one vector that overlap, or that leave something out between them.

    `v[1:]` beside `v[:-1]` sets neighbours side by side, and `concat(v[:i], v[j:])` cuts a piece out: both are meant so.
    """
    for expr in _sliced(context.task, joined=False):
        stops: dict[int, int] = {}
        starts = []
        for each in expr:
            cut = each.cut
            vector = each.vector
            at = each.end(cut.start or cut.stop)
            if vector is None or at is None or cut.step is not None or len(each.node.indices) > 1:
                continue
            if at < 0:
                at += vector.type.shape[0]
            if cut.start is None:
                stops[id(vector)] = at
            elif cut.stop is None:
                starts.append((vector, at, each.node))
        for vector, start, node in starts:
            stop = stops.get(id(vector), start)
            if stop != start and stop + start != vector.type.shape[0]:
                what = f"both hold elements {start} to {stop - 1}"
                if stop < start:
                    what = f"leave out {stop} to {start - 1}"
                message = f"the parts before {stop} and from {start} of this vector {what}"
                yield Doubt(node.place, message, "use the same index for both")


def _sliced(task: Task, joined: bool = True) -> Iterator[list[_Slice]]:
    """Yield the slices of every expression, as long as there are not too many; without those that are `joined` by `concat`."""
    left = MOST
    for expr, where in expressions(task):
        parts = list(s.below(expr))
        arguments = {id(a) for c in parts if isinstance(c, s.Call) and c.function == "concat" for a in c.args}
        subscripts = [n for n in parts if isinstance(n, s.Subscript) and isinstance(n.indices[0], s.Slice)]
        if subscripts and left > 0:
            left -= len(subscripts)
            kept = [n for n in subscripts if joined or id(n) not in arguments]
            yield [_Slice(n, n.indices[0], where) for n in kept if isinstance(n.indices[0], s.Slice)]


def expressions(task: Task) -> Iterator[tuple[s.Expr, SectionScope]]:
    """Yield every expression of the sections that act, and of the definitions, with a section whose names it can use."""
    for section in (*SECTIONS, "definitions"):
        where = SectionScope(task, "reward" if section == "definitions" else section)
        for _, expr in entries(task, section):
            yield expr, where


# -- draws ----------------------------------------------------------------------------------------


def certain(context: LintContext) -> Iterator[Doubt]:
    """Yield a draw with a single outcome. Where a real parameter has a say, its ends may be why."""
    task = context.task
    reals = {p.name for p in task.parameters if p.kind == "real"}
    for section in SECTIONS:
        where = SectionScope(task, section)
        for _, expr in entries(task, section):
            for written in distributions(expr, where):
                used = {n.id for n in s.names(written.expr) if isinstance(n, s.Name)}
                if _is_certain(written.expr, where) and not followed(task, used) & reals:
                    yield Doubt(written.expr.place, "this draw has only one outcome", "write the value itself")


def _is_certain(expr: s.Call | s.Weights, where: SectionScope) -> bool:
    match expr:
        case s.Weights(pairs=pairs) | s.Call(args=(s.Weights(pairs=pairs),)):
            weights = [where.number(p) for _, p in pairs]
            constants = [w for w in weights if isinstance(w, Const)]
            return len(constants) == len(weights) and sum(any(v > 0 for v in w.flat) for w in constants) == 1
        case s.Call(args=(s.Comprehension(),)):
            return False  # what is left of a set may be a matter of the map that it is made from
        case s.Call(args=(s.SetOf(),)):
            value = where.value(expr)
            return value is not None and all(_is_of_one(draw) for draw in draws([value.node]))
        case s.Call(function=name, args=args, keywords=keywords):
            dist = CATEGORICAL if name == CATEGORICAL.name else DISTS[name]
            names = [a.name for a in dist.arguments]
            given = dict(zip(names, args, strict=False)) | dict(keywords)
            return dist.certain({key: where.number(value) for key, value in given.items() if key in names})


def _is_of_one(draw: Draw) -> bool:
    """Return whether a draw from a set has one outcome."""
    first = draw.args[0] if draw.args else None
    return draw.base == "index" and isinstance(first, Const) and first.type.is_scalar and first.value == 1


# -- reals ----------------------------------------------------------------------------------------


def whole(context: LintContext) -> Iterator[Doubt]:
    """Yield a real component of the state that is whole in every state of every episode.

    They are the largest set of real components that start whole and stay whole while all of them are. A real parameter in
    their equations need not be whole.
    """
    task = context.task
    reals = {p.name for p in task.parameters if p.kind == "real"}
    nodes = {c.name: pair for c, *pair in zip(task.state, task.process.initial, task.process.next, strict=True)}
    found = set()
    for c in task.state:
        used = mentioned(task, "initial", c.name) | mentioned(task, "dynamics", c.name + "'")
        if c.type.kind is Kind.REAL and c.type.size and not used & reals:
            found.add(c.name)
    while broken := {name for name in found if not all(_is_whole(node, found) for node in nodes[name])}:
        found -= broken
    for c in task.state:
        if c.name in found:
            first, following = nodes[c.name]
            is_fixed = isinstance(first, Const) and isinstance(following, Read) and following.name == c.name
            if not is_fixed:
                message = f"'{c.name}' is declared real, but only takes whole values"
                yield Doubt(context.key("state", c.name), message, "declare it `type: int`")


def _is_whole(root: Node, assumed: set[str]) -> bool:
    """Return whether a value is whole if the components in `assumed` are."""
    whole: dict[int, bool] = {}
    for node in walk([root]):
        keeps = node.type.kind is not Kind.REAL
        match node:
            case Const():
                keeps = keeps or all(math.isfinite(v) and v == int(v) for v in node.flat)
            case Read(role=role, name=name):
                keeps = keeps or (role is Role.STATE and name in assumed)
            case Apply(op=op, args=args):
                keeps = keeps or (entry_of(op).whole and all(whole[id(a)] for a in args))
        whole[id(node)] = keeps
    return whole[id(root)]
