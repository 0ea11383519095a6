"""The names, variants and version of a spec, read from its lines without parsing it: what registration needs, in microseconds.

Understands specs laid out in block style, as all shipped ones are; a text with a line that it does not is parsed in full.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeAlias, cast

from taskspec.language.source.document import EXTENDS as EXTENDS

REQUIRED = ("state", "action", "initial", "dynamics", "reward", "horizon")
"""Sections without which a spec, or a variant of it, is not a task."""

_AT_MARGIN = re.compile(r"\n([^ \t#\r\n].*)")
"""A line that is not indented, in a text that begins with a line break: without one, the search takes four times as long."""
_NOTHING = re.compile(r"\s*(?:#.*)?$")
_COMMENT = re.compile(r"(?:^|\s)#.*$")
_CLOSED = {"{": "}", "[": "]", '"': '"', "'": "'"}
"""How a value that ends on its line ends, by how it begins; any other may go on at the margin."""


Kind: TypeAlias = Literal["taskspec", "experiment", "exam", "findings"]
"""What a YAML file holds, by the key that says so: a spec, or something that goes with specs."""
_OTHERS = re.compile(r"\n(experiment|exam|findings) *:")


def kind(text: str) -> Kind:
    """Return what a file's text is; a spec unless it says otherwise."""
    found = _OTHERS.search("\n" + text)
    if found:
        return cast(Kind, found[1])
    return "taskspec"


@dataclass(frozen=True, slots=True)
class Scanned:
    """Task names with their variant (None for the spec itself, unless it leaves sections to them), in written order."""

    version: int
    tasks: tuple[tuple[str, str | None], ...]


class _UnclearError(Exception):
    """A line that only a YAML reader can tell the meaning of."""


def scan(text: str) -> Scanned:
    """Return the tasks of a spec's text; raises SpecError where that needs a YAML reader, and the text is no YAML."""
    try:
        return _scanned(text)
    except _UnclearError:
        return _parsed(text)


def _scanned(text: str) -> Scanned:
    text = "\n" + text
    top: dict[str, str] = {}
    variants: list[str] = []
    lines = list(_AT_MARGIN.finditer(text))
    ends = [line.start() for line in lines[1:]]
    ends.append(len(text))
    for line, end in zip(lines, ends, strict=True):
        section, value = _entry(line[1])
        top[section] = value
        if end < len(text) and not _is_whole(value):
            raise _UnclearError
        if section == "variants":
            variants = _keys(text[line.end() : end])
    if top.get("variants") or not top.get("version", "0").isdecimal():
        raise _UnclearError
    return _collected(_word(top.get("name", "")), int(top.get("version", "0")), top, variants)


def _keys(block: str) -> list[str]:
    """Return the keys of a mapping in block style, whose lines are indented."""
    keys = []
    lines = [line for line in block.splitlines() if not _NOTHING.match(line)]
    indent = min((len(line) - len(line.lstrip(" ")) for line in lines[:1]), default=0)
    for line in lines:
        if line[indent : indent + 1] != " ":
            key, value = _entry(line.lstrip(" "))
            if not _is_whole(value):
                raise _UnclearError
            keys.append(key)
    return keys


def _entry(line: str) -> tuple[str, str]:
    """Key and value of a line, the comment behind them left out."""
    key, colon, value = line.partition(":")
    if not colon or not key.isidentifier() or value[:1].strip():
        raise _UnclearError
    if "#" in value:
        value = _COMMENT.sub("", value)
    return key, value.strip()


def _is_whole(value: str) -> bool:
    return value[-1:] == _CLOSED.get(value[:1], value[-1:]) and value not in _CLOSED


def _word(value: str) -> str:
    """Return a name, which may stand in quotes."""
    name = value[1:-1] if value[:1] in ("'", '"') else value
    if not name.isidentifier():
        raise _UnclearError
    return name


def _collected(name: str, version: int, sections: Iterable[str], variants: Iterable[str]) -> Scanned:
    """Return the spec itself, unless it leaves sections to its variants, and every variant."""
    found = set(sections)
    is_task = found.issuperset(REQUIRED) or EXTENDS in found
    tasks: list[tuple[str, str | None]] = [(name, None)] if is_task else []
    return Scanned(version, (*tasks, *((task_name(name, key), key) for key in variants)))


def task_name(name: str, variant: str) -> str:
    """Return the name of a variant's task: the key itself when it starts with the task's name, else the two run together."""
    if variant.startswith(name):
        return variant
    return name + variant[:1].upper() + variant[1:]


def _parsed(text: str) -> Scanned:
    """Return the same from a full reading; raises SpecError where the text is no spec."""
    from taskspec.language.source import read_text

    data = read_text(text).data
    if not isinstance(data, dict):
        return Scanned(0, ())
    variants = data.get("variants")
    version = data.get("version")
    named = list(map(str, variants)) if isinstance(variants, dict) else []
    whole = version if isinstance(version, int) and version >= 0 else 0
    return _collected(str(data.get("name", "")), int(whole), map(str, data), named)
