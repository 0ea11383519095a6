"""Warnings about states that do not occur, and components of the state without effect."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Span, SpecError
from taskspec.check.context import SMALL, Doubt, LintContext
from taskspec.lang.ir import Draw, Node, Role, draws, reads, walk
from taskspec.lang.types import Interval, Kind
from taskspec.lang.variates import VARIATES
from taskspec.model.extract import extract
from taskspec.model.model import Model
from taskspec.model.space import plain, words
from taskspec.task.build import build
from taskspec.task.reach import reached
from taskspec.task.task import Component, Task

# -- unreachable values ---------------------------------------------------------------------------

SLACK = 1e-6


def unreachable(context: LintContext) -> Iterator[Doubt]:
    """Yield values of a component that occur in no episode, however long, of this task or of one that shares its roles.

    With an exact model, all values are checked; otherwise the ends of ranges, by interval arithmetic.
    """
    model = context.results.model
    if model is not None and model.entries <= SMALL:
        section = ("state",) if model.task is context.task else ("abstraction", "state")
        entered = [model.states.decode(m.codes[m.connected]) for m in (model, *_partners(context, model))]
        for c in model.task.state:
            values = [e[Role.STATE, c.name] for e in entered]
            seen = np.concatenate([v.reshape(c.type.size, v.shape[-1]) for v in values], 1)
            if c.type.is_scalar or model.task is not context.task:  # on a map, the outer cells are often walls
                yield from _missing(context.key(*section, c.name), c, _missing_values(c, seen))
    if context.model is None:
        yield from _beyond(context)


def _missing(place: Span, c: Component, missing: list[str]) -> Iterator[Doubt]:
    if missing:
        shown = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
        subject = f"{c.name} = {shown}" if c.type.is_scalar else f"an element {shown} in {c.name}"
        yield Doubt(place, f"no episode visits a state with {subject}")


def _missing_values(c: Component, seen: Array) -> list[str]:
    """Return values that a component never has, in words; for a vector only those at the ends of its range."""
    low = int(c.least)
    high = int(c.most)
    if high - low >= 100_000 or not seen.size:
        return []
    every = np.arange(low, high + 1)
    if not c.type.is_scalar:
        if len(set(c.low)) > 1 or len(set(c.high)) > 1:
            return []
        every = every[(every < seen.min()) | (every > seen.max())]
    return [words(plain(c, np.asarray(v))) for v in np.setdiff1d(every, seen.astype(np.int64))[:7]]


def _partners(context: LintContext, model: Model) -> Iterator[Model]:
    """Yield the models of the variants in which expert and learner act."""
    roles = context.task.spec.roles if model.task is context.task else None
    given = {p.name: p.value for p in context.task.parameters if p.value != p.default}
    for variant in dict.fromkeys((roles.expert, roles.learner) if roles is not None else ()):
        if variant in (context.task.name, context.task.variant):
            continue
        try:
            yield extract(build(context.task.document, str(variant), given, context.task.suite), reachable=False)
        except SpecError:
            continue


# -- by intervals -------------------------------------------------------------------------------------------------


def _beyond(context: LintContext) -> Iterator[Doubt]:
    """Yield ends of ranges that intervals prove to be unreachable; a missing end counts if the other one is declared."""
    task = context.task
    found = reached(task.state, task.initial, task.next, horizon=None)
    normal = _normal(task)
    for c in task.state:
        if c.name in normal or c.domain is not None or c.type.kind is Kind.BOOL:
            continue
        for beyond in _unused_ends(c, found[c.name]):
            yield Doubt(context.key("state", c.name), f"no episode visits a state with {c.name} {beyond}")


def _unused_ends(c: Component, found: Interval) -> Iterator[str]:
    low = c.least
    high = c.most
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
    """Return components that depend on normal draws, whose range depends on their implementation."""
    pairs = {c.name: pair for c, *pair in zip(task.state, task.initial, task.next, strict=True)}
    found = {n for n, pair in pairs.items() if any(isinstance(x, Draw) and VARIATES[x.base].cut for x in walk(pair))}
    while more := {n for n, pair in pairs.items() if {name for _, name in reads(pair)} & found} - found:
        found |= more
    return found


# -- components without effect --------------------------------------------------------------------


def unread(context: LintContext) -> Iterator[Doubt]:
    """Yield a component on which neither rewards nor ends depend, which is not shown, or is drawn all the same."""
    task = context.task
    matters = _followed(task, (task.reward, task.terminal))
    shown = _followed(task, () if task.observation.is_state else task.observation.nodes)
    for c, first, following in zip(task.state, task.initial, task.next, strict=True):
        if c.name in matters | shown or c.low == c.high:
            continue
        if not task.observation.is_state:
            message = f"neither rewards nor ends depend on '{c.name}', and it is not observed"
            yield Doubt(context.key("state", c.name), message)
        elif draws((first, following)):
            yield Doubt(
                context.key("state", c.name), f"'{c.name}' is drawn, but neither rewards nor endings depend on it"
            )


def forgotten(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the expert's memory that no action of it depends on."""
    task = context.task
    if task.memory is None:
        return
    nexts = {c.name: node for c, node in zip(task.memory.components, task.memory.next, strict=True) if c.type.size}
    found = {name for _, name in reads(task.expert)} if isinstance(task.expert, tuple) else set()
    for _ in nexts:
        found |= {name for known in found & nexts.keys() for role, name in reads([nexts[known]]) if role is Role.STATE}
    for name in (n for n in nexts if n not in found):
        yield Doubt(context.key("memory", name), f"no action of the expert depends on '{name}'")


def _followed(task: Task, roots: tuple[Node, ...]) -> set[str]:
    """Return components that some nodes depend on, at this step or later."""
    nexts = {c.name: node for c, node in zip(task.state, task.next, strict=True)}
    inside = {id(node) for node in walk(roots)}
    found: set[str] = set()
    fresh = {name for role, name in reads(roots) if role is Role.STATE}
    fresh |= {name for name, node in nexts.items() if id(node) in inside}
    while fresh:
        found |= fresh
        fresh = {name for role, name in reads([nexts[n] for n in fresh]) if role is Role.STATE} - found
    return found
