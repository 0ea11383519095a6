"""Text that is being typed, read as a document all the same: what stops the YAML parser is closed, or left out.

Repairs keep every line and every column before them, so that places in the repaired text are places in what was written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal, NamedTuple

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language.source import Document, Path, read_text

MOST_REPAIRS = 40
"""Lines that are repaired in one text; a text with more mistakes than that is not a spec that is being typed."""

_CLOSERS = {"(": ")", "[": "]", "{": "}"}
_KEY = re.compile(r"""^(\s*(?:- +)*(?:[\w'./() ,-]+|"[^"]*"|'[^']*')\s*:)(?:\s|$)""")

_BEGUN = re.compile(r"^\s*(?:- +)*[^\W\d]\w*'?\s*$")


class Reading(NamedTuple):
    """A text as a document, with what was wrong with it as YAML, and the numbers of the lines that were repaired."""

    document: Document | None
    diagnostics: tuple[Diagnostic, ...]
    repaired: frozenset[int]


def read_tolerantly(text: str, name: str) -> Reading:
    """Return a text as a document, without the lines that cannot be read. Never raises for a bad text."""
    first: tuple[Diagnostic, ...] = ()
    lines = text.split("\n")
    repaired: set[int] = set()
    document, problems = _read(lines, name)
    while document is None and len(repaired) < MOST_REPAIRS:
        first = first or problems
        number = _line_of(problems, len(lines))
        if number is None or number in repaired:
            number = _next(number, repaired, lines)
        if number is None:
            break
        document, problems, changed = _repair(lines, number, name, problems)
        repaired |= {number, changed}
    return Reading(document, first, frozenset(repaired))


def _repair(
    lines: list[str], number: int, name: str, problems: tuple[Diagnostic, ...]
) -> tuple[Document | None, tuple[Diagnostic, ...], int]:
    """Put the first repair in the place of a line after which the text can be read further; else leave the line out.

    Returns:
        The document or the problems that are left, and the number of the line that was changed.
    """
    before = _line_of(problems, len(lines)) or 0
    candidates = [(number, candidate) for candidate in _candidates(lines[number - 1])]
    above = _next(number, set(), lines)
    if above is not None and _BEGUN.match(lines[above - 1]):  # a key that is begun is noticed a line further down
        candidates.insert(0, (above, f"{lines[above - 1].rstrip()}: ~"))
    for at, candidate in candidates:
        tried = [*lines]
        tried[at - 1] = candidate
        document, left = _read(tried, name)
        after = _line_of(left, len(lines)) or 0
        if document is not None or after > before or candidate == "":
            lines[:] = tried
            return document, left, at
    return None, problems, number


def _candidates(line: str) -> Iterator[str]:
    closers = "".join(_closers(line))
    if closers:
        yield line + closers
        yield line.rstrip().rstrip(",:") + closers
        yield f"{line}: ~{closers}"
    key = _KEY.match(line)
    if key is not None:
        value = line[key.end(1) :].strip()
        if value:
            yield f"{key[1]} '{value.replace(chr(39), chr(39) * 2)}'"
        yield f"{key[1]} ~"
    yield f"{line.rstrip()}:"  # what is below belongs to it
    yield f"{line.rstrip()}: ~"
    yield ""


def _closers(line: str) -> list[str]:
    closers: list[str] = []
    quote = ""
    for at, char in enumerate(line):
        if quote:
            if char == quote:
                quote = ""
        elif char in "\"'" and (at == 0 or not (line[at - 1].isalnum() or line[at - 1] == "_")):
            quote = char  # after a letter it is a prime
        elif char == "#" and line[at - 1 : at] in ("", " "):
            break
        elif char in _CLOSERS:
            closers.append(_CLOSERS[char])
        elif closers and char == closers[-1]:
            closers.pop()
    if quote:
        closers.append(quote)
    return closers[::-1]


def _read(lines: list[str], name: str) -> tuple[Document | None, tuple[Diagnostic, ...]]:
    try:
        return read_text("\n".join(lines), name), ()
    except SpecError as error:
        return None, error.diagnostics


def _line_of(problems: tuple[Diagnostic, ...], count: int) -> int | None:
    for problem in problems:
        if problem.span is not None:
            return min(problem.span.line, count)
    return None


def _next(number: int | None, repaired: set[int], lines: list[str]) -> int | None:
    """Return the nearest line above a place that still holds something: the parser stops below what is wrong."""
    for each in range((number or len(lines)) - 1, 0, -1):
        if each not in repaired and lines[each - 1].strip():
            return each
    return None


# -- the path of a place: a mark is put there, and looked for in the document that is read ----------------------------

_MARK = "zzcursorzz"
_PARTIAL = re.compile(r"[^\W\d][\w/.-]*'?$")
_WORD = re.compile(r"[^\W\d]\w*'?")


class Cursor(NamedTuple):
    """A place in a spec: the path of the entry, and whether its key or its value is written there.

    `before` is what stands before the place in the same key or value, and `word` the beginning of a word at its end.
    `kind` is `text` where neither is written, as in a comment.
    """

    path: Path
    kind: Literal["key", "value", "text"]
    before: str = ""
    word: str = ""


def cursor(text: str, offset: int, name: str) -> Cursor:
    """Return what stands at an offset of a text, which need not be complete."""
    document = read_tolerantly(text[:offset] + _MARK + text[offset:], name).document
    place = None
    if document is not None:
        place = document.search(_MARK)
    if place is None:
        return Cursor((), "text")
    path, is_key, value = place
    before = value.partition(_MARK)[0]
    word = ""
    partial = _PARTIAL.search(before)
    if partial is not None:
        word = partial.group()
    if is_key:
        return Cursor(path, "key", before, word)
    return Cursor(path, "value", before, word)


def word_at(text: str, offset: int) -> tuple[str, int]:
    """Return the word, with its prime, that an offset is in or at the end of, and where it begins; an empty one elsewhere."""
    start = text.rfind("\n", 0, offset) + 1
    line = text[start:offset] + text[offset:].partition("\n")[0]
    for match in _WORD.finditer(line):
        if match.start() <= offset - start <= match.end():
            return match.group(), start + match.start()
    return "", offset
