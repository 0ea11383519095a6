"""What is left of a document without its mistaken parts, so that one mistake does not hide those of other parts.

A value that is wrong becomes `LEFT_OUT`, or goes with its entry or section where no other part depends on it. What reads a value
that was left out is not reported again.
"""

from __future__ import annotations

import re
from typing import Any, TypeAlias

from taskspec.source import LEFT_OUT, Path
from taskspec.source.scan import EXTENDS, REQUIRED
from taskspec.task.schema.problems import Problem

Data: TypeAlias = dict[str, Any]

_EXPRESSIONS = ("constants", "definitions", "noise", "initial", "dynamics", "observation")
"""Sections of named expressions."""
_TYPED = ("parameters", "state", "action", "memory")
"""Sections of named entries with a type."""
_SINGLE = ("reward", "terminal", "discount", "absorbing_reward", "horizon", "expert")
"""Sections that are one expression."""


def without(data: Data, problem: Problem, first: Data) -> Data | None:
    """Return a spec's data without the part that is wrong; None where nothing can be said of the rest.

    Args:
        first: what stands in place of keys that the file does not have, though none can do without them.
    """
    path = problem.path
    if not path:
        lacking = {key: value for key, value in first.items() if key not in data}
        return data | lacking if lacking and problem.code == "E203" else None
    section = str(path[0])
    if section == "name":
        return data | {"name": first["name"]}
    if section in ("taskspec", "base", "extends"):
        return None
    if section == "variants" and len(path) > 2 and path[2] not in ("base", "extends"):
        variant = data["variants"].get(path[1])
        changed = variant and without(variant, problem._replace(path=path[2:]), first)
        return _changed(data, path[:2], changed) if changed else _dropped(data, path[:2])
    if section == "variants":
        return _dropped(data, path[:2])
    if problem.code == "E202" and len(path) == 1:
        return _completed(_dropped(data, path))
    if problem.code == "E202" and not (section in _TYPED and len(path) == 3 and _decides(problem)):
        return _dropped(data, path)
    if section in (*_EXPRESSIONS, *_TYPED):
        return _without_entry(data, problem)
    if section in _SINGLE:
        value = data.get(section)
        is_mapping = section == "expert" and isinstance(value, dict) and not {"by", "rows"} & set(value)
        return _changed(data, path[:2] if is_mapping else path[:1], LEFT_OUT)
    return _dropped(data, path[:2] if section in ("accept", "symmetries") else path[:1])


def _decides(problem: Problem) -> bool:
    """Return whether an unknown key of a typed entry seems to be meant as one that decides what values there are."""
    keys = (
        ("type", "values", "default") if problem.path[0] == "parameters" else ("type", "values", "shape", "low", "high")
    )
    words = re.findall(r"\w+", problem.hint or "")
    return len(words) < 12 and any(key in words for key in keys)


def _completed(data: Data) -> Data | None:
    """Return a spec's data with something in place of required sections: an unknown key may have been meant as one."""
    given = set(data)
    for variant in _mapping(data.get("variants")).values():
        given |= set(_mapping(variant))
    lacking = [section for section in REQUIRED if section not in given]
    if not lacking or EXTENDS in given:
        return data
    if {"state", "action"} & set(lacking):
        return None
    unknown: Data = {
        "initial": dict.fromkeys(_mapping(data["state"]), LEFT_OUT),
        "dynamics": {},
        "horizon": LEFT_OUT,
        "reward": LEFT_OUT,
    }
    return data | {section: unknown[section] for section in lacking}


def _without_entry(data: Data, problem: Problem) -> Data | None:
    """Return the same for a problem in a section of named entries."""
    path = problem.path
    if len(path) < 2:
        return None  # a section that is no mapping: nobody knows what it names
    entry = path[:2]
    if problem.code == "E205" and len(path) == 2:
        return None  # what names it would be wrong, too
    if problem.code == "E215" or entry in (("parameters", "require"), ("observation", "space")):
        return _dropped(data, entry)
    if path[0] in _EXPRESSIONS:
        return _changed(data, entry, LEFT_OUT)
    known = _mapping(data[str(entry[0])].get(entry[1]))
    if problem.code == "E213":
        return _changed(data, (*entry, "default"), _default(known))
    return _changed(data, entry, _unknown(str(path[0]), known))


def _unknown(section: str, entry: Data) -> Data:
    """Return an entry with a type in place of a wrong one: its labels are known, and nothing else."""
    values = entry.get("values")
    written = values if isinstance(values, list | dict) else ()
    labels = [label for label in written if isinstance(label, str) and label.lower() not in ("", "true", "false")]
    found: Data = {"type": "int", "low": LEFT_OUT}
    if labels:
        found = {"type": "choice", "values": dict.fromkeys(labels, LEFT_OUT)}
    if section == "parameters":
        found["default"] = labels[0] if labels else LEFT_OUT
    if section == "memory":
        found |= {"initial": LEFT_OUT, "next": LEFT_OUT}
    return found


def _default(entry: Data) -> Any:
    """Return a default that a parameter can have, in place of one that it cannot."""
    match entry.get("type"):
        case "choice":
            return next(iter(entry["values"] or ()), None)
        case "bool":
            return False
    ends = [entry[key] for key in ("low", "high") if entry.get(key) is not None]
    return ends[0] if ends else 1


def _mapping(value: Any) -> Data:
    return value if isinstance(value, dict) else {}


def _changed(data: Data, path: Path, value: Any) -> Data:
    """Return data with another value at a path, if it has one there."""
    first, *rest = path
    if first not in _mapping(data):
        return data
    if rest:
        value = _changed(data[str(first)], tuple(rest), value)
    return data | {str(first): value}


def _dropped(data: Data, path: Path) -> Data:
    found: Data = removed(data, path)
    return found


def removed(data: Any, path: Path) -> Any:
    """Return data without what stands at a path."""
    first, *rest = path
    if isinstance(data, list):
        return [removed(item, tuple(rest)) if i == first else item for i, item in enumerate(data)]
    if not isinstance(data, dict) or first not in data:
        return data  # it went with something else
    if not rest:
        return {key: value for key, value in data.items() if key != first}
    return data | {first: removed(data[first], tuple(rest))}
