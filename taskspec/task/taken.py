"""One set of names: what a spec declares twice, or what the language has already given a meaning."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec.diagnostics import Collector, Span
from taskspec.lang.calls import is_function
from taskspec.lang.check import CONSTANTS
from taskspec.source import Path
from taskspec.task.given import article
from taskspec.task.merge import Merged
from taskspec.task.names import signature

_SECTIONS = {
    "parameters": "parameter",
    "constants": "constant",
    "definitions": "definition",
    "noise": "noise",
    "state": "state component",
    "action": "action component",
    "memory": "component of the memory",
}
_RESERVED = {
    "t": "the number of steps taken",
    "T": "the horizon",
    "terminal": "the end of the episode",
    **dict.fromkeys(CONSTANTS, "a constant"),
}


def check_names(merged: Merged, collector: Collector) -> None:
    """Report (E309) every declared name that is taken: by a declaration above it, or by the language."""
    known: dict[str, tuple[str, Span]] = {}
    for path, name, what in _declared(merged):
        place = merged.key_span(path)
        if name in known:
            before, there = known[name]
            where = f"line {there.line}" if there.origin == place.origin else str(there)
            message = f"'{name}' is {article(before)} already, in {where}"
            collector.add("E309", place, message, "every name has one meaning in a spec")
        elif name in _RESERVED:
            collector.add("E309", place, f"'{name}' means {_RESERVED[name]} in every expression; choose another name")
        elif is_function(name):
            collector.add("E309", place, f"'{name}' is a function of the language; choose another name")
        known.setdefault(name, (what, place))


def _declared(merged: Merged) -> Iterator[tuple[Path, str, str]]:
    """Path, name and kind of everything that a spec declares, in the order of the sections."""
    for section, what in _SECTIONS.items():
        for written in merged.data.get(section) or {}:
            if (section, written) != ("parameters", "require"):
                yield (section, written), signature(written)[0], what
    for name, entry in (merged.data.get("parameters") or {}).items():
        if name != "require" and entry.get("alias"):
            yield ("parameters", name, "alias"), entry["alias"], "alias of a parameter"
