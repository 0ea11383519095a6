"""Soundness: do the equations define a task? Every check is either decided for all points or tried on samples.

A finite task is looked at in every declared state, for every action, at every time that matters and
for every outcome of its draws, whether an episode gets there or not: dynamics are total. One
exception: a state that can only be entered by a step which ends the episode needs no dynamics.
Where the domain is not finite, or too large, bounds are tried first (interval arithmetic proves that
a value cannot leave how far episodes get), then points of episodes, where it is an error when a check fails, and
samples of the declared domain that a step which goes on may lead to, where it is a warning (W526).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from taskspec.diagnostics import Collector, Diagnostic, SpecError
from taskspec.exact.checks.examine import Examination, Violation
from taskspec.exact.checks.phases import phases
from taskspec.exact.checks.wording import parameters, report
from taskspec.exact.simulation.points import Method
from taskspec.lang.check import TooManyExpressions
from taskspec.limits import also, limits
from taskspec.modifiers import modify
from taskspec.progress import tell
from taskspec.registry import load
from taskspec.task.build import build
from taskspec.task.task import Parameter, Task, TaskLike

RANGE_POINTS = 50_000
MAX_CASES = 8
SHARE = 5
"""Other parameters are tried with this part of the expressions that a task may have."""
FORBIDDEN = ("E703", "E704", "E720")
"""What is said of parameter values that the spec, or a modifier of the task, does not allow."""


@dataclass(frozen=True, slots=True)
class Soundness:
    """What was found, and how: `method` says whether all points were looked at or samples."""

    diagnostics: tuple[Diagnostic, ...]
    method: Method


def examine(task: TaskLike, limit: int | None = None) -> Soundness:
    """Check a task for its present parameters.

    Args:
        limit: how many steps (state, action, time, outcome) are looked at before samples stand in.
    """
    tell("soundness")
    collector = Collector()
    methods = []
    for phase in phases(load(task), limits().points if limit is None else limit):
        examination = Examination(phase)
        for violation in _causes(list(examination.violations())):
            report(violation, examination, collector)
        methods.append(examination.method)
    return Soundness(collector.diagnostics, Method.joined(methods))


def _causes(violations: list[Violation]) -> list[Violation]:
    """Without values that are wrong where a distribution already is: one mistake, one message."""
    drawn = {(v.check.section, v.check.entry) for v in violations if v.check.place is not None}
    return [v for v in violations if v.check.place is not None or (v.check.section, v.check.entry) not in drawn]


def soundness(task: TaskLike) -> list[Diagnostic]:
    """Everything wrong with a task for its present parameters, each with a counterexample."""
    return list(examine(task).diagnostics)


# -- other parameters ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Ranges:
    """Soundness over declared ranges of parameters: the cases tried, and the first case of each problem."""

    diagnostics: tuple[Diagnostic, ...]
    cases: tuple[Mapping[str, Any], ...]


def check_ranges(task: TaskLike, limit: int = RANGE_POINTS) -> Ranges:
    """Check a task at corners of the declared ranges of its parameters and between them.

    Every parameter goes to its ends alone, then all together; a range without an end, or with a far
    one, is tried up to a few times the default. Values that a `require` forbids are passed over. No more are tried
    once their builds together would read more than a fifth of the expressions that one task may have.
    """
    task = load(task)
    known = {(d.code, d.span) for d in examine(task, limit).diagnostics}
    found: list[Diagnostic] = []
    tried = []
    left = limits().expressions // SHARE
    for values in cases(task):
        try:
            with also(f"expressions={left}"):
                other = modify(build(task.document, task.variant, values, task.suite), *task.modifiers)
        except TooManyExpressions:
            break  # it costs too much to try
        except SpecError as error:
            wrong: Iterable[Diagnostic] = _at(values, error)
        else:
            left -= other.builder.expressions
            tried.append(values)
            wrong = examine(other, limit).diagnostics
        for diagnostic in wrong:
            if (diagnostic.code, diagnostic.span) not in known:
                known.add((diagnostic.code, diagnostic.span))
                found.append(diagnostic)
    return Ranges(tuple(found), tuple(tried))


def _at(values: Mapping[str, Any], error: SpecError) -> list[Diagnostic]:
    """What is wrong with a task at some values of its parameters, if they may go together at all."""
    noted = (replace(d, notes=(*d.notes, parameters(values))) for d in error.diagnostics)
    return [d for d in noted if d.code not in FORBIDDEN]


def cases(task: Task) -> list[dict[str, Any]]:
    """Parameter values to try: the ends of each range alone, then all low, all high, and a mixture."""
    ranged = [p for p in task.parameters if len(_ends(p)) > 0]
    alone = [{p.name: value} for p in ranged for value in _ends(p)]
    together = [{p.name: _ends(p)[i] for p in ranged} for i in (0, -1)]
    distinct: dict[str, dict[str, Any]] = {}
    for values in itertools.chain(together, alone):
        changed = {name: value for name, value in values.items() if value != task.values[name]}
        if changed:
            distinct.setdefault(repr(changed), task.given | changed)
    return list(distinct.values())[:MAX_CASES]


def _ends(p: Parameter) -> list[Any]:
    """A few values of a parameter, lowest first: its bounds, or what stands in for a bound that is missing or far."""
    match p.kind:
        case "bool":
            return [False, True]
        case "choice":
            return list(p.values or ())
        case "int":
            far = 2 * abs(int(p.default)) + 3
            low = int(p.default) - far if p.low is None else max(int(p.low), int(p.default) - far)
            high = int(p.default) + far if p.high is None else min(int(p.high), int(p.default) + far)
            return sorted({low, high})
        case _:
            return sorted(_real_ends(p))


def _real_ends(p: Parameter) -> Iterator[float]:
    far = 4 * abs(float(p.default)) + 1
    if p.low is not None:
        yield max(float(p.low), float(p.default) - far)
    if p.high is not None:
        yield min(float(p.high), float(p.default) + far)
