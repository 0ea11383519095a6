"""States that do not occur: values in the declared ranges of components that no episode takes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector, SpecError
from taskspec.exact.lint.case import SMALL, Linted
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model
from taskspec.exact.model.space import plain, words
from taskspec.lang.ir import Draw, Role, reads, walk
from taskspec.lang.ranges import Interval
from taskspec.lang.types import Kind
from taskspec.lang.variates import VARIATES
from taskspec.task.build import build
from taskspec.task.reach import reached
from taskspec.task.task import Component, Task

Array = np.ndarray[Any, Any]
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
