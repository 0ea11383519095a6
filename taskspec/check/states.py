"""Warnings about states that do not occur, components that make no difference, reals that could be ints."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, SpecError
from taskspec.check.case import SMALL, Linted
from taskspec.check.names import mentioned
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, draws, reads, walk
from taskspec.lang.operators import entry_of
from taskspec.lang.types import Interval, Kind
from taskspec.lang.variates import VARIATES
from taskspec.model.extract import extract
from taskspec.model.model import Model
from taskspec.model.space import plain, words
from taskspec.task.build import build
from taskspec.task.reach import reached
from taskspec.task.task import Component, Task

# ---------- states
# States that do not occur: values in the declared ranges of components that no episode takes.

SLACK = 1e-6


def unreachable(case: Linted, collector: Collector) -> None:
    """W501: values of a component that occur in no episode, however long, of this task or of one that shares its roles.

    Where there is an exact model all values are looked at, elsewhere what intervals prove about the ends of ranges.
    """
    model = case.results.model
    if model is not None and model.entries <= SMALL:
        section = ("state",) if model.task is case.task else ("abstraction", "state")
        entered = [model.states.decode(m.codes[m.connected]) for m in (model, *_partners(case, model))]
        for c in model.task.state:
            values = [e[Role.STATE, c.name] for e in entered]
            seen = np.concatenate([v.reshape(c.type.size, v.shape[-1]) for v in values], 1)
            if c.type.is_scalar or model.task is not case.task:  # on a map, the outer cells are often walls
                _report(case, (*section, c.name), c, _missing(c, seen), collector)
    if case.model is None:
        _beyond(case, collector)


def _report(case: Linted, path: tuple[str, ...], c: Component, missing: list[str], collector: Collector) -> None:
    if missing:
        shown = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
        subject = f"{c.name} = {shown}" if c.type.is_scalar else f"an element {shown} in {c.name}"
        collector.add("W501", case.key(*path), f"no episode visits a state with {subject}")


def _missing(c: Component, seen: Array) -> list[str]:
    """Values that a component never takes, in words; of a vector only those at the ends of its range."""
    low, high = int(c.least), int(c.most)
    if high - low >= 100_000 or not seen.size:
        return []
    every = np.arange(low, high + 1)
    if not c.type.is_scalar:
        if len(set(c.low)) > 1 or len(set(c.high)) > 1:
            return []
        every = every[(every < seen.min()) | (every > seen.max())]
    return [words(plain(c, np.asarray(v))) for v in np.setdiff1d(every, seen.astype(np.int64))[:7]]


def _partners(case: Linted, model: Model) -> Iterator[Model]:
    """The models of the variants in which expert and learner act, at their own defaults where this one is at its."""
    roles = case.task.spec.roles if model.task is case.task else None
    given = {p.name: p.value for p in case.task.parameters if p.value != p.default}
    for variant in dict.fromkeys((roles.expert, roles.learner) if roles is not None else ()):
        if variant in (case.task.name, case.task.variant):
            continue
        try:
            yield extract(build(case.task.document, str(variant), given, case.task.suite), reachable=False)
        except SpecError:
            continue


# -- by intervals -------------------------------------------------------------------------------------------------


def _beyond(case: Linted, collector: Collector) -> None:
    """Ends of ranges that no episode gets to; an end that is not declared counts where the other one is."""
    task = case.task
    found = reached(task.state, task.initial, task.next, horizon=None)
    normal = _normal(task)
    for c in task.state:
        if c.name in normal or c.domain is not None or c.type.kind is Kind.BOOL:
            continue
        for beyond in _unused_ends(c, found[c.name]):
            collector.add("W501", case.key("state", c.name), f"no episode visits a state with {c.name} {beyond}")


def _unused_ends(c: Component, found: Interval) -> Iterator[str]:
    low, high = c.least, c.most
    if not np.isfinite([low, high]).any():
        return
    slack = SLACK * max([1.0, *(abs(v) for v in found if np.isfinite(v))])
    if found[0] > low + slack:
        yield f"below {found[0]:g}, and its range {_begins(low)}"
    if found[1] < high - slack:
        yield f"above {found[1]:g}, and its range {_ends(high)}"


def _begins(low: float) -> str:
    return f"begins at {low:g}" if np.isfinite(low) else "has no low end"


def _ends(high: float) -> str:
    return f"ends at {high:g}" if np.isfinite(high) else "has no high end"


def _normal(task: Task) -> set[str]:
    """Components that normal draws go into: how far these get is a matter of how they are made."""
    pairs = {c.name: pair for c, *pair in zip(task.state, task.initial, task.next, strict=True)}
    found = {n for n, pair in pairs.items() if any(isinstance(x, Draw) and VARIATES[x.base].cut for x in walk(pair))}
    while more := {n for n, pair in pairs.items() if {name for _, name in reads(pair)} & found} - found:
        found |= more
    return found


# ---------- unread
# Components of the state that make no difference.


def unread(case: Linted, collector: Collector) -> None:
    """W519: a component on which neither rewards nor ends depend, which is not shown, or is drawn all the same."""
    task = case.task
    matters = _followed(task, (task.reward, task.terminal))
    shown = _followed(task, () if task.observation.is_state else task.observation.nodes)
    for c, first, following in zip(task.state, task.initial, task.next, strict=True):
        if c.name in matters | shown or c.low == c.high:
            continue
        if not task.observation.is_state:
            message = f"neither rewards nor ends depend on '{c.name}', and it is not observed"
            collector.add("W519", case.key("state", c.name), message)
        elif draws((first, following)):
            collector.add(
                "W519", case.key("state", c.name), f"'{c.name}' is drawn, but neither rewards nor endings depend on it"
            )


def forgotten(case: Linted, collector: Collector) -> None:
    """W519: what the expert remembers, and nothing that it does depends on."""
    task = case.task
    if task.memory is None:
        return
    nexts = {c.name: node for c, node in zip(task.memory.components, task.memory.next, strict=True) if c.type.size}
    found = {name for _, name in reads(task.expert)} if isinstance(task.expert, tuple) else set()
    for _ in nexts:
        found |= {name for known in found & nexts.keys() for role, name in reads([nexts[known]]) if role is Role.STATE}
    for name in (n for n in nexts if n not in found):
        collector.add("W519", case.key("memory", name), f"no action of the expert depends on '{name}'")


def _followed(task: Task, roots: tuple[Node, ...]) -> set[str]:
    """Components that some nodes depend on, at this step or later; a node may hold the next value of a component."""
    nexts = {c.name: node for c, node in zip(task.state, task.next, strict=True)}
    inside = {id(node) for node in walk(roots)}
    found: set[str] = set()
    fresh = {name for role, name in reads(roots) if role is Role.STATE}
    fresh |= {name for name, node in nexts.items() if id(node) in inside}
    while fresh:
        found |= fresh
        fresh = {name for role, name in reads([nexts[n] for n in fresh]) if role is Role.STATE} - found
    return found


# ---------- reals
# Reals that could be ints.


def whole(case: Linted, collector: Collector) -> None:
    """W513: a real component of the state that is whole in every state of every episode."""
    for c in _whole_components(case.task):
        message = f"'{c.name}' is declared real, but only takes whole values"
        collector.add("W513", case.key("state", c.name), message, "declare it `type: int`")


def _whole_components(task: Task) -> list[Component]:
    """The largest set of real components that start whole and stay whole while all of them are."""
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
    """Whether a component starts as a constant and stays as it is."""
    return isinstance(first, Const) and isinstance(following, Read) and (following.name == name)


def _words(task: Task, name: str) -> set[str]:
    """What the lines of a component mention; a real parameter there is whole by chance at the most."""
    return mentioned(task, "initial", name) | mentioned(task, "dynamics", name + "'")


def _is_whole(root: Node, assumed: object) -> bool:
    """Whether a value is whole if the components in `assumed` are."""
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
