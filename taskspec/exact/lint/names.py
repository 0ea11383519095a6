"""Which names of a spec nothing depends on: words of its expressions, followed from the sections that decide the task."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted
from taskspec.task.task import Task

NAMED = ("parameters", "constants", "definitions", "noise")
ROOTS = (
    "state", "action", "observation", "horizon", "terminal", "discount", "initial", "dynamics", "reward",
    "absorbing_reward", "memory", "expert", "abstraction", "symmetries",
)  # fmt: skip
PROSE = frozenset({"doc", "symbol", "symbols", "message"})
INSTANCE_SEED = "instance_seed"
_WORD = re.compile(r"[^\W\d]\w*")


def unused_names(case: Linted, collector: Collector) -> None:
    """W506: parameters, constants, definitions and noise that nothing depends on."""
    for section, name in unused(case.task):
        what = {"parameters": "parameter", "constants": "constant", "definitions": "definition"}.get(section, "noise")
        collector.add("W506", case.key(section, name), f"nothing uses the {what} '{name}'")


def unused(task: Task) -> list[tuple[str, str]]:
    """Section and written name of everything that no part of the task depends on, in order."""
    data = task.written
    entries = {(section, str(name)): value for section in NAMED for name, value in (data.get(section) or {}).items()}
    entries.pop(("parameters", "require"), None)
    defined = {name.partition("(")[0].strip(): (section, name) for section, name in entries}
    wanted = {word for section in ROOTS for word in _words(data.get(section))}
    wanted |= set(_words((data.get("parameters") or {}).get("require")))
    wanted.add(INSTANCE_SEED)
    followed = _followed(wanted, {word: entries[place] for word, place in defined.items()})
    return [place for word, place in defined.items() if word not in followed]


def mentioned(task: Task, section: str, name: str | None = None) -> set[str]:
    """Every word of a section (or of one of its entries), and of the definitions, constants and noises that it names."""
    value = task.written.get(section)
    if name is not None:
        value = value.get(name) if isinstance(value, dict) else None
    return followed(task, set(_words(value)))


def followed(task: Task, found: set[str]) -> set[str]:
    """Some words, and every word of the definitions, constants and noises that they name."""
    data = task.written
    entries = {
        str(written).partition("(")[0].strip(): inner
        for part in NAMED[1:]
        for written, inner in (data.get(part) or {}).items()
    }
    wanted = set(found)
    _followed(wanted, entries)
    return wanted


def _followed(wanted: set[str], entries: Mapping[str, Any]) -> set[str]:
    """The entries that some words lead to, through other entries; the words found on the way join `wanted`."""
    followed: set[str] = set()
    while fresh := (wanted & entries.keys()) - followed:
        for word in fresh:
            followed.add(word)
            wanted |= set(_words(entries[word])) - {word}
    return followed


def _words(value: Any) -> Iterator[str]:
    """Every word in the expressions of a section, keys included, prose excluded."""
    match value:
        case str():
            yield from _WORD.findall(value)
        case dict():
            for key, inner in value.items():
                if key not in PROSE:
                    yield from _words(str(key))
                    yield from _words(inner)
        case list():
            for inner in value:
                yield from _words(inner)
        case _:
            return
