"""Soundness: whether the equations of a spec define a task, decided for all points or tested on samples.

A finite task is checked in every declared state, for every action, at every time that matters and for every outcome of its
draws, whether an episode gets there or not: dynamics are total. One exception: a state that can only be entered by a step which
ends the episode needs no dynamics. If the domain is infinite or too large, interval arithmetic is tried first; then points of
episodes, where a failure is an error, and samples of the declared domain, where it is a warning (W526).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Collector, Diagnostic, Placed, SpecError
from taskspec.base.display import plural
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
from taskspec.language.task.build import bound_parameters, build
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
MOST_SETTINGS = 64
FORBIDDEN = frozenset({"E703", "E704", "E720"})
"""Codes for parameter values that the spec, or a modifier of the task, does not allow."""
REFUSED = FORBIDDEN | {"E314"}


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
    """Check a task at the ends of the declared ranges of its parameters.

    Every parameter goes to its ends alone, then all together, though not further than a few times the default. In place of
    an int that a `require` forbids comes the nearest one that it allows, in place of one that is too large a few times the
    default; W529 says so. All this together reads about as many expressions as one task may have.

    Args:
        task: a task at its defaults, or at other values from which the rest are tried.
        beside: gives further problems of a setting at which the task is sound.
    """
    task = load(task)
    trials = _Trials(task, beside)
    every = settings(task)
    for ends in every[:MOST_SETTINGS]:
        trials.add(ends)
    cases = tuple(trials.tried.values())
    untried = len(every[MOST_SETTINGS:])
    for values in trials.wanted:
        untried += not any(values.items() <= (task.values | case).items() for case in (*cases, {}))
    return Ranges(trials.diagnostics(), cases, untried)


@dataclass(frozen=True, slots=True)
class Ends:
    """Values of one or more parameters to try, and those to try where they are too large."""

    values: dict[str, Any]
    nearer: dict[str, Any]


class _Trials:
    """Settings of a task that are tried, and those that should be."""

    def __init__(self, task: Task, beside: Callable[[Task], Sequence[Diagnostic]] | None) -> None:
        self.tried: dict[str, dict[str, Any]] = {}
        self.wanted: list[dict[str, Any]] = []
        self._task = task
        self._beside = beside
        self._left = limits().expressions
        self._large: list[tuple[dict[str, Any], Diagnostic]] = []
        self._wrong: list[Diagnostic] = []
        self._further: list[Diagnostic] = []

    def add(self, ends: Ends) -> None:
        values = ends.values
        refusal = self._try(values)
        if refusal is not None and refusal.code in FORBIDDEN:
            values = self._nearest(values) or values
            refusal = self._try(values)
        self.wanted.append(values)
        if refusal is not None and refusal.code not in FORBIDDEN:
            self._large.append((values, refusal))
            self._try(ends.nearer)

    def diagnostics(self) -> tuple[Diagnostic, ...]:
        large = []
        if self._large:
            values, refusal = self._large[0]
            where = ", ".join(f"{name} = {words(value)}" for name, value in values.items())
            others = len(self._large) - 1
            if others:
                where += f" and {plural(others, 'other setting')}"
            source = self._task.source
            place = merge(source.document, source.variant).key_span(("parameters", next(iter(values))))
            large.append(Diagnostic("W529", place, f"this is not checked at {where}: {refusal.message}", refusal.hint))
        return (*_new(self._wrong, self._task), *self._further, *large)

    def _try(self, values: dict[str, Any]) -> Diagnostic | None:
        """Examine the task at some values, if it was not; return why the values are forbidden, or too large."""
        source = self._task.source
        changed = {name: value for name, value in values.items() if value != self._task.values[name]}
        if not changed or repr(changed) in self.tried:
            return None
        given = self._task.given | changed
        note = parameters(given)
        try:
            with also(f"expressions={self._left}"):
                unmodified = build(source.document, source.variant, given, source.suite)
                other = modify(unmodified, *self._task.modifiers)
        except TooManyExpressions as error:
            self._left //= 2
            most = limits().expressions
            message = f"all settings together have more than {most:,} expressions"
            return replace(error.diagnostics[0], message=message, hint=how_to_raise("expressions", 10 * most))
        except SpecError as error:
            if REFUSED.issuperset(error.codes):
                return error.diagnostics[0]
            self._wrong += [_noted(d, note) for d in error.diagnostics]
            return None
        self._left -= other.source.surface.expressions
        self.tried[repr(changed)] = given
        diagnostics = examine(other, RANGE_POINTS).diagnostics
        self._wrong += diagnostics
        if self._beside is not None and all(d.severity != "error" for d in diagnostics):
            self._further += [_noted(d, note) for d in self._beside(other)]
        return None

    def _nearest(self, values: dict[str, Any]) -> dict[str, Any]:
        """Move one parameter after the other as far towards forbidden values as is allowed; ints part of the way."""
        moved: dict[str, Any] = {}
        for name, forbidden in values.items():
            if self._is_allowed(moved | {name: forbidden}):
                moved[name] = forbidden
            elif type(forbidden) is int:
                allowed = self._task.values[name]
                while abs(forbidden - allowed) > 1:
                    middle = (allowed + forbidden) // 2
                    if self._is_allowed(moved | {name: middle}):
                        allowed = middle
                    else:
                        forbidden = middle
                moved[name] = allowed
        return moved

    def _is_allowed(self, values: dict[str, Any]) -> bool:
        source = self._task.source
        self._left = max(0, self._left - source.surface.expressions)
        if not self._left:
            return False
        try:
            bound_parameters(source.document, source.variant, self._task.given | values)
        except SpecError as error:
            return not FORBIDDEN.issuperset(error.codes)
        return True


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


def settings(task: Task) -> list[Ends]:
    """List the settings to try: the ends of each range alone, then all low and all high."""
    alone = []
    lowest = {}
    highest = {}
    for p in task.parameters:
        ends = _ends(p)
        for end, nearer in ends:
            if end != task.values[p.name]:
                alone.append(Ends({p.name: end}, {p.name: nearer}))
        if ends:
            lowest[p.name] = ends[0][1]
            highest[p.name] = ends[-1][1]
    every = [*alone, Ends(lowest, lowest), Ends(highest, highest)]
    return list({repr(setting.values): setting for setting in every}.values())


def _ends(p: Parameter) -> list[tuple[Any, Any]]:
    """Return the ends of a parameter, lowest first, each with a value towards it that is a few times the default at most."""
    if p.kind in ("bool", "choice"):
        return [(value, value) for value in p.values or (False, True)]
    low, high = p.ends
    kind: Callable[[Any], Any] = float
    far = 4 * abs(p.default) + 1
    if p.kind == "int":
        kind = int
        far = 2 * abs(p.default) + 3
    ends = []
    for end, near in ((low, max(p.default - far, low)), (high, min(p.default + far, high))):
        if math.isfinite(end):
            ends.append((kind(end), kind(near)))
        elif p.kind == "int":
            ends.append((near, near))
    return ends
