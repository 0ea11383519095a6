"""YAML text -> plain data, with a map from every value (and every character of it) to its place.

Texts are read past what stops the YAML parser, so that one run reports every problem.
"""

from __future__ import annotations

import os
import pathlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice
from typing import Any, Literal, TypeAlias, cast

from taskspec.base.diagnostics import Collector, Diagnostic, Origin, SpecError, spec_error
from taskspec.base.limits import how_to_raise, limits
from taskspec.language.source.document import EXTENDS, compose, span
from taskspec.language.source.document import Document as Document
from taskspec.language.source.document import Path as Path
from taskspec.language.source.nodes import (
    FENCE,
    Composed,
    MappingNode,
    Node,
    ScalarNode,
    SequenceNode,
    TextProblem,
    resolve,
)
from taskspec.language.source.yaml_errors import explain, find

_MAX_FINDINGS = 50
_BREAKS = re.compile(r"\r\n|\r|\n")
# Control characters, the line separators that editors do not show, and what is not a character.
_NOT_TEXT = re.compile("[\0-\x08\x0b-\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")


Kind: TypeAlias = Literal["taskspec", "experiment", "exam", "findings"]
"""Kind of a YAML file, named by its first key: a spec, or something that goes with specs."""
_OTHER_KINDS = re.compile(r"^(experiment|exam|findings) *:", re.MULTILINE)

Packed: TypeAlias = tuple[str, str, tuple[tuple[str, Any], ...]]
"""A document as its text, its name, and the packed documents that it extends by how it names them."""

_Known: TypeAlias = dict[str, Document]
"""Files that were read on behalf of one document, so that each is read once."""


def kind_of_text(text: str) -> Kind:
    """Return the kind of a file by its text, which need not be valid; a spec unless it says otherwise."""
    other = _OTHER_KINDS.search(text)
    if other is None:
        return "taskspec"
    return cast(Kind, other[1])


def read_file(path: str | os.PathLike[str], name: str | None = None) -> Document:
    """Read a spec from a file in UTF-8 of at most a megabyte, and the files that it extends. Raises SpecError."""
    return _read_file(path, name or os.fspath(path), (), {})


