"""Diagnostics: a place in a text, a code from a closed table, a message and a hint; and how they are rendered.

Columns and offsets count characters (code points), lines and columns start at 1, and ends are exclusive.
"""

from __future__ import annotations

import difflib
import re
import textwrap
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, NamedTuple, Protocol

from taskspec.base.codes import Severity, codes, severity
from taskspec.base.display import visible, visible_json

__all__ = [
    "Advice", "Diagnostic", "Fix", "Format", "Origin", "Severity", "Span", "SpecError", "TaskspecError",
    "render",
]  # fmt: skip

Format = Literal["text", "json", "github"]
"""How diagnostics are written out."""


_LINE_END = re.compile(r"\r\n|\r|\n")
_EXCERPT_WIDTH = 100
_GUTTER = len("12345 | ") + 2  # and an ellipsis on either side
_COLORS = {"error": "\x1b[1;31m", "warning": "\x1b[1;33m", "dim": "\x1b[2m", "reset": "\x1b[0m"}


@dataclass(frozen=True, slots=True)
class Origin:
    """A text that diagnostics can point into, under the name its author knows it by."""

    name: str
    text: str

    def line(self, number: int) -> str:
        """Return the line with this number (from 1) without its line end; empty past the last line."""
        lines = _lines(self.text)
        if 1 <= number <= len(lines):
            return lines[number - 1]
        return ""


@lru_cache(maxsize=8)
def _lines(text: str) -> list[str]:
    return _LINE_END.split(text)


@dataclass(frozen=True, slots=True)
class Span:
    """A range of characters in a text: 1-based lines and columns, end exclusive."""

    origin: Origin
    line: int
    column: int
    end_line: int
    end_column: int

    @property
    def span(self) -> Span:
        """Itself, so that a span can stand wherever a placed thing can."""
        return self

    def __str__(self) -> str:
        return f"{self.origin.name}:{self.line}:{self.column}"


class Advice(str):
    """A hint that says what to write: `replacement` in the place of `replaced`, a part of the text that is marked."""

    replaced: str
    replacement: str

    def __new__(cls, hint: str, replaced: str = "", replacement: str = "") -> Advice:
        advice = super().__new__(cls, hint)
        advice.replaced = replaced
        advice.replacement = replacement
        return advice


class Fix(NamedTuple):
    """A place, and the text to write there."""

    span: Span
    replacement: str


class Placed(Protocol):
    """Anything that knows where it was written."""

    @property
    def span(self) -> Span | None: ...


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One problem: which situation, where, what is wrong, and how to put it right."""

    code: str
    span: Span | None
    message: str
    hint: str | None = None
    notes: tuple[str, ...] = ()

    @property
    def severity(self) -> Severity:
        """`warning` for the W codes, `error` for all others."""
        return severity(self.code)

    @property
    def fix(self) -> Fix | None:
        """The replacement that the hint gives; None unless the text that it replaces occurs exactly once in the marked line."""
        span = self.span
        if span is None or span.line != span.end_line or not isinstance(self.hint, Advice):
            return None
        marked = span.origin.line(span.line)[span.column - 1 : span.end_column - 1]
        replaced = self.hint.replaced
        before = ""
        if replaced[:1].isalnum():
            before = r"(?<!\w)"
        after = ""
        if replaced[-1:].isalnum():
            after = r"(?!\w)"
        places = list(re.finditer(before + re.escape(replaced) + after, marked))
        if not replaced or len(places) != 1:
            return None
        start = span.column + places[0].start()
        return Fix(replace(span, column=start, end_column=start + len(replaced)), self.hint.replacement)


class TaskspecError(Exception):
    """Base of every error that this package raises deliberately."""


class SpecError(TaskspecError, ValueError):
    """A spec is wrong. `diagnostics` holds every problem found, in order of place."""

    diagnostics: tuple[Diagnostic, ...]

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = in_order(diagnostics)
        super().__init__(self.diagnostics)

    @property
    def codes(self) -> list[str]:
        """Codes of the diagnostics, such as `E703`, in their order."""
        return [each.code for each in self.diagnostics]

    def __str__(self) -> str:
        return render(self.diagnostics)


def spec_error(code: str, message: str, hint: str | None = None) -> SpecError:
    """Return an error with one diagnostic that has no place in a file."""
    return SpecError([Diagnostic(code, None, message, hint)])


class Collector:
    """Gathers diagnostics, so that one pass reports every problem and not only the first."""

    def __init__(self) -> None:
        self._found: list[Diagnostic] = []

    def add(
        self, code: str, place: Placed | None, message: str, hint: str | None = None, notes: Iterable[str] = ()
    ) -> None:
        """Record a problem. `place` is a span, anything that has one, or None for no place."""
        if code not in codes():
            raise KeyError(f"no diagnostic code {code!r} in the table")
        span = None
        if place is not None:
            span = place.span
        self._found.append(Diagnostic(code, span, message, hint, tuple(notes)))

    def extend(self, diagnostics: Iterable[Diagnostic]) -> None:
        """Record problems found elsewhere."""
        self._found.extend(diagnostics)

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """The recorded diagnostics, sorted by place, without duplicates."""
        return in_order(self._found)

    @property
    def has_errors(self) -> bool:
        return has_errors(self._found)

    def raise_if_errors(self) -> None:
        """Raise SpecError with everything recorded, if any of it is an error."""
        raise_if_errors(self._found)


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Return whether any diagnostic is an error (warnings do not count)."""
    return any(each.severity == "error" for each in diagnostics)


