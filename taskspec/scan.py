"""The names, variants and version of a spec, read from its lines without parsing it: what registration needs, in microseconds.

Understands specs laid out in block style, as all shipped ones are; anything else is parsed in full.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

REQUIRED = ("state", "action", "initial", "dynamics", "reward", "horizon")
"""Sections without which a spec, or a variant of it, is not a task."""

_TOP = re.compile(r"([\w-]+):(?:\s+(.*?))?\s*$")
_NESTED = re.compile(r"( +)(?:([\w-]+)|\"([^\"]+)\"|'([^']+)'):(?:\s+(.*?))?\s*$")


@dataclass(frozen=True, slots=True)
class Scanned:
    """Task names with their variant (None for the spec itself), complete ones only, in written order."""

    version: int
    tasks: tuple[tuple[str, str | None], ...]


def scan(text: str) -> Scanned:
    """The tasks of a spec's text."""
    top: dict[str, str] = {}
    variants: dict[str, dict[str, str]] = {}
    section, indents = "", [0, 0]
    for line in text.splitlines():
        found = _TOP.match(line)
        if found:
            section = found[1]
            top[section] = _value(found[2])
            indents = [0, 0]
        elif section == "variants" and line.strip() and not line.lstrip().startswith("#"):
            _nested(line, variants, indents)
    if "name" not in top or top.get("variants", "").startswith("{"):
        return _parsed(text)
    return _collect(top["name"], top.get("version", "0"), set(top), variants)


def _value(text: str | None) -> str:
    """A plain scalar without its comment and quotes."""
    return (text or "").split(" #")[0].strip().strip("'\"")


def _nested(line: str, variants: dict[str, dict[str, str]], indents: list[int]) -> None:
    """A line below `variants:`: the name of a variant, or a section of the last one."""
    found = _NESTED.match(line)
    if not found:
        return
    depth, key = len(found[1]), found[2] or found[3] or found[4]
    indents[0] = indents[0] or depth
    if depth == indents[0]:
        variants[key] = {}
        indents[1] = 0
    elif variants and (not indents[1] or depth == indents[1]):
        indents[1] = depth
        variants[list(variants)[-1]][key] = _value(found[5])


def _collect(name: str, version: str, sections: set[str], variants: dict[str, dict[str, str]]) -> Scanned:
    tasks: list[tuple[str, str | None]] = [(name, None)] if sections.issuperset(REQUIRED) else []
    for key in variants:
        if _complete(key, sections, variants, set()):
            tasks.append((task_name(name, key), key))
    return Scanned(int(version) if version.isdigit() else 0, tuple(tasks))


def _complete(key: str, sections: set[str], variants: dict[str, dict[str, str]], seen: set[str]) -> bool:
    """Whether a variant has every required section, itself or from what it is based on."""
    have, current = set(sections), key
    while current in variants and current not in seen:
        seen.add(current)
        own = variants[current]
        have |= {s for s in own if s != "base"}
        current = own.get("base", "")
    return have.issuperset(REQUIRED)


def task_name(name: str, variant: str) -> str:
    """The name of a variant's task: the key itself when it starts with the task's name, else the two run together."""
    return variant if variant.startswith(name) else name + variant[:1].upper() + variant[1:]


def _parsed(text: str) -> Scanned:
    """The same from a full reading; raises SpecError where the text is no spec."""
    from taskspec.source import read_text

    data = read_text(text).data
    if not isinstance(data, dict):
        return Scanned(0, ())
    variants = {
        str(k): {s: str(v.get("base", "")) if s == "base" else "" for s in v}
        for k, v in (data.get("variants") or {}).items()
        if isinstance(v, dict)
    }
    return _collect(str(data.get("name", "")), str(data.get("version", 0)), set(data), variants)
