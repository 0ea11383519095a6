"""A document that has been read: plain data with the place of every value."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from taskspec.base.diagnostics import Origin, Span
from taskspec.language.source.nodes import MappingNode, Node, ScalarNode, SequenceNode, places

Path: TypeAlias = tuple[str | int, ...]
"""Where a value stands in the data: keys of mappings and indices of lists, from the root down."""


EXTENDS = "extends"
"""The section that takes what is left out from another file."""


@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """A YAML text as plain data (`dict`, `list`, `str`, `int`, `float`, `bool`, `None`).

    Scalars follow YAML 1.2's core schema. Keys are always text, exactly as written (`0`, `true` and
    `1e-3` too): they are names, labels or expressions.
    """

    origin: Origin
    data: Any
    _root: Node
    _lines: list[int]
    _places: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    others: Mapping[str, Document] = field(default_factory=dict)
    """The documents that this one extends, by how it names their files."""
    merged: dict[str | None, Any] = field(default_factory=dict, init=False)
    """Its variants, and itself (None), merged into what they are based on, if they were asked for; not kept by `replace`."""

    @property
    def files(self) -> tuple[str, ...]:
        """The names of all documents that this one rests on, without its own."""
        names: list[str] = []
        for other in self.others.values():
            names += (other.origin.name, *other.files)
        return tuple(dict.fromkeys(names))

    def span(self, path: Path, start: int | None = None, end: int | None = None) -> Span:
        """Return the place of a value, or of the characters `start` to `end` of a text's value.

        A path that leads nowhere gives the place of the last value on its way that exists.
        """
        key, node = self._find(path)
        if isinstance(node, ScalarNode) and (start is not None or end is not None):
            return self._between(*self._characters(node, start, end))
        if node.end <= node.start and key is not None:
            return self._between(key.start, key.end)  # nothing is written after this key
        return self._between(node.start, node.end)

    def key_span(self, path: Path) -> Span:
        """Return the place of the key that a path ends with; of the item, when it ends in a list."""
        key, node = self._find(path)
        if key:
            return self._between(key.start, key.end)
        return self._between(node.start, node.end)

    def text(self, path: Path) -> str:
        """Return the text of a scalar as written (`0.10`, `1e-3`), quotes and line folds undone.

        Raises KeyError when there is no scalar at the path.
        """
        _, node = self._find(path, strict=True)
        if not isinstance(node, ScalarNode):
            raise KeyError(path)
        return node.value

    def search(self, word: str) -> tuple[Path, bool, str] | None:
        """Return the path of the first key or value that holds a word, whether it is the key, and its text."""
        stack: list[tuple[Path, Node]] = [((), self._root)]
        while stack:
            path, node = stack.pop()
            match node:
                case ScalarNode() if word in node.value:
                    return path, False, node.value
                case SequenceNode():
                    stack += [((*path, i), item) for i, item in enumerate(node.items)][::-1]
                case MappingNode():
                    for key, _ in node.entries:
                        if word in key.value:
                            return (*path, key.value), True, key.value
                    stack += [((*path, key.value), item) for key, item in node.entries][::-1]
        return None

    def _find(self, path: Path, strict: bool = False) -> tuple[ScalarNode | None, Node]:
        key: ScalarNode | None = None
        node = self._root
        for step in path:
            match node, step:
                case MappingNode(), str() if step in node.index:
                    key, node = node.index[step]
                case SequenceNode(), int() if 0 <= step < len(node.items):
                    key = None
                    node = node.items[step]
                case _ if strict:
                    raise KeyError(path)
                case _:
                    break
        return key, node

    def _characters(self, node: ScalarNode, start: int | None, end: int | None) -> tuple[int, int]:
        """Offsets in the file of a range of a scalar's value; an empty range has an empty place."""
        if id(node) not in self._places:
            self._places[id(node)] = places(self.origin.text, node)
        ranges = self._places[id(node)]
        first = max(0, min(start or 0, len(ranges)))
        last = len(ranges)
        if end is not None:
            last = max(first, min(end, last))
        if first < last:
            return ranges[first][0], ranges[last - 1][1]
        where = node.end
        if first < len(ranges):
            where = ranges[first][0]
        elif ranges:
            where = ranges[-1][1]
        return where, where

    def _between(self, start: int, end: int) -> Span:
        return span(self.origin, self._lines, start, end)


def span(origin: Origin, lines: list[int], start: int, end: int) -> Span:
    line = bisect_right(lines, start)
    end_line = bisect_right(lines, max(start, end))
    column = start - lines[line - 1] + 1
    end_column = max(start, end) - lines[end_line - 1] + 1
    return Span(origin, line, column, end_line, end_column)
