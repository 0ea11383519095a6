"""Soundness: whether the equations of a spec define a task, decided for all points or tested on samples.

A finite task is checked in every declared state, for every action, at every time that matters and for every outcome of its
draws, whether an episode gets there or not: dynamics are total. One exception: a state that can only be entered by a step which
ends the episode needs no dynamics. If the domain is infinite or too large, interval arithmetic is tried first; then points of
episodes, where a failure is an error, and samples of the declared domain, where it is a warning (W526).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, Diagnostic, Placed, SpecError
from taskspec.base.limits import also, limits, tell
from taskspec.lang.check import TooManyExpressions
from taskspec.lang.ir import Role, reads
from taskspec.model.extract import number_words, outside_domain
from taskspec.model.points import Method
from taskspec.model.space import domain, shown, words
from taskspec.modifiers import modify
from taskspec.registry import load
from taskspec.soundness.examine import Examination, Violation
from taskspec.soundness.phases import Check, entries, phases
from taskspec.soundness.places import SectionScope, narrow
from taskspec.task.build import build
from taskspec.task.task import Component, Parameter, Task, TaskLike

# -- counterexamples in words ---------------------------------------------------------------------

_HINTS = {
    "E403": "widen the bounds, stop at them with `clip`, or end the episode earlier",
    "E402": "a probability lies between 0 and 1",
}


def report(violation: Violation, examination: Examination, collector: Collector) -> None:
    """Report a violation: an error if episodes may reach it, a warning if that is unknown."""
    check = violation.check
    task = examination.task
    message = f"{_where(violation, task)}{_what(violation)}"
    place = _place(violation, task)
    if violation.acting is None:
        hint = f"if no episode gets there, say so: narrow the bounds of the state, or accept W526; otherwise it is {check.code}"
        collector.add("W526", place, message, hint, _notes(violation, task))
    else:
        collector.add(check.code, place, message, _HINTS.get(check.code), _notes(violation, task))


def _where(violation: Violation, task: Task) -> str:
    """Return `from s = 20 with a = 1, `: all that the value depends on; the whole state if that is short."""
    check = violation.check
    needed = reads((check.node, *check.guards))
    states = _values(task.state, Role.STATE, violation, needed)
    actions = _values(task.action, Role.ACTION, violation, needed)
    time = violation.reads.get((Role.TIME, "t")) if (Role.TIME, "t") in needed else None
    words_ = []
    if states:
        words_.append(f"{'from' if check.section == 'dynamics' else 'in'} {', '.join(states)}")
    if actions:
        words_.append(f"with {', '.join(actions)}")
    if time is not None:
        words_.append(f"at t = {int(np.asarray(time).reshape(-1)[0])}")
    return " ".join(words_) + (", " if words_ else "")


def _values(
    components: Iterable[Component], role: Role, violation: Violation, needed: frozenset[tuple[Role, str]]
) -> list[str]:
    components = list(components)
    whole = violation.check.section == "dynamics" and len(components) == 1 and components[0].type.size <= 4
    return [
        f"{c.name} = {shown(c, violation.reads[role, c.name][..., 0])}"
        for c in components
        if (role, c.name) in violation.reads and ((role, c.name) in needed or whole)
    ]


def _what(violation: Violation) -> str:
    check = violation.check
    value = violation.value[..., 0]
    c = check.subject
    if c is None:
        return f"{check.what} is {_number(value)}{_limits(check)}"
    name = {"E403": f"the next {c.name} is", "E404": f"{c.name} starts at", "E409": f"the expert's {c.name} is"}
    lead = name.get(check.code, f"{c.name} is")
    if value.dtype.kind == "f" and not np.isfinite(value).all():
        return f"{lead} {shown(c, value)}, which is not a finite number"
    if len(set(c.low)) > 1 or len(set(c.high)) > 1:
        index, low, high = _outside(c, value)
        return f"{lead} {shown(c, value)}; {c.name}[{index}] must be between {words(low)} and {words(high)}"
    return f"{lead} {shown(c, value)}; it must be {domain(c)}"


def _outside(c: Component, value: Array) -> tuple[str, float, float]:
    """Return the index and the bounds of the first element that is out of its bounds."""
    wrong = [not low <= v <= high for v, low, high in zip(value.ravel().tolist(), c.low, c.high, strict=True)]
    i = wrong.index(True) if True in wrong else 0
    index = ", ".join(str(k) for k in np.unravel_index(i, value.shape))
    return index, c.low[i], c.high[i]


def _number(value: Array) -> str:
    return words(np.asarray(value).tolist())


def _limits(check: Check) -> str:
    low = check.low[0]
    high = check.high[0]
    match check.code:
        case "E401":
            return ", not 1"
        case "E406":
            return ", which is not a finite number"
        case "E402":
            return "; it must be between 0 and 1"
        case _ if low == 0:
            return "; it must be at least 0"
        case _ if low > 0:
            return "; it must be above 0"
        case _:
            return f"; it must be finite (between {low:g} and {high:g})"


def _notes(violation: Violation, task: Task) -> list[str]:
    notes = []
    if task.parameters:
        notes.append(parameters(task.values))
    if violation.check.section == "noise":
        name = violation.check.entry
        notes.append(
            f"a noise is drawn in every step, even where nothing uses it: give `{name}` a value there, "
            f"`{name}: ... if CONDITION else VALUE`, or write the draw where it is used"
        )
    if violation.acting is None:
        notes.append("no tested episode visited this state; without an exact model, it is unknown whether any can")
    if violation.acting is False:
        notes.append("no episode takes an action in this state, but it is a declared state")
    return notes


def parameters(values: Mapping[str, Any]) -> str:
    """Return the note with the parameter values of a problem."""
    return "parameters: " + ", ".join(f"{name} = {words(value)}" for name, value in values.items())


def _place(violation: Violation, task: Task) -> Placed | None:
    """Return the place of the smallest expression that gives the value."""
    check = violation.check
    if check.place is not None:
        return check.place.place
    found = [(name, expr) for name, expr in entries(task, check.section) if name in (check.entry, None)]
    if not found:
        return None
    return narrow(found[0][1], SectionScope(task, check.section), violation.reads).place


# -- soundness ------------------------------------------------------------------------------------

RANGE_POINTS = 50_000
MAX_CASES = 8
SHARE = 5
"""Tasks for other parameters have, together, one in so many of the expressions that a task may have."""
FORBIDDEN = ("E703", "E704", "E720")
"""Codes for parameter values that the spec, or a modifier of the task, does not allow."""


@dataclass(frozen=True, slots=True)
class Soundness:
    """Problems of a task, and the method: all points, or samples."""

    diagnostics: tuple[Diagnostic, ...]
    method: Method


def examine(task: TaskLike, limit: int | None = None) -> Soundness:
    """Check a task for its present parameters.

    Args:
        limit: steps (state, action, time, outcome) up to which all are checked, rather than samples.
    """
    tell("soundness")
    collector = Collector()
    methods = []
    for phase in phases(load(task), limits().points if limit is None else limit):
        examination = Examination(phase)
        for violation in _causes(list(examination.violations())):
            report(violation, examination, collector)
        methods.append(examination.method)
    _report_numbers(load(task), collector)
    return Soundness(collector.diagnostics, Method.joined(methods))


def _report_numbers(task: Task, collector: Collector) -> None:
    """Report (E411) a number that is too large or too small."""
    found = outside_domain(task)
    if found is not None:
        section, value = found
        lines = [expr for _, expr in entries(task, section)]
        message = (
            f"the {section} has the number {number_words(value)}, which is too {'large' if value > 1 else 'close to 0'}"
        )
        collector.add("E411", lines[0].place if lines else None, message, "choose another unit, or write 0")


def _causes(violations: list[Violation]) -> list[Violation]:
    """Drop wrong values in entries with a wrong distribution: one mistake, one message."""
    drawn = {(v.check.section, v.check.entry) for v in violations if v.check.place is not None}
    return [v for v in violations if v.check.place is not None or (v.check.section, v.check.entry) not in drawn]


def soundness(task: TaskLike) -> list[Diagnostic]:
    """Return every problem of a task for its present parameters, each with a counterexample."""
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
            left -= other.surface.expressions
            tried.append(values)
            wrong = examine(other, limit).diagnostics
        for diagnostic in wrong:
            if (diagnostic.code, diagnostic.span) not in known:
                known.add((diagnostic.code, diagnostic.span))
                found.append(diagnostic)
    return Ranges(tuple(found), tuple(tried))


def _at(values: Mapping[str, Any], error: SpecError) -> list[Diagnostic]:
    """Return the mistakes of a task at parameter values that are allowed together."""
    noted = (replace(d, notes=(*d.notes, parameters(values))) for d in error.diagnostics)
    return [d for d in noted if d.code not in FORBIDDEN]


def cases(task: Task) -> list[dict[str, Any]]:
    """Return parameter values to try: all low, all high, then the ends of each range alone."""
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
    """Return a few values of a parameter, lowest first: its bounds, or nearer values for missing or far bounds."""
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
