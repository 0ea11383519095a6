"""Reading on behind what stops the YAML parser, so that one run reports all of it.

What was to be in quotes is covered up, character by character so that every place stays where it was, and the
text is read once more.
"""

from __future__ import annotations

import re

from taskspec.source.compose import Composed, compose
from taskspec.source.excerpts import FENCE
from taskspec.source.nodes import TextProblem
from taskspec.source.syntax import explain

_IN_QUOTES = frozenset({"E102", "E103", "E104", "E106"})
"""Findings whose text, in quotes, is a value: a word in its place leaves the rest as it is."""
_TOO_MUCH = frozenset({"E109"})
"""Findings whose text is better not there."""
_READ_AGAIN = 2_000_000
"""How many characters are read again at most, whatever the text."""


def compose_all(text: str) -> tuple[Composed, list[TextProblem]]:
    """The tree of a text, its bad parts covered up, and what stopped the parser, in the order of the text."""
    covered, stops = text, list[TextProblem]()
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
