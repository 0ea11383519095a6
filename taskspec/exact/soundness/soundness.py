"""Soundness: whether the equations of a spec define a task, decided for all points or tested on samples.

A finite task is checked in every declared state, for every action, at every time that matters and for every outcome of its
draws, whether an episode gets there or not: dynamics are total. One exception: a state that can only be entered by a step which
ends the episode needs no dynamics. If the domain is infinite or too large, interval arithmetic is tried first; then points of
episodes, where a failure is an error, and samples of the declared domain, where it is a warning (W526).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Collector, Diagnostic, Placed, SpecError
from taskspec.base.limits import also, how_to_raise, limits, tell
from taskspec.exact.model.extract import number_words, outside_domain
from taskspec.exact.model.points import Method
from taskspec.exact.model.space import Reads, domain, shown, words
from taskspec.exact.soundness.phases import Check, Examination, Violation, entries, phases
from taskspec.exact.soundness.places import SectionScope, narrow
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.check import TooManyExpressions
from taskspec.language.expressions.ir import reads
from taskspec.language.expressions.types import TIME, Role
from taskspec.language.modifiers import modify
from taskspec.language.registry import load
from taskspec.language.task.build import build
from taskspec.language.task.merge import merge
from taskspec.language.task.parts import Component, Parameter
from taskspec.language.task.task import Task, TaskLike

_HINTS = {
    "E403": "widen the bounds, stop at them with `clip`, or end the episode earlier",
    "E402": "a probability lies between 0 and 1",
}
_SAID = {"E412": "no action is legal", "E413": "the expert chooses an illegal action"}
_SUBJECTS = {"E403": "the next {} is", "E404": "{} starts at", "E409": "the expert's {} is"}


# -- counterexamples in words ---------------------------------------------------------------------


def report(violation: Violation, task: Task, collector: Collector) -> None:
    """Report a violation: an error if episodes may reach it, a warning if that is unknown."""
    check = violation.check
    place: Placed | None = None
    hint = _HINTS.get(check.code)
    if check.place is not None:
        place = check.place.place
    else:  # the place of the smallest expression that gives the value
        for name, expr in entries(task, check.section):
            if name in (check.entry, None):
                part = narrow(expr, SectionScope(task, check.section), violation.reads)
                place = part.place
                if isinstance(part, s.Call) and part.function == "clip":
                    hint = "`clip(x, low, high)` has the value first, then the bounds that it keeps to"
                break
    message = f"{_where(violation, task)}{_what(violation)}"
    notes = []
    if task.parameters:
        notes.append(parameters(task.values))
    if check.section == "noise":
        notes.append(
            f"a noise is drawn in every step, even where nothing uses it: give `{check.entry}` a value there, "
            f"`{check.entry}: ... if CONDITION else VALUE`, or write the draw where it is used"
        )
    if violation.acting is None:
        notes.append("no tested episode visited this state; without an exact model, it is unknown whether any can")
        hint = f"if no episode gets there, say so: narrow the bounds of the state, or accept W526; otherwise it is {check.code}"
        collector.add("W526", place, message, hint, notes)
        return
    if violation.acting is False:
        notes.append("no episode takes an action in this state, but it is a declared state")
    collector.add(check.code, place, message, hint, notes)


def _where(violation: Violation, task: Task) -> str:
    """Components that the value depends on, as `from s = 20 with a = 1, `; the whole state if it is short."""
    check = violation.check
    is_step = check.section == "dynamics"
    needed = reads((check.node, *check.guards))
    of_state = "in"
    if is_step:
        of_state = "from"
    parts = []
    for role, components, word in ((Role.STATE, task.state, of_state), (Role.ACTION, task.action, "with")):
        is_short = is_step and len(components) == 1 and components[0].type.size <= 4
        named = [c for c in components if is_short or (role, c.name) in needed]
        values = in_words(named, role, violation.reads)
        if values:
            parts.append(f"{word} {values}")
    if TIME in needed & violation.reads.keys():
        parts.append(f"at t = {int(violation.reads[TIME].reshape(-1)[0])}")
    if not parts:
        return ""
    return " ".join(parts) + ", "


def in_words(components: Iterable[Component], role: Role, values: Reads) -> str:
    """Write values of components at the first of some points in words, as `x = 2, y = 0`."""
    known = [c for c in components if (role, c.name) in values]
    return ", ".join(f"{c.name} = {shown(c, values[role, c.name][..., 0])}" for c in known)


def _what(violation: Violation) -> str:
    check = violation.check
    value = violation.value[..., 0]
    c = check.subject
    if check.code in _SAID:
        return _SAID[check.code]
    if c is None:
        return f"{check.what} is {words(value.tolist())}{_limits(check)}"
    lead = f"{_SUBJECTS.get(check.code, '{} is').format(c.name)} {shown(c, value)}"
    if value.dtype.kind == "f" and not np.isfinite(value).all():
        return f"{lead}, which is not a finite number"
    if len(set(c.low)) == 1 and len(set(c.high)) == 1:
        return f"{lead}; it must be {domain(c)}"
    flat = value.ravel()
    wrong = (flat < np.array(c.low)) | (flat > np.array(c.high))
    i = int(wrong.argmax())
    index = ", ".join(map(str, np.unravel_index(i, value.shape)))
    return f"{lead}; {c.name}[{index}] must be between {words(c.low[i])} and {words(c.high[i])}"


def _limits(check: Check) -> str:
    low = check.low[0]
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
            return f"; it must be finite (between {low:g} and {check.high[0]:g})"


def parameters(values: Mapping[str, Any]) -> str:
    """Return the note with the parameter values of a problem."""
    return "parameters: " + ", ".join(f"{name} = {words(value)}" for name, value in values.items())


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
    """Check that the equations define a task, for its present parameters.

    Args:
        task: the task, its id or its path.
        limit: steps (state, action, time, outcome) up to which all are checked, rather than samples; None is the usual limit.

    Returns:
        every problem with a counterexample, and the method: all points, or samples.

    Raises:
        SpecError: there is no such task, or it has a mistake of form.
    """
    tell("soundness")
    task = load(task)
    if limit is None:
        limit = limits().points
    collector = Collector()
    methods = []
    for phase in phases(task, limit):
        examination = Examination(phase)
        violations = list(examination.violations())
        drawn = set()
        for violation in violations:
            if violation.check.place is not None:
                drawn.add((violation.check.section, violation.check.entry))
        for violation in violations:
            check = violation.check
            if check.place is not None or (check.section, check.entry) not in drawn:  # one mistake, one message
                report(violation, phase.task, collector)
        methods.append(examination.method)
    number = outside_domain(task)
    if number is not None:
        section, value = number
        places = [expr.place for _, expr in entries(task, section)]
        size = "close to 0"
        if value > 1:
            size = "large"
        message = f"the {section} has the number {number_words(value)}, which is too {size}"
        collector.add("E411", next(iter(places), None), message, "choose another unit, or write 0")
    return Soundness(collector.diagnostics, Method.joined(methods))


def soundness(task: TaskLike) -> list[Diagnostic]:
    """List every problem of a task for its present parameters, each with a counterexample.

    Args:
        task: the task, its id or its path.
    """
    return list(examine(task).diagnostics)


# -- other parameters ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Ranges:
    """Soundness over declared ranges of parameters: the cases tried, the first case of each problem, and how many are left."""

    diagnostics: tuple[Diagnostic, ...] = ()
    cases: tuple[Mapping[str, Any], ...] = ()
    untried: int = 0


def check_ranges(task: TaskLike, beside: Callable[[Task], Sequence[Diagnostic]] | None = None) -> Ranges:
    """Check a task at corners of the declared ranges of its parameters and between them.

    Every parameter goes to its ends alone, then all together; a range without an end, or with a far
    one, is tried up to a few times the default. Values that a `require` forbids are passed over. No more are tried
    once their builds together would read more than a fifth of the expressions that one task may have; W529 says how many.

    Args:
        task: a task at its defaults, or at other values from which the rest are tried.
        beside: gives further problems of a setting at which the task is sound.
    """
    task = load(task)
    others = cases(task)
    wrong: list[Diagnostic] = []
    further: list[Diagnostic] = []
    tried = []
    untried = 0
    left = limits().expressions // SHARE
    for number, values in enumerate(others):
        note = parameters(values)
        try:
            with also(f"expressions={left}"):
                unmodified = build(task.source.document, task.source.variant, values, task.source.suite)
                other = modify(unmodified, *task.modifiers)
        except TooManyExpressions:
            untried = len(others) - number
            most = limits().expressions
            together = f"all together have more than {most // SHARE:,} expressions"
            message = f"{number} of {len(others)} other settings are checked: {together}"
            place = merge(task.source.document, task.source.variant).key_span(("parameters",))
            further.append(Diagnostic("W529", place, message, how_to_raise("expressions", 10 * most)))
            break
        except SpecError as error:
            wrong += [_noted(d, note) for d in error.diagnostics if d.code not in FORBIDDEN]
            continue
        left -= other.source.surface.expressions
        tried.append(values)
        diagnostics = examine(other, RANGE_POINTS).diagnostics
        wrong += diagnostics
        if beside is not None and all(d.severity != "error" for d in diagnostics):
            further += [_noted(d, note) for d in beside(other)]
    return Ranges((*_new(wrong, task), *further), tuple(tried), untried)


def _noted(diagnostic: Diagnostic, note: str) -> Diagnostic:
    return replace(diagnostic, notes=(*diagnostic.notes, note))


def _new(diagnostics: Sequence[Diagnostic], task: Task) -> list[Diagnostic]:
    if not diagnostics:
        return []
    known = {(d.code, d.span) for d in examine(task, RANGE_POINTS).diagnostics}
    fresh = []
    for diagnostic in diagnostics:
        if (diagnostic.code, diagnostic.span) not in known:
            known.add((diagnostic.code, diagnostic.span))
            fresh.append(diagnostic)
    return fresh


def cases(task: Task) -> list[dict[str, Any]]:
    """Return parameter values to try: all low, all high, then the ends of each range alone."""
    ends = {p.name: _ends(p) for p in task.parameters if _ends(p)}
    lowest = {name: values[0] for name, values in ends.items()}
    highest = {name: values[-1] for name, values in ends.items()}
    tried: list[dict[str, Any]] = [lowest, highest]
    for name, values in ends.items():
        tried += [{name: value} for value in values]
    distinct: dict[str, dict[str, Any]] = {}
    for case in tried:
        changed = {name: value for name, value in case.items() if value != task.values[name]}
        if changed:
            distinct.setdefault(repr(changed), task.given | changed)
    return list(distinct.values())[:MAX_CASES]


def _ends(p: Parameter) -> list[Any]:
    """Return a few values of a parameter, lowest first: its bounds, or nearer values for missing or far bounds."""
    if p.kind == "bool":
        return [False, True]
    if p.kind == "choice":
        return list(p.values or ())
    if p.kind == "int":
        far = 2 * abs(int(p.default)) + 3
        return sorted({int(max(p.default - far, p.ends[0])), int(min(p.default + far, p.ends[1]))})
    reach = 4 * abs(float(p.default)) + 1
    ends = []
    if p.low is not None:
        ends.append(max(float(p.low), float(p.default) - reach))
    if p.high is not None:
        ends.append(min(float(p.high), float(p.default) + reach))
    return sorted(ends)
