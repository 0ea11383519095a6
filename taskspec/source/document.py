"""A spec's text, read: plain data, and the place of every value in it."""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path as FilePath
from typing import Any, TypeAlias

from taskspec.diagnostics import Collector, Origin, Span, SpecError
from taskspec.limits import how_to_raise, limits
from taskspec.source.nodes import MappingNode, Node, ScalarNode, SequenceNode, TextProblem
from taskspec.source.scalars import places, resolve

Path: TypeAlias = tuple[str | int, ...]
"""Where a value stands in the data: keys of mappings and indices of lists, from the root down."""

_MAX_FINDINGS = 50
_BREAKS = re.compile(r"\r\n|\r|\n")
# Control characters, the line separators that editors do not show, and what is not a character.
_NOT_TEXT = re.compile("[\0-\x08\x0b-\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")


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

    def span(self, path: Path, start: int | None = None, end: int | None = None) -> Span:
        """The place of a value, or of the characters `start` to `end` of a text's value.

        A path that leads nowhere gives the place of the last value on its way that exists.
        """
        key, node = self._find(path)
        if isinstance(node, ScalarNode) and (start is not None or end is not None):
            return self._between(*self._characters(node, start, end))
        if node.end <= node.start and key is not None:
            return self._between(key.start, key.end)  # nothing is written after this key
        return self._between(node.start, node.end)

    def key_span(self, path: Path) -> Span:
        """The place of the key that a path ends with; of the item, when it ends in a list."""
        key, node = self._find(path)
        return self._between(key.start, key.end) if key else self._between(node.start, node.end)

    def text(self, path: Path) -> str:
        """The text of a scalar as written (`0.10`, `1e-3`), quotes and line folds undone.

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
                    key, node = None, node.items[step]
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
        return _span(self.origin, self._lines, start, end)


def _span(origin: Origin, lines: list[int], start: int, end: int) -> Span:
    line, end_line = bisect_right(lines, start), bisect_right(lines, max(start, end))
    column, end_column = start - lines[line - 1] + 1, max(start, end) - lines[end_line - 1] + 1
    return Span(origin, line, column, end_line, end_column)


def read(path_or_text: str | os.PathLike[str], name: str | None = None) -> Document:
    """Read a spec from a file, or from a text: a string with a line break, or one with a name.

    Raises SpecError with every problem found.
    """
    if isinstance(path_or_text, str) and (name or not path_or_text or "\n" in path_or_text):
        return read_text(path_or_text, name or "<string>")
    return read_file(path_or_text, name)


def read_file(path: str | os.PathLike[str], name: str | None = None) -> Document:
    """Read a spec from a file in UTF-8 of at most a megabyte. Raises SpecError."""
    name, most = name or os.fspath(path), limits().file
    try:
        with FilePath(path).open("rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise _failure(name, "E710", f"there is no file {name!r}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise _failure(name, "E711", f"cannot read {name!r}: {reason}") from None
    return read_text(_decode(content, name), name)


def read_text(text: str, name: str = "<string>") -> Document:
    """Read a spec from its text. Raises SpecError with every problem found."""
    text = text.removeprefix("\ufeff")  # a byte-order mark: editors do not count it either
    origin = Origin(name, text)
    lines = [0, *(found.end() for found in _BREAKS.finditer(text))]
    early = list(_before_reading(text))
    root, findings = (None, early) if early else _compose(text)
    collector = Collector()
    for each in islice(findings, _MAX_FINDINGS):
        span = _span(origin, lines, each.start, each.end)
        collector.add(each.code, span, each.message, each.hint)
    collector.raise_if_errors()
    assert root is not None, "a text without a tree has a finding"
    return Document(origin, _data(root), root, lines)


def _compose(text: str) -> tuple[Node | None, list[TextProblem]]:
    # PyYAML is imported when the first spec is read, not when the package is.
    from taskspec.source.recover import compose_all
    from taskspec.source.traps import find

    composed, stops = compose_all(text)
    if stops and stops[-1].code == "E114":
        return composed.root, stops[-1:]  # a text past the bounds is not looked at any further
    traps = [] if composed.root is None else list(find(text, composed.root, composed.bad_keys))
    findings = [each for each in traps if not any(stop.covers(each) for stop in stops)]
    findings += [stop for stop in stops if not any(each.covers(stop) for each in findings)]
    return composed.root, findings


def _before_reading(text: str) -> Iterable[TextProblem]:
    if len(text) > limits().file:
        yield TextProblem("E114", 0, 0, _too_long(), how_to_raise("file", len(text)))
    elif found := _NOT_TEXT.search(text):
        code_point = f"U+{ord(found.group()):04X}"
        message = f"the character {code_point} cannot stand in a spec"
        yield TextProblem("E113", found.start(), found.end(), message, "remove it")


def _too_long() -> str:
    return f"the file is larger than {limits().file:,} bytes"


def _decode(content: bytes, name: str) -> str:
    if len(content) > limits().file:
        raise _failure(name, "E114", _too_long())
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        text = content.decode("utf-8", errors="replace")
        start = len(content[: error.start].decode("utf-8"))
        lines = [0, *(found.end() for found in _BREAKS.finditer(text))]
        span = _span(Origin(name, text), lines, start, start + 1)
        raise _failure(name, "E113", _not_utf8(content, error), span) from None


def _not_utf8(content: bytes, error: UnicodeDecodeError) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "the file is in UTF-16; save it as UTF-8"
    return f"the byte 0x{content[error.start]:02X} is not UTF-8; save the file as UTF-8"


def _failure(name: str, code: str, message: str, span: Span | None = None) -> SpecError:
    collector = Collector()
    collector.add(code, span, message)
    return SpecError(collector.diagnostics)


def _data(node: Node) -> Any:
    match node:
        case ScalarNode(style="plain"):
            return resolve(node.value)
        case ScalarNode():
            return node.value
        case SequenceNode():
            return [_data(item) for item in node.items]
        case MappingNode():
            return {key.value: _data(value) for key, value in node.entries}
