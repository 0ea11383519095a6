"""Places of values in a JSON text, for messages about data that a program wrote and something else has changed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from taskspec.base.diagnostics import Origin, Span

_SPACE = re.compile(r"[ \t\n\r]*")
_DECODER = json.JSONDecoder()


def json_span(origin: Origin, path: tuple[str | int, ...]) -> Span:
    """Return the place of a value in a text that is JSON; where a path leads nowhere, of the last value on its way."""
    text = origin.text
    start = _after_space(text, 0)
    for step in path:
        found = next((place for key, place in _entries(text, start) if key == step), None)
        if found is None:
            break
        start = found
    end = _DECODER.raw_decode(text, start)[1]
    line, column = _line_and_column(text, start)
    end_line, end_column = _line_and_column(text, end)
    return Span(origin, line, column, end_line, end_column)


def _entries(text: str, start: int) -> Iterator[tuple[str | int, int]]:
    """Yield the keys of an object, or the indices of a list, each with the place where its value begins."""
    opening = text[start]
    if opening not in "{[":
        return
    place = _after_space(text, start + 1)
    index = 0
    while text[place] not in "}]":
        key: str | int = index
        if opening == "{":
            key, place = _DECODER.raw_decode(text, place)
            place = _after_space(text, _after_space(text, place) + 1)
        yield key, place
        place = _after_space(text, _DECODER.raw_decode(text, place)[1])
        if text[place] == ",":
            place = _after_space(text, place + 1)
        index += 1


def _after_space(text: str, place: int) -> int:
    found = _SPACE.match(text, place)
    assert found is not None
    return found.end()


def _line_and_column(text: str, place: int) -> tuple[int, int]:
    return text.count("\n", 0, place) + 1, place - text.rfind("\n", 0, place)
