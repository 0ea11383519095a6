"""Counterexamples in words: where the task was, what was done, what came of it, and what would have been allowed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector, Placed
from taskspec.exact.checks.check import Check
from taskspec.exact.checks.examine import Examination, Violation
from taskspec.exact.checks.phases import entries
from taskspec.exact.checks.places import SectionScope, narrow
from taskspec.exact.model.space import domain, shown, words
from taskspec.lang.ir import Role, reads
from taskspec.task.task import Component, Task

Array = np.ndarray[Any, Any]
_HINTS = {
    "E403": "widen the bounds, stop at them with `clip`, or end the episode earlier",
    "E402": "a probability lies between 0 and 1",
}


def report(violation: Violation, examination: Examination, collector: Collector) -> None:
    """Add a violation to the diagnostics: an error where episodes may be, else a warning, as that may be nowhere."""
    check, task = violation.check, examination.task
    message, place = f"{_where(violation, task)}{_what(violation)}", _place(violation, task)
    if violation.acting is None:
        hint = f"if no episode gets there, say so: narrow the bounds of the state, or accept W526; otherwise it is {check.code}"
        collector.add("W526", place, message, hint, _notes(violation, task))
    else:
        collector.add(check.code, place, message, _HINTS.get(check.code), _notes(violation, task))


def _where(violation: Violation, task: Task) -> str:
    """`from s = 20 with a = 1, `: what the value depends on; of a step that is short to tell, everything."""
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
    check, value = violation.check, violation.value[..., 0]
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
    """The first element that is out of bounds of its own: its index and its bounds."""
    wrong = [not low <= v <= high for v, low, high in zip(value.ravel().tolist(), c.low, c.high, strict=True)]
    i = wrong.index(True) if True in wrong else 0
    index = ", ".join(str(k) for k in np.unravel_index(i, value.shape))
    return index, c.low[i], c.high[i]


def _number(value: Array) -> str:
    return words(np.asarray(value).tolist())


def _limits(check: Check) -> str:
    low, high = check.low[0], check.high[0]
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
    """The note that says for which parameter values something was found."""
    return "parameters: " + ", ".join(f"{name} = {words(value)}" for name, value in values.items())


def _place(violation: Violation, task: Task) -> Placed | None:
    """The smallest part of what the author wrote that gives the value."""
    check = violation.check
    if check.place is not None:
        return check.place.place
    found = [(name, expr) for name, expr in entries(task, check.section) if name in (check.entry, None)]
    if not found:
        return None
    return narrow(found[0][1], SectionScope(task, check.section), violation.reads).place
