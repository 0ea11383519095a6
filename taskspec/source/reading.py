"""Read specs from files and texts, past what stops the YAML parser, so that one run reports every problem."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path as FilePath
from typing import Any, TypeAlias

from taskspec.base.diagnostics import Collector, Origin, Span, SpecError
from taskspec.base.limits import how_to_raise, limits
from taskspec.source.document import Document, Packed, circle, others, span
from taskspec.source.nodes import FENCE, Composed, MappingNode, Node, ScalarNode, SequenceNode, TextProblem
from taskspec.source.scalars import resolve
from taskspec.source.yaml_errors import explain, find

# ---------- reading
# Reading specs: from a file or a text to a document, with every problem of the text found.

_MAX_FINDINGS = 50
_BREAKS = re.compile(r"\r\n|\r|\n")
# Control characters, the line separators that editors do not show, and what is not a character.
_NOT_TEXT = re.compile("[\0-\x08\x0b-\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")


def read(path_or_text: str | os.PathLike[str], name: str | None = None) -> Document:
    """Read a spec from a file, or from a text: a string with a line break, or one with a name.

    Raises SpecError with every problem found.
    """
    if isinstance(path_or_text, str) and (name or not path_or_text or "\n" in path_or_text):
        return read_text(path_or_text, name or "<string>")
    return read_file(path_or_text, name)


def read_file(path: str | os.PathLike[str], name: str | None = None) -> Document:
    """Read a spec from a file in UTF-8 of at most a megabyte, and the files that it extends. Raises SpecError."""
    return _read_file(path, name or os.fspath(path), (), {})


_Known: TypeAlias = dict[str, "Document"]
"""Files that were read on behalf of one document, so that each is read once."""


def _read_file(path: str | os.PathLike[str], name: str, chain: tuple[str, ...], known: _Known) -> Document:
    most = limits().file
    try:
        with FilePath(path).open("rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise _failure(name, "E710", f"there is no file {name!r}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise _failure(name, "E711", f"cannot read {name!r}: {reason}") from None
    return _with_others(_read_text(_decode(content, name), name), chain, known)


def read_text(text: str, name: str = "<string>", known: Mapping[str, Document] | None = None) -> Document:
    """Read a spec from its text, and the files that it extends unless they are given.

    Raises:
        SpecError: with every problem found.
    """
    found = _read_text(text, name)
    return _with_others(found, (), {}) if known is None else replace(found, others=known)


def unpacked(pack: Packed) -> Document:
    """The document that `packed` was given."""
    text, name, rest = pack
    return read_text(text, name, {key: unpacked(other) for key, other in rest})


def _with_others(document: Document, chain: tuple[str, ...], known: _Known) -> Document:
    """A document with those that it extends; `chain` are the files that led to it, the outermost first."""
    here = (*chain, os.path.normpath(document.origin.name))

    def read(path: str) -> Document:
        if path in here:
            raise circle(here, path)
        if path not in known:
            known[path] = _read_file(path, path, here, known)
        return known[path]

    found = others(document, read)
    return replace(document, others=found) if found else document


def _read_text(text: str, name: str) -> Document:
    text = text.removeprefix("\ufeff")  # a byte-order mark: editors do not count it either
    origin = Origin(name, text)
    lines = [0, *(found.end() for found in _BREAKS.finditer(text))]
    early = list(_before_reading(text))
    root, findings = (None, early) if early else _compose(text)
    collector = Collector()
    for each in islice(findings, _MAX_FINDINGS):
        place = span(origin, lines, each.start, each.end)
        collector.add(each.code, place, each.message, each.hint)
    collector.raise_if_errors()
    assert root is not None, "a text without a tree has a finding"
    return Document(origin, _data(root), root, lines)


def _compose(text: str) -> tuple[Node | None, list[TextProblem]]:
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
        message = f"the character {code_point} is not allowed in a spec"
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
        place = span(Origin(name, text), lines, start, start + 1)
        raise _failure(name, "E113", _not_utf8(content, error), place) from None


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


# ---------- recover
# Reading on behind what stops the YAML parser, so that one run reports all of it.
#
# What was to be in quotes is covered up, character by character so that every place stays where it was, and the
# text is read once more.

_IN_QUOTES = frozenset({"E102", "E103", "E104", "E106"})
"""Findings whose text, in quotes, is a value: a word in its place leaves the rest as it is."""
_TOO_MUCH = frozenset({"E109"})
"""Findings whose text is better not there."""
_READ_AGAIN = 2_000_000
"""How many characters are read again at most, whatever the text."""


def compose_all(text: str) -> tuple[Composed, list[TextProblem]]:
    """The tree of a text, its bad parts covered up, and what stopped the parser, in the order of the text."""
    from taskspec.source.compose import compose  # imports PyYAML: when the first spec is read, not when the package is

    covered = text
    stops: list[TextProblem] = []
    for _ in range(max(1, _READ_AGAIN // (len(text) + 1))):
        composed = compose(covered)
        stop = composed.stop
        if composed.syntax:
            stop = explain(covered, composed.syntax)
        elif composed.root is None and stop is None:
            stop = TextProblem("E115", 0, 0, "the file holds nothing but blanks and comments")
        if stop is None or (stops and stop.start <= stops[-1].start):
            break
        if not stops or stop.code != "E104" or "\n" in text[stops[-1].start : stop.start]:
            stops.append(stop)  # of colons, one in a line: the advice is the same
        if stop.code not in _IN_QUOTES | _TOO_MUCH or len(stops) > 50:
            break
        covered = _cover(covered, stop)
    return composed, stops


def _cover(text: str, stop: TextProblem) -> str:
    letter = " " if stop.code in _TOO_MUCH or text.startswith(FENCE, stop.start) else "x"
    return text[: stop.start] + re.sub(r"\S", letter, text[stop.start : stop.end]) + text[stop.end :]
