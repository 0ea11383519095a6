"""The path of a place in a spec that is being typed: a mark is put there, and looked for in the document that is read."""

from __future__ import annotations

import re
from typing import Literal, NamedTuple

from taskspec.analysis.repair import read_tolerantly
from taskspec.source import Path

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
    found = None if document is None else document.search(_MARK)
    if found is None:
        return Cursor((), "text")
    path, is_key, value = found
    before = value.partition(_MARK)[0]
    word = _PARTIAL.search(before)
    return Cursor(path, "key" if is_key else "value", before, word.group() if word else "")


def word_at(text: str, offset: int) -> tuple[str, int]:
    """Return the word, with its prime, that an offset is in or at the end of, and where it begins; an empty one elsewhere."""
    start = text.rfind("\n", 0, offset) + 1
    end = text.find("\n", offset)
    line = text[start : end if end >= 0 else len(text)]
    for found in _WORD.finditer(line):
        if found.start() <= offset - start <= found.end():
            return found.group(), start + found.start()
    return "", offset
