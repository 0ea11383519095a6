"""Worked examples as surface syntax: names are checked when a task is built, values when the example is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

from taskspec.diagnostics import suggest
from taskspec.lang import syntax as s
from taskspec.lang.ir import Role
from taskspec.limits import how_to_raise, limits
from taskspec.source import Path
from taskspec.task import grids
from taskspec.task.context import Context
from taskspec.task.task import Example, Followed

SCOPE = "examples"
_GIVEN = {"state": (Role.STATE, "given state"), "action": (Role.ACTION, "action")}
"""Keys that say what is given, and whose names they have: those of a state are names of the expert's memory as well."""
_BY_NAME = {"initial": "state", "next": "state", "observation": "observation", "expert": "action"}
"""Keys that say what follows name by name, and the section that has the names."""
_SINGLE = ("reward", "terminal", "truncated")


def read_examples(context: Context) -> Iterator[Example]:
    """The examples of a spec; mistakes go to the collector."""
    context.named_scopes[SCOPE] = context.constant_scope()
    for i, entry in enumerate(context.data.get("examples") or ()):
        yield _example(context, entry, ("examples", i))


def _example(context: Context, entry: Mapping[str, Any], path: Path) -> Example:
    given = {
        (role, name): expr
        for key, (role, section) in _GIVEN.items()
        for name, expr in _named(context, entry, key, section, path)
    }
    follows = [
        Followed(key, name, expr)
        for key, section in _BY_NAME.items()
        for name, expr in _named(context, entry, key, section, path)
    ]
    for key in _SINGLE:
        expr = context.forms.expr((*path, key)) if entry.get(key) is not None else None
        follows += [] if expr is None else [Followed(key, None, expr)]
    chance = context.forms.expr((*path, "probability")) if entry.get("probability") is not None else None
    most = limits().claims
    if (number := grids.size(entry.get("for"))) > most:
        message = f"{number:,} choices of parameter values are too many; the limit is {most:,}"
        context.collector.add("E314", context.merged.key_span((*path, "for")), message, how_to_raise("claims", number))
    cases = tuple(islice(grids.cases(entry.get("for")), most))
    return Example(context.forms.place(path), given, tuple(follows), int(entry.get("t") or 0), chance, cases)


def _named(
    context: Context, entry: Mapping[str, Any], key: str, section: str, path: Path
) -> Iterator[tuple[str, s.Expr]]:
    """The entries of one key of an example, those that are well-formed and name something there is."""
    known = _names(context, section)
    for name in entry.get(key) or {}:
        here = (*path, key, name)
        if name not in known:
            what = {"observation": "observation", "action": "action component"}.get(section, "state component")
            hint = suggest(name, known) or f"there are: {', '.join(known)}"
            context.collector.add("E216", context.merged.key_span(here), f"there is no {what} '{name}'", hint)
        elif (expr := context.forms.expr(here)) is not None:
            yield name, expr


def _names(context: Context, section: str) -> Sequence[str]:
    if section == "observation" and context.data.get("observation"):
        return [name for name in context.data["observation"] if name != "space"]
    if section == "given state":
        return [c.name for c in (*context.state, *context.memory)]
    return [c.name for c in (context.action if section == "action" else context.state)]
