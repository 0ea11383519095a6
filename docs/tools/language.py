"""The tables of the language reference, from those that the compiler runs on."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from docs.tools.markdown import code, entries, filled, table
from taskspec.base import limits
from taskspec.base.diagnostics import SpecError
from taskspec.exact.rules import claim_rules
from taskspec.exact.scores.returns import CLAIMS, NUMBERS
from taskspec.language.expressions.operators import INFIX
from taskspec.language.registry import CAPABILITIES
from taskspec.language.source import read_text
from taskspec.language.source.document import EXTENDS
from taskspec.language.task.build import build
from taskspec.language.task.merge import REQUIRED
from taskspec.language.task.parts import FIGURE_KINDS
from taskspec.language.task.schema.export import json_schema
from taskspec.language.task.spaces import space
from taskspec.language.task.task import Task

PAGE = Path(__file__).parents[1] / "reference" / "language.md"
MARK = re.compile(r"<!-- /(\w+(?: \w+)?) -->")
"""The end of a table: which one it is, and of what."""


def language() -> str:
    """Return `docs/reference/language.md`.

    Raises:
        KeyError: when the page asks for a table that does not exist.
    """
    parts = {}
    for mark in MARK.findall(PAGE.read_text(encoding="utf-8")):
        name, *arguments = mark.split()
        parts[mark] = _TABLES[name](*arguments)
    return filled(PAGE, parts)


# Sections and keys, from the JSON Schema that checks and completes them.

FIRST = ("taskspec", "name")
LAST = ("variants", EXTENDS)
EXPLAINED = {"Component": "Parameter", "Memory": "Component"}
"""Entries, and those explained before them whose keys they share."""


def _sections() -> str:
    """What stands at the top of a spec, in canonical order."""
    spec, extension = (json_schema()["$defs"][kind] for kind in ("Spec", "Extension"))
    properties: dict[str, Any] = {**spec["properties"], EXTENDS: extension["properties"][EXTENDS]}
    middle = [key for key in properties if key not in FIRST + LAST]
    needed = {*spec["required"], *REQUIRED}
    rows = ((key, properties[key]["description"]) for key in (*FIRST, *middle, *LAST))
    return entries((_marked(key, key in needed), text) for key, text in rows)


def _capabilities() -> str:
    return entries(CAPABILITIES.items())


def _marked(key: str, is_needed: bool) -> str:
    return code(key) + (" (required)" if is_needed else "")


def _keys(definition: str) -> str:
    """The keys of one kind of entry; those that are needed come first, those of an entry explained before in one row."""
    definitions = json_schema()["$defs"]
    schema = definitions[definition]
    needed = schema.get("required", ())
    properties: dict[str, Any] = schema["properties"]
    before = EXPLAINED.get(definition, "")
    explained = definitions[before]["properties"] if before else {}
    rows, known = [], []
    for key in sorted(properties, key=lambda key: key not in needed):
        text = properties[key]["description"]
        if key not in needed and key in explained and explained[key]["description"] == text:
            known.append(code(key))
        else:
            rows.append((_marked(key, key in needed), text))
    if known:
        rows.append((", ".join(known), f"As for a {before.lower()}."))
    return entries(rows)


# Expressions.


GRAMMAR = (
    (0, "`x if c else y`", "x where the condition c holds, else y."),
    (7, "`-x`, `+x`", "Negation; identity."),
    (9, "`x[i]`, `f(x)`", "Element, call."),
)
"""Operators that are grammar, with no entry of their own."""


def _operators() -> str:
    """Operators, those that bind alike in one row."""
    levels: dict[int, list[str]] = {}
    written = [(i.precedence, code(i.symbol), i.doc) for i in INFIX.values()]
    for level, symbol, doc in sorted([*written, *GRAMMAR], key=lambda operator: operator[0]):
        levels.setdefault(level, []).append(f"{symbol} {doc}")
    return entries((str(level), " ".join(operators)) for level, operators in levels.items())


# Places.

PLACES = (
    ("`constants`", "constants", '{"k": 2, "c": "@"}'),
    ("`low`, `high`, `shape`", "state", '{"x": {"type": "int", "low": -99, "high": "@"}, "y": {"type": "real"}}'),
    ("`horizon`", "horizon", '"5 + @"'),
    ("`discount`", "discount", '"(@) / 9"'),
    ("`noise`", "noise", '{"n": "UniformInt(0, 1)", "m": "@"}'),
    ("`initial`", "initial", '{"x": 0, "y": "@"}'),
    ("`legal`", "legal", '"(@) == 1"'),
    ("`dynamics`", "dynamics", """{"x'": "x + a", "y'": "@"}"""),
    ("`reward`", "reward", '"@"'),
    ("`measures`", "measures", '{"m": "@"}'),
    ("`terminal`", "terminal", '"(@) == 1"'),
    ("`observation`", "observation", '{"o": "@"}'),
    ("`next` of `memory`", "memory", '{"m": {"type": "real", "initial": 0, "next": "@"}}'),
    ("`expert`", "expert", '{"a": "@"}'),
    ("`absorbing_reward`", "absorbing_reward", '"@"'),
)
NAMES = (
    ("parameters", "L"), ("constants", "k"), ("the state `x`", "x"), ("the action", "a"), ("`x'`", "x'"), ("noise", "n"),
    ("draws", "UniformInt(0, 1)"), ("`t`", "t"), ("`T`", "T"),
)  # fmt: skip


def _visibility() -> str:
    """Which names can be used in which places; places with the same names in one row."""
    alike: dict[str, list[str]] = {}
    for place, section, template in PLACES:
        fits = [_fits(section, template, expression) for _, expression in NAMES]
        alike.setdefault(_named(fits), []).append(place)
    return entries((", ".join(places), names) for names, places in alike.items())


def _named(fits: list[bool]) -> str:
    """Return the kinds of names that fit, or those that do not where they are few."""
    fitting = [name for (name, _), fit in zip(NAMES, fits, strict=True) if fit]
    others = [name for name, _ in NAMES if name not in fitting]
    if not others:
        return "all"
    if len(others) <= 3:
        return f"all but {', '.join(others)}"
    return ", ".join(fitting)


# Spaces.

_CELL = {"type": "int", "low": 0, "high": 4}
_REAL = {"type": "real", "low": 0, "high": 1}
DECLARED: tuple[tuple[str, dict[str, Any]], ...] = (
    ("`{type: int, low: 0, high: 4}`", {"x": _CELL}),
    ("`{type: choice, values: [left, right]}`", {"x": {"type": "choice", "values": ["left", "right"]}}),
    ("two of them, with 5 and 2 values", {"x": _CELL, "y": {"type": "bool"}}),
    ("`{type: int, low: 0, high: 4, shape: [2]}`", {"x": {**_CELL, "shape": [2]}}),
    ("`{type: real, low: 0, high: 1}`", {"x": _REAL}),
    ("`{type: real, low: 0, high: 1, shape: []}`", {"x": {**_REAL, "shape": []}}),
    ("`{type: real, low: 0, high: 1, shape: [3]}`", {"x": {**_REAL, "shape": [3]}}),
)


def _state(components: dict[str, Any]) -> dict[str, Any]:
    first = {name: "left" if c["type"] == "choice" else c.get("low", False) for name, c in components.items()}
    return {"state": components, "initial": first, "dynamics": {"x'": "x"}, "noise": {}}


def _spaces() -> str:
    rows = []
    for words, components in DECLARED:
        action = {f"to_{name}": component for name, component in components.items()}
        observed, acted = _probe_spaces({**_state(components), "action": action})
        rows.append((words, code(observed), code(acted)))
    return table(("declared", "as observation", "as action"), rows)


def _space_kinds() -> str:
    components = {"x": _CELL, "y": {"type": "bool"}}
    kinds = ("box", "multi_discrete", "one_hot", "dict")
    spaces = ((k, {**_state(components), "observation": {"space": k, "x": "x", "y": "y"}}) for k in kinds)
    return table(("`space:`", "observation space"), ((code(k), code(_probe_spaces(s)[0])) for k, s in spaces))


# Visibility and spaces are found out by trying.


PROBE: dict[str, Any] = {
    "taskspec": 1,
    "name": "Probe",
    "parameters": {"L": {"type": "int", "default": 3}},
    "constants": {"k": 2},
    "noise": {"n": "UniformInt(0, 1)"},
    "state": {"x": {"type": "int"}, "y": {"type": "real"}},
    "action": {"a": {"type": "int", "low": 0, "high": 9}},
    "horizon": 5,
    "initial": {"x": 0, "y": 0},
    "dynamics": {"x'": "x + a"},
    "reward": 0,
}


def _task(changes: dict[str, Any]) -> Task:
    """The probe with some sections replaced."""
    return build(read_text(json.dumps(PROBE | changes), "<manual>"))


def _fits(section: str, template: str, expression: str) -> bool:
    """Whether an expression may stand in a place of the probe: `template` is the section with `@` for the expression."""
    try:
        _task({section: json.loads(template.replace("@", expression))})
    except SpecError:
        return False
    return True


def _probe_spaces(changes: dict[str, Any]) -> tuple[str, str]:
    """The observation space and the action space of the probe with some sections replaced."""
    found = _task(changes)
    return str(space(found.observation_layout)), str(space(found.action_layout))


# The rest.


def _limits() -> str:
    return entries((code(row.name), f"{row.value:,} {row.what}") for row in limits.table() if not row.fixed)


def _words(name: str) -> str:
    """One of the tables of what claims may say."""
    words = getattr(claim_rules, name).values()
    return entries((code(w.written), w.doc) for w in words)


def _figures() -> str:
    names: dict[str, list[str]] = {}
    for kind in FIGURE_KINDS.values():
        names.setdefault(kind.doc, []).append(code(kind.name))
    return entries((", ".join(kinds), doc) for doc, kinds in names.items())


def _statuses(which: str) -> str:
    found = CLAIMS.values() if which == "claims" else NUMBERS.values()
    return entries((code(s.word), s.doc + (f" ({s.code})" if s.code else "")) for s in found)


_TABLES: dict[str, Callable[..., str]] = {
    "sections": _sections,
    "capabilities": _capabilities,
    "keys": _keys,
    "operators": _operators,
    "visibility": _visibility,
    "spaces": _spaces,
    "space_kinds": _space_kinds,
    "limits": _limits,
    "words": _words,
    "figures": _figures,
    "statuses": _statuses,
}
