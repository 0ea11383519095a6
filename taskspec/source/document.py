"""A document that has been read: plain data with the place of every value, and the files that it extends."""

from __future__ import annotations

import os
import pathlib
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace
from typing import Any, TypeAlias

from taskspec.base.diagnostics import Diagnostic, Origin, Span, SpecError
from taskspec.base.records import dataclass
from taskspec.source.nodes import MappingNode, Node, ScalarNode, SequenceNode
from taskspec.source.scalars import places

Path: TypeAlias = tuple[str | int, ...]
"""Where a value stands in the data: keys of mappings and indices of lists, from the root down."""


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

    @property
    def files(self) -> tuple[str, ...]:
        """The names of all documents that this one rests on, without its own."""
        found = [name for other in self.others.values() for name in (other.origin.name, *other.files)]
        return tuple(dict.fromkeys(found))

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
        return self._between(key.start, key.end) if key else self._between(node.start, node.end)

    def text(self, path: Path) -> str:
        """Return the text of a scalar as written (`0.10`, `1e-3`), quotes and line folds undone.

        Raises KeyError when there is no scalar at the path.
        """
        _, node = self._find(path, strict=True)
        if not isinstance(node, ScalarNode):
            raise KeyError(path)
        return node.value

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
        found = self._places[id(node)]
        first = 0 if start is None else max(0, min(start, len(found)))
        last = len(found) if end is None else max(first, min(end, len(found)))
        if first < last:
            return found[first][0], found[last - 1][1]
        where = found[first][0] if first < len(found) else found[-1][1] if found else node.end
        return where, where

    def _between(self, start: int, end: int) -> Span:
        return span(self.origin, self._lines, start, end)


def span(origin: Origin, lines: list[int], start: int, end: int) -> Span:
    line = bisect_right(lines, start)
    end_line = bisect_right(lines, max(start, end))
    column = start - lines[line - 1] + 1
    end_column = max(start, end) - lines[end_line - 1] + 1
    return Span(origin, line, column, end_line, end_column)


# The files that a spec, or a variant of it, extends: read with it, so that a document is whole wherever it goes.

Packed: TypeAlias = tuple[str, str, tuple[tuple[str, Any], ...]]
"""A document as its text, its name, and the packed documents that it extends by how it names them."""
Read: TypeAlias = Callable[[str], Document]

KEY = "extends"


def others(document: Document, read: Read) -> dict[str, Document]:
    """Return the documents that a document extends, by how it names them.

    Raises:
        SpecError: for every one that cannot be read, at the place that names it.
    """
    found: dict[str, Document] = {}
    problems: list[Diagnostic] = []
    for path, name in _named(document.data):
        try:
            if name not in found:
                found[name] = read(_beside(document, name))
        except SpecError as error:
            problems += [d if d.span else replace(d, span=document.span(path)) for d in error.diagnostics]
    if problems:
        raise SpecError(problems)
    return found


def _named(data: Any) -> Iterator[tuple[Path, str]]:
    """Yield every mention of another file, with its path."""
    if not isinstance(data, dict):
        return
    variants = data.get("variants")
    listed: Mapping[str, Any] = variants if isinstance(variants, dict) else {}
    entries: list[tuple[Path, Any]] = [((), data), *((("variants", key), value) for key, value in listed.items())]
    for path, entry in entries:
        if not isinstance(entry, dict):
            continue
        if isinstance(entry.get(KEY), str):
            yield (*path, KEY), entry[KEY]


def _beside(document: Document, name: str) -> str:
    """Return the path of another file, from where we are: it is named as seen from the document that names it."""
    if not name.endswith((".yaml", ".yml")):
        message = f"`{KEY}` names the file of a spec, which ends in .yaml, not {name!r}"
        raise SpecError([Diagnostic("E711", None, message)])
    return os.path.normpath(pathlib.Path(document.origin.name).parent / name)


def circle(chain: tuple[str, ...], name: str) -> SpecError:
    """Return the error that a spec extends itself by way of others."""
    words = " -> ".join(pathlib.Path(each).name for each in (*chain[chain.index(name) :], name))
    return SpecError([Diagnostic("E212", None, f"these specs extend each other: {words}")])


def packed(document: Document) -> Packed:
    """Return a document as texts, from which `source.unpacked` makes it again."""
    return (
        document.origin.text,
        document.origin.name,
        tuple((name, packed(other)) for name, other in document.others.items()),
    )
