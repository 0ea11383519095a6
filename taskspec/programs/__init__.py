"""Programs that tasks run as, generated for one backend each.

Here are pieces of generated source for all backends: names, numbers, tuples, lines; and how a generated module is run.
"""

from __future__ import annotations

import linecache
import re
from collections.abc import Iterable, Sequence
from typing import Any

from taskspec.language.task.parts import Component

_NAMES = re.compile(r"[A-Za-z_]\w*")
_ASSIGNED = re.compile(r"(v\d+) = ")


def names_of(prefix: str, components: Sequence[Component]) -> list[str]:
    names = []
    for i, c in enumerate(components):
        if c.name.isascii():
            names.append(f"{prefix}_{c.name}")
        else:
            names.append(f"{prefix}_{i}")
    return names


def indent(lines: Iterable[str]) -> list[str]:
    return [f"    {line}" if line else "" for line in lines]


def without_unused(lines: Sequence[str], results: Iterable[str]) -> list[str]:
    """Drop assignments that nothing reads."""
    used = set(_NAMES.findall(" ".join(results)))
    kept: list[str] = []
    for line in reversed(lines):
        target = _ASSIGNED.match(line)
        if target is None or target[1] in used:
            used.update(_NAMES.findall(line))
            kept.append(line)
    return kept[::-1]


def literal(value: bool | int | float) -> str:
    """Write a number as source; nan and the infinities go by name."""
    if value < 0:
        return f"({value!r})"
    return repr(value)


def tuple_of(items: Sequence[str]) -> str:
    return f"({', '.join(items)}{',' * (len(items) == 1)})"


def run(source: str, file: str, namespace: dict[str, Any]) -> None:
    """Run a generated module, which tracebacks and debuggers then show under the name of a file."""
    exec(compile(source, file, "exec"), namespace)  # noqa: S102  # generated from checked nodes, never from a spec's text
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
