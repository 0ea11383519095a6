"""Diagnostics: a place in a text, a code from a closed table, a message and a hint; and how they are rendered.

The bottom layer: it imports nothing of the package but the table of codes. Columns and offsets
count characters (code points), lines and columns start at 1, and ends are exclusive.
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import accumulate
from typing import Literal, Protocol

from taskspec.base.codes import CODES as CODES
from taskspec.base.codes import Code as Code
from taskspec.base.codes import Severity as Severity
from taskspec.base.display import visible, visible_json
from taskspec.base.records import dataclass

__all__ = [
    "CODES",
    "Code",
    "Diagnostic",
    "Format",
    "Origin",
    "Severity",
    "Span",
    "SpecError",
    "TaskspecError",
    "render",
]

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
        return lines[number - 1] if 1 <= number <= len(lines) else ""


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
        """`error` or `warning`, as the table of codes says."""
        return CODES[self.code].severity


class TaskspecError(Exception):
    """Base of every error that this package raises deliberately."""


class SpecError(TaskspecError, ValueError):
    """A spec is wrong. `diagnostics` holds every problem found, in order of place."""

    diagnostics: tuple[Diagnostic, ...]

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = in_order(diagnostics)
        super().__init__(self.diagnostics)

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
        self,
        code: str,
        place: Placed | None,
        message: str,
        hint: str | None = None,
        notes: Iterable[str] = (),
    ) -> None:
        """Record a problem. `place` is a span, anything that has one, or None for no place."""
        if code not in CODES:
            raise KeyError(f"no diagnostic code {code!r} in the table")
        span = None if place is None else place.span
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
        """Whether anything recorded is an error (warnings do not count)."""
        return has_errors(self._found)

    def raise_if_errors(self) -> None:
        """Raise SpecError with everything recorded, if any of it is an error."""
        raise_if_errors(self._found)


def has_errors(found: Iterable[Diagnostic]) -> bool:
    """Return whether any diagnostic is an error (warnings do not count)."""
    return any(each.severity == "error" for each in found)


def raise_if_errors(found: Sequence[Diagnostic]) -> None:
    """Raise SpecError with all diagnostics, if any is an error (warnings do not count)."""
    if has_errors(found):
        raise SpecError(found)


def in_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Sort diagnostics by place (those without one first), each only once; the sort is stable."""
    return tuple(sorted(dict.fromkeys(diagnostics), key=_place_key))


def _place_key(diagnostic: Diagnostic) -> tuple[str, int, int]:
    span = diagnostic.span
    return ("", 0, 0) if span is None else (span.origin.name, span.line, span.column)


def suggest(name: str, candidates: Iterable[str]) -> str | None:
    """Return `did you mean 'x'?` for the nearest candidate, or None when none is near."""
    near = nearest(name, candidates)
    return None if near is None else f"did you mean {near!r}?"


def nearest(name: str, candidates: Iterable[str]) -> str | None:
    """Return the candidate nearest to an unknown name, or None when none is near."""
    known = list(candidates)
    by_lower = {each.lower(): each for each in reversed(known)}
    if name.lower() in by_lower:
        return by_lower[name.lower()]
    is_short = len(name) <= 4  # a short name is alike to any long one that has its letters
    alike = [each for each in known if not is_short or len(each) < 2 * len(name) or each.startswith(name)]
    found = difflib.get_close_matches(name, alike, n=1, cutoff=0.5 if is_short else 0.6)
    return found[0] if found else None


def render(
    diagnostics: Iterable[Diagnostic],
    format: Format = "text",
    color: bool = False,
    width: int | None = None,
) -> str:
    """Render diagnostics as text, as a JSON array, or as GitHub workflow commands.

    Args:
        format: "text", "json" or "github".
        color: whether text has the colours of a terminal.
        width: the width of the terminal to wrap text for; without one, sentences stay on one line.
    """
    match format:
        case "text":
            return "\n".join(_text(each, color, width) for each in diagnostics)
        case "json":
            return visible_json([_record(each) for each in diagnostics])
        case "github":
            return "\n".join(_github(each) for each in diagnostics)
    raise ValueError(f"unknown format {format!r}: one of 'text', 'json', 'github'")


