"""The tree of a YAML text, and what its author meant to write at a place."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

# ---------- nodes
# The tree of a YAML text: what stands where. Offsets count characters; ends are exclusive.

Style = Literal["plain", "'", '"', "|", ">"]


@dataclass(slots=True, eq=False)
class ScalarNode:
    """A single value: its text once quotes, escapes and folded lines are taken care of."""

    value: str
    start: int
    end: int
    style: Style


@dataclass(slots=True, eq=False)
class SequenceNode:
    """A list; `flow` when written between brackets."""

    start: int
    flow: bool
    end: int = 0
    items: list[Node] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class MappingNode:
    """Entries in the order written, repeated keys included; `flow` when written between braces."""

    start: int
    flow: bool
    end: int = 0
    entries: list[tuple[ScalarNode, Node]] = field(default_factory=list)
    index: dict[str, tuple[ScalarNode, Node]] = field(default_factory=dict)


Node: TypeAlias = ScalarNode | SequenceNode | MappingNode


class TextProblem(NamedTuple):
    """A problem with the text, placed by offsets."""

    code: str
    start: int
    end: int
    message: str
    hint: str | None = None

    def covers(self, other: TextProblem) -> bool:
        """Whether another problem lies within this one."""
        return self.start <= other.start and other.end <= self.end


@dataclass(slots=True)
class Syntax:
    """What the parser said when it gave up, and how far it had come."""

    problem: str
    context: str
    at: int
    since: int | None
    open: list[MappingNode | SequenceNode]
    last: Node | None


@dataclass(slots=True)
class Composed:
    """The tree of a text as far as it could be read, and why it could be read no further."""

    root: Node | None = None
    syntax: Syntax | None = None
    stop: TextProblem | None = None
    bad_keys: list[Node] = field(default_factory=list)


# ---------- excerpts
# What an author meant to write at a place: where it ends, and how to write it in quotes.

_PAIRS = {"(": ")", "[": "]", "{": "}"}
_CLOSERS = frozenset(_PAIRS.values())
_LONGEST = 70  # longer than this, a value is cut in a message
_PASTED = 500  # longer than this, a value is not repeated in a hint

SPECIAL = {
    "*": "the name of an alias",
    "&": "the name of an anchor",
    "!": "a tag",
    "|": "the start of a block of text",
    ">": "the start of a block of folded text",
    "%": "a directive",
    "@": "a character reserved for later use",
    "`": "a character reserved for later use",
    ",": "the end of an entry",
    "]": "the end of a list",
    "}": "the end of a mapping",
    "-": "an entry of a list",
    "?": "the start of a key",
}

FENCE = "```"
"""What stands above and below code in Markdown."""

TYPOGRAPHIC = frozenset("“”„‟«»‘’‚‛")
"""Quotes that quote in books, and nothing in YAML."""


def value_end(text: str, start: int, in_flow: bool) -> int:
    """Where the value that starts here was meant to end: at the end of its line or, between
    braces or brackets, at the first comma, colon or closing bracket that is not its own.
    """
    closers: list[str] = []
    at = start
    while at < len(text):
        char = text[at]
        if char in _PAIRS:
            closers.append(_PAIRS[char])
        elif closers and char == closers[-1]:
            closers.pop()
        elif _ends_value(text, at, in_flow and not closers, bool(closers)):
            break
        at += 1
    return start + len(text[start:at].rstrip())


def _ends_value(text: str, at: int, in_entry: bool, in_brackets: bool) -> bool:
    is_comment = text[at] == "#" and text[at - 1 : at] in (" ", "\t")
    is_line_end = text[at] in "\r\n" and not in_brackets
    return is_comment or is_line_end or (in_entry and _ends_entry(text, at))


def _ends_entry(text: str, at: int) -> bool:
    char = text[at]
    return char == "," or char in _CLOSERS or (char == ":" and text[at + 1 : at + 2] in " \r\n")


def is_closed(text: str, start: int) -> bool:
    """Whether the bracket that stands at `start` is closed somewhere."""
    if text[start] not in _PAIRS:
        return True  # one pair in a list, `[a: b]`, is a mapping without braces
    closers: list[str] = []
    for char in itertools.islice(text, start, None):
        if char in _PAIRS:
            closers.append(_PAIRS[char])
        elif char == closers[-1]:
            closers.pop()
            if not closers:
                return True
    return False


def quoted(written: str) -> str:
    """A text as a YAML string: in double quotes unless it holds some itself; those of typography around it are dropped."""
    words = " ".join(written.split())
    if words[:1] in TYPOGRAPHIC and words[-1:] in TYPOGRAPHIC:
        words = words[1:-1].strip()
    if '"' in words or "\\" in words:
        return "'" + words.replace("'", "''") + "'"
    return f'"{words}"'


def in_quotes(written: str) -> str:
    """The advice to put a text in quotes, ready to be pasted unless it is very long."""
    advice = "put this text in quotes"
    return f"{advice}: {quoted(written)}" if len(written) <= _PASTED else advice


def shown(written: str) -> str:
    """A piece of the author's text for a message: on one line, and cut when long."""
    words = " ".join(written.split())
    return words if len(words) <= _LONGEST else words[: _LONGEST - 1] + "…"


def special_start(text: str, start: int, in_flow: bool) -> TextProblem:
    """The finding that a value starts with a character of YAML's own."""
    char = text[start]
    if text.startswith(FENCE, start):
        message = "this line is not part of the spec: it marks code in Markdown"
        return TextProblem("E102", start, line_end(text, start), message, "remove it")
    end = max(start + 1, value_end(text, start, in_flow and char not in ",]}"))
    return TextProblem(
        "E102",
        start,
        end,
        f"a value cannot start with `{char}`: YAML reads it as {SPECIAL.get(char, 'its own')}",
        in_quotes(text[start:end]),
    )


def line_start(text: str, at: int) -> int:
    """The offset of the first character of the line that holds an offset."""
    return max(text.rfind("\n", 0, at), text.rfind("\r", 0, at)) + 1


def line_end(text: str, at: int) -> int:
    """The offset of the line break that ends the line that holds an offset."""
    found = re.compile(r"[\r\n]").search(text, at)
    return found.start() if found else len(text)
