"""The tree of a YAML text, what its author meant to write at a place, and the values of its scalars.

Places of the characters of a scalar follow YAML's rules for each style: folded line breaks, doubled quotes, escapes, the
indentation of block scalars. They are worked out only when asked for, and checked against the value that the reader gave.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from taskspec.base.diagnostics import Advice
from taskspec.base.limits import Limits

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
        return self.start <= other.start and other.end <= self.end


@dataclass(slots=True)
class Syntax:
    """The parser's message when it gave up, and its place."""

    problem: str
    context: str
    at: int
    since: int | None
    open: list[MappingNode | SequenceNode]
    last: Node | None

    @property
    def in_flow(self) -> bool:
        """Between braces or brackets."""
        return bool(self.open) and self.open[-1].flow


@dataclass(slots=True)
class Composed:
    """The tree of the part of a text that could be read, and the reason why the rest could not."""

    root: Node | None = None
    syntax: Syntax | None = None
    stop: TextProblem | None = None
    bad_keys: list[Node] = field(default_factory=list)


# The value that an author meant to write at a place: its end, and its form in quotes.

_PAIRS = {"(": ")", "[": "]", "{": "}"}
_LONGEST = 70  # longer than this, a value is cut in a message
_PASTED = 500  # longer than this, a value is not repeated in a hint

_ANCHOR = re.compile(r"&\w+(\s.*)?|\*\w+", re.DOTALL)
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
"""The line above and below code in Markdown."""

TYPOGRAPHIC = frozenset("“”„‟«»‘’‚‛")
"""Quotes that quote in books, and nothing in YAML."""


def value_end(text: str, start: int, in_flow: bool) -> int:
    """Offset at which a value was meant to end: the end of its line or, in flow style, a comma, colon or bracket not its own."""
    closers: list[str] = []
    at = start
    while at < len(text):
        char = text[at]
        is_comment = char == "#" and text[at - 1 : at] in (" ", "\t")
        is_end = in_flow and (char in ",)]}" or (char == ":" and text[at + 1 : at + 2] in " \r\n"))
        if char in _PAIRS:
            closers.append(_PAIRS[char])
        elif closers and char == closers[-1]:
            closers.pop()
        elif is_comment or (not closers and (is_end or char in "\r\n")):
            break
        at += 1
    return start + len(text[start:at].rstrip())


def is_closed(text: str, start: int) -> bool:
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
    """Write a text as a YAML string, in double quotes unless it contains some; typographic quotes around it are dropped."""
    words = " ".join(written.split())
    if words[:1] in TYPOGRAPHIC and words[-1:] in TYPOGRAPHIC:
        words = words[1:-1].strip()
    if '"' in words or "\\" in words:
        return "'" + words.replace("'", "''") + "'"
    return f'"{words}"'


def in_quotes(written: str) -> str:
    """Advise to put a text in quotes, ready to be pasted unless it is very long."""
    advice = "put this text in quotes"
    if len(written) <= _PASTED:
        return Advice(f"{advice}: {quoted(written)}", written, quoted(written))
    return advice


def shown(written: str) -> str:
    """Shorten an author's text to one line of a message."""
    words = " ".join(written.split())
    if len(words) <= _LONGEST:
        return words
    return words[: _LONGEST - 1] + "…"


def special_start(text: str, start: int, in_flow: bool) -> TextProblem:
    """Report a value that starts with a special character of YAML."""
    char = text[start]
    if text.startswith(FENCE, start):
        message = "this line is not part of the spec: it marks code in Markdown"
        return TextProblem("E102", start, line_end(text, start), message, "remove it")
    end = max(start + 1, value_end(text, start, in_flow and char not in ",]}"))
    message = f"a value cannot start with `{char}`: YAML reads it as {SPECIAL.get(char, 'its own')}"
    hint = in_quotes(text[start:end])
    if _ANCHOR.fullmatch(text, start, end):
        hint = "specs have no anchors and aliases: write the value again, or once as a constant or definition"
    return TextProblem("E102", start, end, message, hint)


def line_start(text: str, at: int) -> int:
    return max(text.rfind("\n", 0, at), text.rfind("\r", 0, at)) + 1


def line_end(text: str, at: int) -> int:
    line_break = re.compile(r"[\r\n]").search(text, at)
    if line_break:
        return line_break.start()
    return len(text)


# -- scalars ------------------------------------------------------------------------------------------------------

Place: TypeAlias = tuple[str, int, int]
"""A character of a value, and the range of the file that it came from."""

_CONSTANTS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INT = re.compile(r"[-+]?[0-9]+")
_OCT = re.compile(r"0o[0-7]+")
_HEX = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INF = re.compile(r"[-+]?\.(inf|Inf|INF)")
_NAN = re.compile(r"\.(nan|NaN|NAN)")