def _read_file(path: str | os.PathLike[str], name: str, chain: tuple[str, ...], known: _Known) -> Document:
    most = limits().file
    try:
        with pathlib.Path(path).open("rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise spec_error("E710", f"there is no file {name!r}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise spec_error("E711", f"cannot read {name!r}: {reason}") from None
    return _with_others(_read_text(_decode(content, name), name), chain, known)


def read_text(text: str, name: str = "<string>", known: Mapping[str, Document] | None = None) -> Document:
    """Read a spec from its text, and the files that it extends unless they are given."""
    document = _read_text(text, name)
    if known is not None:
        return replace(document, others=known)
    return _with_others(document, (), {})


def packed(document: Document) -> Packed:
    """Return a document as texts, from which `unpacked` makes it again."""
    others = tuple((name, packed(other)) for name, other in document.others.items())
    return document.origin.text, document.origin.name, others


def unpacked(pack: Packed) -> Document:
    text, name, rest = pack
    return read_text(text, name, {key: unpacked(other) for key, other in rest})


def _with_others(document: Document, chain: tuple[str, ...], known: _Known) -> Document:
    """Read the documents that a document and its variants extend; `chain` lists the files that led to it, the outermost first."""
    here = (*chain, os.path.normpath(document.origin.name))
    named: dict[str, Document] = {}
    problems: list[Diagnostic] = []
    for path, name in _extended(document.data):
        try:
            if not name.endswith((".yaml", ".yml")):
                raise spec_error("E711", f"`{EXTENDS}` names the file of a spec, which ends in .yaml, not {name!r}")
            other = os.path.normpath(pathlib.Path(document.origin.name).parent / name)
            if other in here:
                circle = []
                for each in (*here[here.index(other) :], other):
                    circle.append(pathlib.Path(each).name)
                raise spec_error("E212", f"these specs extend each other: {' -> '.join(circle)}")
            if other not in known:
                known[other] = _read_file(other, other, here, known)
            named[name] = known[other]
        except SpecError as error:
            for d in error.diagnostics:
                problems.append(replace(d, span=d.span or document.span(path)))
    if problems:
        raise SpecError(problems)
    if named:
        return replace(document, others=named)
    return document


def _extended(data: Any) -> Iterator[tuple[Path, str]]:
    if not isinstance(data, dict):
        return
    entries: list[tuple[Path, Any]] = [((), data)]
    if isinstance(data.get("variants"), dict):
        for key, value in data["variants"].items():
            entries.append((("variants", key), value))
    for path, entry in entries:
        if isinstance(entry, dict) and isinstance(entry.get(EXTENDS), str):
            yield (*path, EXTENDS), entry[EXTENDS]


def _read_text(text: str, name: str) -> Document:
    text = text.removeprefix("\ufeff")  # a byte-order mark: editors do not count it either
    origin = Origin(name, text)
    lines = _line_starts(text)
    root = None
    if len(text) > limits().file:
        message = f"the file is larger than {limits().file:,} bytes"
        findings = [TextProblem("E114", 0, 0, message, how_to_raise("file", len(text)))]
    elif character := _NOT_TEXT.search(text):
        message = f"the character U+{ord(character.group()):04X} is not allowed in a spec"
        findings = [TextProblem("E113", character.start(), character.end(), message, "remove it")]
    else:
        root, findings = _compose(text)
    collector = Collector()
    for each in islice(findings, _MAX_FINDINGS):
        collector.add(each.code, span(origin, lines, each.start, each.end), each.message, each.hint)
    collector.raise_if_errors()
    assert root is not None, "a text without a tree has a finding"
    return Document(origin, _data(root), root, lines)


def _compose(text: str) -> tuple[Node | None, list[TextProblem]]:
    composed, stops = compose_all(text)
    if stops and stops[-1].code == "E114":
        return composed.root, stops[-1:]  # a text past the bounds is not looked at any further
    traps: list[TextProblem] = []
    if composed.root is not None:
        traps = list(find(text, composed.root, composed.bad_keys))
    findings = []
    for each in traps:
        if not any(stop.covers(each) for stop in stops):
            findings.append(each)
    for stop in stops:
        if not any(each.covers(stop) for each in findings):
            findings.append(stop)
    return composed.root, findings


def _decode(content: bytes, name: str) -> str:
    if len(content) > limits().file:
        raise spec_error("E114", f"the file is larger than {limits().file:,} bytes")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        text = content.decode("utf-8", errors="replace")
        start = len(content[: error.start].decode("utf-8"))
        message = f"the byte 0x{content[error.start]:02X} is not UTF-8; save the file as UTF-8"
        if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            message = "the file is in UTF-16; save it as UTF-8"
        place = span(Origin(name, text), _line_starts(text), start, start + 1)
        raise SpecError([Diagnostic("E113", place, message)]) from None


def _line_starts(text: str) -> list[int]:
    return [0, *(line_break.end() for line_break in _BREAKS.finditer(text))]


def _data(node: Node) -> Any:
    match node:
        case ScalarNode(style="plain"):
            return resolve(node.value)
        case ScalarNode():
            return node.value
        case SequenceNode():
            return list(map(_data, node.items))
        case MappingNode():
            return {key.value: _data(value) for key, value in node.entries}


# Reading on behind what stops the YAML parser, so that one run reports all of it.
#
# A value that lacks its quotes is covered up, character by character so that every place stays where it was, and the text is
# read once more.

_IN_QUOTES = frozenset({"E102", "E103", "E104", "E106"})
"""Findings whose text, in quotes, is a value: a word in its place leaves the rest as it is."""
_TOO_MUCH = frozenset({"E109"})
"""Findings whose text is better not there."""
_READ_AGAIN = 2_000_000
"""Limit on the characters that are read again."""


def compose_all(text: str) -> tuple[Composed, list[TextProblem]]:
    """Parse a text again and again, each time with what stopped the parser covered up.

    Returns:
        The tree, and every problem that stopped the parser, in the order of the text.
    """
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
        letter = "x"
        if stop.code in _TOO_MUCH or covered.startswith(FENCE, stop.start):
            letter = " "
        cover = re.sub(r"\S", letter, covered[stop.start : stop.end])
        covered = covered[: stop.start] + cover + covered[stop.end :]
    return composed, stops
