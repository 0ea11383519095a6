"""Pieces of generated source: numbers, tuples, and statements that turned out not to be needed."""

from __future__ import annotations

import linecache
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

_NAMES = re.compile(r"[A-Za-z_]\w*")
_ASSIGNED = re.compile(r"(v\d+) = ")


def without_unused(lines: Sequence[str], results: Iterable[str]) -> list[str]:
    """Return the statements without assignments that nothing reads."""
    used = set(_NAMES.findall(" ".join(results)))
    kept: list[str] = []
    for line in reversed(lines):
        target = _ASSIGNED.match(line)
        if target is None or target[1] in used:
            used.update(_NAMES.findall(line))
            kept.append(line)
    return kept[::-1]


def literal(value: bool | int | float) -> str:
    """Return a number as source; nan and the infinities go by name."""
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if value != value else "inf" if value > 0 else "(-inf)"
    return repr(value) if value >= 0 else f"({value!r})"


def tuple_of(items: Sequence[str]) -> str:
    return f"({', '.join(items)}{',' * (len(items) == 1)})"


def run(source: str, file: str, namespace: dict[str, Any]) -> None:
    """Run a generated module, which tracebacks and debuggers then show under the name of a file."""
    exec(compile(source, file, "exec"), namespace)  # noqa: S102  # generated from checked nodes, never from a spec's text
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