_BREAK = re.compile(r"\r\n|\r|\n")
_BLANK = re.compile(r"[ \t\r\n]+")
_JOIN = re.compile(r"\\(?:\r\n|\r|\n)((?:[ \t]*(?:\r\n|\r|\n))*)[ \t]*")
_ESCAPE = re.compile(r"\\(?:x[0-9a-fA-F]{2}|u[0-9a-fA-F]{4}|U[0-9a-fA-F]{8}|.)", re.DOTALL)
_ESCAPES = {
    "0": "\0", "a": "\a", "b": "\b", "t": "\t", "\t": "\t", "n": "\n", "v": "\v", "f": "\f", "r": "\r", "e": "\x1b",
    "N": "\x85", "_": "\xa0", "L": "\u2028", "P": "\u2029",
}  # fmt: skip


def resolve(text: str) -> str | int | float | bool | None:
    """Convert a plain scalar by YAML 1.2's core schema: to null, a truth value or a number, else it is text."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if text[0] not in "+-.0123456789" or len(text) > Limits.digits:
        return text
    if _INT.fullmatch(text):
        return int(text)
    if _OCT.fullmatch(text):
        return int(text[2:], 8)
    if _HEX.fullmatch(text):
        return int(text[2:], 16)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INF.fullmatch(text) or _NAN.fullmatch(text):
        return float(text.replace(".", ""))
    return text


def is_overlong_number(text: str) -> bool:
    return len(text) > Limits.digits and any(form.fullmatch(text) for form in (_INT, _FLOAT, _HEX))


def places(text: str, scalar: ScalarNode) -> list[tuple[int, int]]:
    """Ranges of `text` that the characters of a scalar's value were written as, one for each character."""
    match scalar.style:
        case "plain":
            written = _flow(text, scalar.start, scalar.end, scalar.style)
        case "'" | '"':
            written = _flow(text, scalar.start + 1, scalar.end - 1, scalar.style)
        case "|" | ">":
            written = _block(text, scalar)
    written = written[: len(scalar.value)]
    if "".join(char for char, _, _ in written) != scalar.value:
        # Some corner of YAML that is not covered: point at the scalar as a whole rather than lie.
        return [(scalar.start, scalar.end)] * len(scalar.value)
    return [(start, end) for _, start, end in written]


def _flow(text: str, start: int, end: int, style: Style) -> list[Place]:
    characters: list[Place] = []
    at = start
    while at < end:
        char = text[at]
        begin = at
        if char in " \t\r\n":
            blank = _BLANK.match(text, at, end)
            assert blank is not None, "the pattern matches this character"
            at = blank.end()
            breaks = len(_BREAK.findall(blank.group()))
            if not breaks:
                for i in range(begin, at):
                    characters.append((text[i], i, i + 1))
            elif breaks == 1:
                characters.append((" ", begin, at))
            else:
                characters += [("\n", begin, at)] * (breaks - 1)
        elif char == "'" == style:
            at += 2
            characters.append(("'", begin, at))
        elif char == "\\" and style == '"':
            chars, at = _escaped(text, at)
            characters += [(each, begin, at) for each in chars]
        else:
            at += 1
            characters.append((char, begin, at))
    return characters


def _escaped(text: str, at: int) -> tuple[str, int]:
    if join := _JOIN.match(text, at):
        return "\n" * len(_BREAK.findall(join.group(1))), join.end()
    escape = _ESCAPE.match(text, at)
    assert escape is not None, "the YAML reader let a lone backslash through"
    code = escape.group()[1:]
    if len(code) > 1:
        char = chr(int(code[1:], 16))
    else:
        char = _ESCAPES.get(code, code)
    return char, escape.end()


def _block(text: str, scalar: ScalarNode) -> list[Place]:
    """Return the places in literal (`|`) and folded (`>`) scalars, as section 8.1 of the YAML standard folds lines."""
    header = _BREAK.search(text, scalar.start, scalar.end)
    if header is None:
        return []
    characters: list[Place] = []
    at = header.end()
    indent = _indentation(text, at, scalar.value)
    while at < len(text):
        stop = _BREAK.search(text, at)
        end = stop.start() if stop else len(text)
        body = text[at:end]
        if body.strip(" ") and not body.startswith(" " * indent):
            break
        for i in range(min(at + indent, end), end):
            characters.append((text[i], i, i + 1))
        at = len(text)
        if stop:
            at = stop.end()
            wanted = scalar.value[len(characters) : len(characters) + 1]
            if wanted in ("\n", " "):
                characters.append((wanted, end, at))
    return characters


def _indentation(text: str, at: int, value: str) -> int:
    """Indentation of a block scalar: column of its first character in the file, less its column in the value."""
    first = re.compile(r"[^ \r\n]").search(text, at)
    inner = re.compile(r"[^ \n]").search(value)
    if first is None or inner is None:
        return 0
    return _lead(text, first.start()) - _lead(value, inner.start())


def _lead(text: str, at: int) -> int:
    return at - len(text[:at].rstrip(" "))