def _text(diagnostic: Diagnostic, color: bool, width: int | None) -> str:
    code = CODES[diagnostic.code]
    room = _EXCERPT_WIDTH if width is None else min(_EXCERPT_WIDTH, max(20, width - _GUTTER))
    paint = _COLORS if color else dict.fromkeys(_COLORS, "")
    place = "" if diagnostic.span is None else f"{visible(str(diagnostic.span), keep='')}: "
    title = f"{paint[code.severity]}{code.severity}[{code.code} {code.slug}]{paint['reset']}"
    used = len(f"{place}{code.severity}[{code.code} {code.slug}]: ")
    lines = [f"{place}{title}: {_broken(visible(diagnostic.message), width, used, 4)}"]
    remarks = [("note", note) for note in diagnostic.notes]
    hint = diagnostic.hint
    if diagnostic.span is not None:
        excerpt, pad = _excerpt(diagnostic.span, room)
        marks = paint[code.severity] + pad + paint["reset"]
        number = str(diagnostic.span.line)
        margin = " " * max(5, len(number))
        if hint is not None and "\n" not in hint and len(pad) + len(visible(hint)) < room:
            marks = f"{marks} {visible(hint)}"
            hint = None
        lines += [f"{number:>5} | {excerpt}".rstrip(), f"{margin} | {marks}"]
    if hint is not None:
        remarks.insert(0, ("hint", hint))
    return "\n".join(lines + [_remark(kind, text, paint, width) for kind, text in remarks])


def _remark(kind: str, text: str, paint: dict[str, str], width: int | None) -> str:
    lead = f"      {paint['dim']}={paint['reset']} {kind}: "
    under = len(f"      = {kind}: ")
    lines = [_broken(line, width, under, under) for line in visible(text).split("\n")]
    return lead + f"\n{' ' * under}".join(lines)


def _broken(text: str, width: int | None, used: int, indent: int) -> str:
    """Wrap text between words: the first line starts at column `used`, the others are indented."""
    if width is None or used + _width(text) <= width:
        return text
    lead = " " * used
    margin = " " * indent
    if used + _width(text.split(" ")[0]) > width:  # no room beside a long path
        lead = ""
        text = f"{margin}{text}"
    import textwrap

    lines = textwrap.wrap(text, max(width, indent + 20), initial_indent=lead, subsequent_indent=margin)
    return "\n".join(lines)[used:] if lead else "\n" + "\n".join(lines)


def _excerpt(span: Span, room: int) -> tuple[str, str]:
    """Return the line a span starts on (a window of it when long) and the carets under it."""
    line = span.origin.line(span.line)
    skipped = max(0, span.column - 1 - 2 * room)  # a line may have a million characters
    near = line[skipped : skipped + 5 * room]
    start = min(span.column - 1 - skipped, len(near))
    end = min(span.end_column - 1 - skipped, len(near)) if span.end_line == span.line else len(near)
    cells = [" " if char == "\t" else visible(char, keep="") for char in near]
    edges = [0, *accumulate(map(_width, cells))]  # columns before each character
    whole = not skipped and ((len(near) == len(line) and edges[-1] <= room) or edges[end] <= room // 2)
    first = 0 if whole else bisect_left(edges, edges[start] - room // 2)
    last = max(first + 1, bisect_right(edges, edges[first] + room) - 1)
    head = "…" if skipped + first else ""
    tail = "…" if skipped + last < len(line) else ""
    marked = edges[max(start, min(end, last))] - edges[start]
    pad = " " * (len(head) + edges[start] - edges[first])
    return head + "".join(cells[first:last]) + tail, pad + "^" * max(1, marked)


def _width(text: str) -> int:
    """Return the columns of a text in a terminal: wide characters take two, combining ones none."""
    return sum(0 if unicodedata.combining(char) else 1 + (unicodedata.east_asian_width(char) in "WF") for char in text)


def _record(diagnostic: Diagnostic) -> dict[str, object]:
    span = diagnostic.span
    return {
        "code": diagnostic.code,
        "slug": CODES[diagnostic.code].slug,
        "severity": diagnostic.severity,
        "message": diagnostic.message,
        "hint": diagnostic.hint,
        "notes": list(diagnostic.notes),
        "file": span and span.origin.name,
        "line": span and span.line,
        "column": span and span.column,
        "end_line": span and span.end_line,
        "end_column": span and span.end_column,
    }


def _github(diagnostic: Diagnostic) -> str:
    """Return a workflow command `::error file=...,line=...::message`, escaped as GitHub requires."""
    code = CODES[diagnostic.code]
    span = diagnostic.span
    fields: dict[str, object] = {}
    if span is not None:
        fields = {"file": span.origin.name, "line": span.line, "endLine": span.end_line}
        if span.line == span.end_line:  # GitHub refuses columns on a range of several lines
            fields |= {"col": span.column, "endColumn": span.end_column}
    fields["title"] = f"{code.code} {code.slug}"
    head = ",".join(f"{key}={_escape_property(str(value))}" for key, value in fields.items())
    parts = [diagnostic.message, *([diagnostic.hint] if diagnostic.hint else []), *diagnostic.notes]
    return f"::{code.severity} {head}::{_escape_data(chr(10).join(parts))}"


def _escape_data(text: str) -> str:
    return visible(text, keep="\r\n").replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _escape_property(text: str) -> str:
    return _escape_data(text).replace(":", "%3A").replace(",", "%2C")