def raise_if_errors(diagnostics: Sequence[Diagnostic]) -> None:
    """Raise SpecError with all diagnostics, if any is an error (warnings do not count)."""
    if has_errors(diagnostics):
        raise SpecError(diagnostics)


def in_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Sort diagnostics by place (those without one first), each only once; the sort is stable."""

    def place(diagnostic: Diagnostic) -> tuple[str, int, int]:
        span = diagnostic.span
        if span is not None:
            return (span.origin.name, span.line, span.column)
        return ("", 0, 0)

    return tuple(sorted(dict.fromkeys(diagnostics), key=place))


def suggest(name: str, candidates: Iterable[str]) -> Advice | None:
    """Return `did you mean 'x'?` for the nearest candidate, or None when none is near."""
    near = nearest(name, candidates)
    if near is not None:
        return Advice(f"did you mean {near!r}?", name, near)
    return None


def nearest(name: str, candidates: Iterable[str]) -> str | None:
    """Choose the candidate nearest to an unknown name; None when none is near."""
    known = list(candidates)
    by_lower = {each.lower(): each for each in reversed(known)}
    if name.lower() in by_lower:
        return by_lower[name.lower()]
    begun = [each for each in known if each.rpartition("/")[2].lower().startswith(name.lower())]
    if begun and len(name) > 2:
        return min(begun, key=len)
    cutoff = 0.6
    if len(name) <= 4:  # a short name is alike to any long one that has its letters
        cutoff = 0.5
        known = [each for each in known if len(each) < 2 * len(name) or each.startswith(name)]
    matches = difflib.get_close_matches(name, known, n=1, cutoff=cutoff)
    if matches:
        return matches[0]
    return None


def render(
    diagnostics: Iterable[Diagnostic], format: Format = "text", color: bool = False, width: int | None = None
) -> str:
    """Render diagnostics as text, as a JSON array, or as GitHub workflow commands.

    Args:
        diagnostics: in this order.
        format: "text", "json" or "github".
        color: whether text has the colours of a terminal.
        width: the width of the terminal to wrap text for; without one, sentences stay on one line.

    Returns:
        the text, without a newline at its end.
    """
    match format:
        case "text":
            return "\n".join(_text(each, color, width) for each in hints_once(diagnostics))
        case "json":
            return visible_json(records(diagnostics))
        case "github":
            return "\n".join(map(_github, diagnostics))
    raise ValueError(f"unknown format {format!r}: one of 'text', 'json', 'github'")


def hints_once(diagnostics: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    known: set[tuple[str, str]] = set()
    for each in diagnostics:
        name = ""
        if each.span is not None:
            name = each.span.origin.name
        if each.hint is None or (name, each.hint) not in known:
            yield each
        else:
            yield replace(each, hint=None)
        known.add((name, each.hint or ""))


def _text(diagnostic: Diagnostic, color: bool, width: int | None) -> str:
    code = codes()[diagnostic.code]
    span = diagnostic.span
    paint = _COLORS
    if not color:
        paint = dict.fromkeys(_COLORS, "")
    place = ""
    if span is not None:
        place = f"{visible(str(span), keep='')}: "
    name = f"{code.severity}[{code.code} {code.slug}]"
    lines = []
    if width is not None and _width(f"{place}{name}:") > width:  # a long path stands alone
        lines.append(place.rstrip())
        place = "    "
    message = _wrapped(visible(diagnostic.message), width, _width(f"{place}{name}: "), 4)
    gap = " "
    if message.startswith("\n"):
        gap = ""
    lines.append(f"{place}{paint[code.severity]}{name}{paint['reset']}:{gap}{message}")
    remarks = [("note", note) for note in diagnostic.notes]
    if diagnostic.hint is not None:
        remarks.insert(0, ("hint", diagnostic.hint))
    if span is not None:
        room = _EXCERPT_WIDTH
        if width is not None:
            room = min(room, max(20, width - _GUTTER))
        excerpt, pad = _excerpt(span, room)
        marks = f"{paint[code.severity]}{pad}{paint['reset']}"
        hint = diagnostic.hint
        if hint is not None and "\n" not in hint and len(pad) + len(visible(hint)) < room:
            marks += f" {visible(hint)}"
            del remarks[0]
        lines.append(f"{span.line:>5} | {excerpt}".rstrip())
        lines.append(f"{' ' * max(5, len(str(span.line)))} | {marks}")
    for kind, text in remarks:
        under = len(f"      = {kind}: ")
        parts = [_wrapped(line, width, under, under) for line in visible(text).split("\n")]
        lines.append(f"      {paint['dim']}={paint['reset']} {kind}: " + f"\n{' ' * under}".join(parts))
    return "\n".join(lines)


def _wrapped(text: str, width: int | None, used: int, indent: int) -> str:
    if width is None or used + _width(text) <= width:
        return text

    lead = " " * used
    margin = " " * indent
    room = max(width, indent + 20)
    if used + _width(text.split(" ")[0]) > width:  # no room beside a long path
        return "\n" + textwrap.fill(f"{margin}{text}", room, subsequent_indent=margin)
    wrapped = textwrap.fill(text, room, initial_indent=lead, subsequent_indent=margin, break_long_words=False)
    return wrapped[used:]


def _excerpt(span: Span, room: int) -> tuple[str, str]:
    line = span.origin.line(span.line).replace("\t", " ")
    start = min(span.column - 1, len(line))
    if span.end_line == span.line:
        end = min(span.end_column - 1, len(line))
    else:
        end = len(line)
    near = line[max(0, start - room) : start + room]
    if not near.isascii() and _width(visible(near, keep="")) > len(near):
        room //= 2  # wide characters take two columns
    first = 0
    if len(line) > room and end > room // 2:
        first = max(0, start - room // 2)
    last = first + room
    head = "…" if first else ""
    tail = "…" if last < len(line) else ""
    pad = " " * _width(head + visible(line[first:start], keep=""))
    marks = "^" * max(1, _width(visible(line[start : min(end, last)], keep="")))
    return head + visible(line[first:last], keep="") + tail, pad + marks


def _width(text: str) -> int:
    """Return the columns of a text in a terminal: wide characters take two, combining ones none."""
    columns = 0
    for char in text:
        if not unicodedata.combining(char):
            columns += 1 + (unicodedata.east_asian_width(char) in "WF")
    return columns


def records(diagnostics: Iterable[Diagnostic]) -> list[dict[str, object]]:
    """Return diagnostics as plain data."""
    rows = []
    for each in diagnostics:
        code = codes()[each.code]
        place: dict[str, object] = dict.fromkeys(("file", "line", "column", "end_line", "end_column"))
        span = each.span
        if span is not None:
            place = {"file": span.origin.name, "line": span.line, "column": span.column}
            place |= {"end_line": span.end_line, "end_column": span.end_column}
        about = {"code": each.code, "slug": code.slug, "severity": code.severity, "message": each.message}
        rows.append({**about, "hint": each.hint, "notes": list(each.notes), **place})
    return rows


def _github(diagnostic: Diagnostic) -> str:
    """Return a workflow command `::error file=...,line=...::message`, escaped as GitHub requires."""
    code = codes()[diagnostic.code]
    span = diagnostic.span
    fields: dict[str, object] = {}
    if span is not None:
        fields = {"file": span.origin.name, "line": span.line, "endLine": span.end_line}
        if span.line == span.end_line:  # GitHub refuses columns on a range of several lines
            fields |= {"col": span.column, "endColumn": span.end_column}
    fields["title"] = f"{code.code} {code.slug}"
    parts = []
    for key, value in fields.items():
        parts.append(f"{key}=" + _escaped(str(value)).replace(":", "%3A").replace(",", "%2C"))
    text = "\n".join(filter(None, (diagnostic.message, diagnostic.hint, *diagnostic.notes)))
    return f"::{code.severity} {','.join(parts)}::{_escaped(text)}"


def _escaped(text: str) -> str:
    return visible(text, keep="\r\n").replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
