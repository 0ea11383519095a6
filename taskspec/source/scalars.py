"""Scalars: what value a text has (YAML 1.2 core schema), and where each of its characters stands.

The map from characters to places follows YAML's rules for each style: folded line breaks, doubled
quotes, escapes, the indentation of block scalars. It is computed only when a place inside a value
is asked for, and is checked against the value that the YAML reader gave.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeAlias

from taskspec.base.limits import Limits
from taskspec.source.nodes import ScalarNode

# One entry per character of a value: the character, and the range of the file it came from.
Place: TypeAlias = tuple[str, int, int]
# Reads a special sequence at an offset: what it stands for, and the offset after it.
_Reader: TypeAlias = Callable[[str, int], tuple[list[Place], int]]

_NULLS = frozenset({"", "~", "null", "Null", "NULL"})
_BOOLS = {
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
    "0": "\0",
    "a": "\a",
    "b": "\b",
    "t": "\t",
    "\t": "\t",
    "n": "\n",
    "v": "\v",
    "f": "\f",
    "r": "\r",
    "e": "\x1b",
    "N": "\x85",
    "_": "\xa0",
    "L": "\u2028",
    "P": "\u2029",
}


def resolve(text: str) -> str | int | float | bool | None:
    """Return the value of a plain scalar: null, a truth value, a number, or else the text itself."""
    if text in _NULLS:
        return None
    if text in _BOOLS:
        return _BOOLS[text]
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
    if _INF.fullmatch(text):
        return float(text.replace(".", ""))
    return float("nan") if _NAN.fullmatch(text) else text


def is_overlong_number(text: str) -> bool:
    """Return whether a plain scalar is a number with more digits than anybody needs."""
    return len(text) > Limits.digits and bool(_INT.fullmatch(text) or _FLOAT.fullmatch(text) or _HEX.fullmatch(text))


def places(text: str, scalar: ScalarNode) -> list[tuple[int, int]]:
    """Return for every character of a scalar's value the range of `text` that it was written as."""
    match scalar.style:
        case "plain":
            found = _flow(text, scalar.start, scalar.end, {})
        case "'":
            found = _flow(text, scalar.start + 1, scalar.end - 1, {"'": _doubled})
        case '"':
            found = _flow(text, scalar.start + 1, scalar.end - 1, {"\\": _escaped})
        case "|" | ">":
            found = _block(text, scalar)
    found = found[: len(scalar.value)]
    if "".join(char for char, _, _ in found) != scalar.value:
        # Some corner of YAML that is not covered: point at the scalar as a whole rather than lie.
        return [(scalar.start, scalar.end)] * len(scalar.value)
    return [(start, end) for _, start, end in found]


def _flow(text: str, start: int, end: int, special: dict[str, _Reader]) -> list[Place]:
    """Plain and quoted scalars: folded lines, and one special character that begins a sequence."""
    found: list[Place] = []
    at = start
    while at < end:
        char = text[at]
        if char in special:
            read, at = special[char](text, at)
            found += read
        elif char in " \t\r\n":
            blank = _BLANK.match(text, at, end)
            assert blank is not None, "the pattern matches this character"
            found += _blanks(blank.group(), at, blank.end())
            at = blank.end()
        else:
            found.append((char, at, at + 1))
            at += 1
    return found


def _blanks(written: str, start: int, end: int) -> list[Place]:
    """Blanks within a line stay; one line break is a space; each further one is a line break."""
    breaks = len(_BREAK.findall(written))
    if not breaks:
        return [(char, at, at + 1) for at, char in enumerate(written, start)]
    return [(" ", start, end)] if breaks == 1 else [("\n", start, end)] * (breaks - 1)


def _doubled(text: str, at: int) -> tuple[list[Place], int]:
    return [("'", at, at + 2)], at + 2


def _escaped(text: str, at: int) -> tuple[list[Place], int]:
    if join := _JOIN.match(text, at):
        breaks = len(_BREAK.findall(join.group(1)))
        return [("\n", at, join.end())] * breaks, join.end()
    escape = _ESCAPE.match(text, at)
    assert escape is not None, "the YAML reader let a lone backslash through"
    code = escape.group()[1:]
    char = chr(int(code[1:], 16)) if len(code) > 1 else _ESCAPES.get(code, code)
    return [(char, at, escape.end())], escape.end()


def _block(text: str, scalar: ScalarNode) -> list[Place]:
    """Literal (`|`) and folded (`>`) scalars, line by line as the YAML standard's section 8.1."""
    header = _BREAK.search(text, scalar.start, scalar.end)
    if header is None:
        return []
    lines = _block_lines(text, header.end(), _indentation(text, header.end(), scalar.value))
    found: list[Place] = []
    pending: list[Place] = []  # line breaks after the last line of text
    was_indented = False
    for content, line_break in lines:
        if not content:
            pending += line_break
            continue
        is_indented = content[0][0] in " \t"
        foldable = scalar.style == ">" and not was_indented and not is_indented
        if foldable and found and pending:
            first, *rest = pending
            pending = rest or [(" ", first[1], content[0][1])]
        found += pending + content
        pending = list(line_break)
        was_indented = is_indented
    return found + pending


def _block_lines(text: str, at: int, indent: int) -> list[tuple[list[Place], list[Place]]]:
    """Return the characters of each line beyond the indentation, and its line break if it has one."""
    lines: list[tuple[list[Place], list[Place]]] = []
    while at < len(text):
        stop = _BREAK.search(text, at)
        end = stop.start() if stop else len(text)
        body = text[at:end]
        lead = len(body) - len(body.lstrip(" "))
        if lead < indent and lead < len(body):
            break
        start = min(at + indent, end)
        line_break = [("\n", stop.start(), stop.end())] if stop else []
        lines.append(([(text[i], i, i + 1) for i in range(start, end)], line_break))
        at = stop.end() if stop else len(text)
    return lines


def _indentation(text: str, at: int, value: str) -> int:
    """Return how far a block scalar is indented: its first text in the file, against that in the value."""
    first = re.compile(r"[^ \r\n]").search(text, at)
    inner = re.compile(r"[^ \n]").search(value)
    if first is None or inner is None:
        return 0
    return _lead(text, first.start()) - _lead(value, inner.start())


def _lead(text: str, at: int) -> int:
    """Return how many spaces stand directly before a position."""
    return at - len(text[:at].rstrip(" "))
