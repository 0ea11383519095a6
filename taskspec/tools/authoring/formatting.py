"""The layout of specs: one space where the printed form of an expression has one, and columns under each other in tables.

Only spaces within lines change: comments, quotes, brackets, line breaks and the order of everything stay.
"""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, pairwise
from typing import Any, TypeAlias

from taskspec.base.diagnostics import Diagnostic, Fix, SpecError
from taskspec.base.files import write_text
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import parse
from taskspec.language.source import Document, Path, read_text
from taskspec.language.source.document import compose
from taskspec.language.source.nodes import MappingNode, Node, ScalarNode, SequenceNode
from taskspec.show.printers import text as printed
from taskspec.tools.authoring.analysis import analyse

LONGEST = 120
"""Characters of a line; tables whose aligned rows would be longer stay as they are."""

_TOKEN = re.compile(
    r"""(?P<comment>\#.*)
      | (?P<quoted>"[^"]*"|'[^']*')
      | (?P<number>\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?:/\d+(?![\w.]))?)  # a fraction of two numbers stays together
      | (?P<word>[^\W\d]\w*'?)
      | (?P<sign>\*\*|//|[<>=!]=|[-+*/%<>=])
      | (?P<open>[(\[{])
      | (?P<close>[)\]}])
      | (?P<other>\S)""",
    re.VERBOSE,
)
_KEYWORDS = frozenset({"and", "or", "not", "in", "if", "else", "for"})
_Row: TypeAlias = tuple[ScalarNode | None, Node]
"""A list in a list of lists, or the cells of a row of a decision table with its key."""


def formatted(text: str, name: str = "<string>") -> str:
    """Return the text of a spec in its usual layout; a text that has it stays as it is.

    Args:
        text: the text of the spec.
        name: its file, from which the files that it extends are found.

    Raises:
        SpecError: when the text is not YAML.
    """
    document = read_text(text, name)
    spaced = fixed(text, _spaces(document))
    root = compose(spaced).root
    result = spaced
    if root is not None:
        result = spliced(spaced, _padding(root, spaced))
    if _bare(read_text(result, name)) != _bare(document):
        return text
    return result


def _bare(document: Document) -> str:
    return "".join(repr(document.data).split())


# -- expressions --------------------------------------------------------------------------------------------------


def _spaces(document: Document) -> set[Fix]:
    name = document.origin.name
    attempts = analyse(document.origin.text, name).attempts
    texts = []
    for attempt in attempts:
        texts += [expr.place.text for expr in attempt.merged.parsed.values()]
    for path, claim in _claims(document.data, ()):
        texts.append(s.SourceText(claim, lambda start, end, path=path: document.span(path, start, end)))  # type: ignore[misc]
    fixes: set[Fix] = set()
    for text in texts:
        fixes |= set(_spaces_of(text, name))
    return fixes


def _claims(value: Any, path: Path) -> Iterator[tuple[Path, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _claims(inner, (*path, key))
    elif isinstance(value, list) and "claims" in path:
        for at, inner in enumerate(value):
            yield from _claims(inner, (*path, at))
    elif isinstance(value, str) and "claims" in path and (path[-1] == "claim" or isinstance(path[-1], int)):
        yield path, value


def _spaces_of(text: s.SourceText, name: str) -> Iterator[Fix]:
    """Yield the changes of one expression; none where its meaning or its place in the file is in doubt."""
    changes = []
    for start, end, gap in _gaps(text.value):
        present = text.value[start:end]
        if present != gap and "\n" not in present:
            changes.append((start, end, gap))
    if not changes:
        return
    try:
        if printed(parse(s.SourceText(spliced(text.value, changes), text.locate))) != printed(parse(text)):
            return
    except SpecError:
        return
    for start, end, gap in changes:
        span = text.locate(start, end)
        marked = span.origin.line(span.line)[span.column - 1 : span.end_column - 1]
        if span.origin.name == name and span.line == span.end_line and marked == text.value[start:end]:
            yield Fix(span, gap)


def _gaps(value: str) -> Iterator[Change]:
    around: list[str] = []
    is_operand = False  # what stands before can be the left side of an operator
    for before, token in pairwise(_TOKEN.finditer(value)):
        left = before.group()
        right = token.group()
        kinds = (before.lastgroup, token.lastgroup)
        if kinds[0] == "open":
            around.append(left)
        elif kinds[0] == "close" and around:
            around.pop()
        is_sign = left in ("+", "-") and not is_operand
        is_operand = kinds[0] in ("number", "quoted", "close", "word") and left not in _KEYWORDS
        if "comment" in kinds:
            continue
        is_called = is_operand and right in ("(", "[")
        is_slice = left == ":" and around[-1:] != ["{"]
        is_edge = kinds[0] == "open" or kinds[1] == "close" or right in (",", ":")
        is_tight = is_sign or is_called or is_slice or is_edge or left in ("**", "=") or right in ("**", "=")
        gap = "" if is_tight else " "
        yield before.end(), token.start(), gap


# -- tables -------------------------------------------------------------------------------------------------------


def _padding(root: Node, text: str) -> list[Change]:
    """Return the changes that put the cells of rows under each other: of lists of lists, and of decision tables."""
    if isinstance(root, ScalarNode):
        return []
    rows: list[_Row] = []
    if isinstance(root, SequenceNode):
        inner = root.items
        rows = [(None, item) for item in inner]
    else:
        inner = [value for _, value in root.entries]
        table = None
        if "rows" in root.index:
            table = root.index["rows"][1]
        if isinstance(table, MappingNode) and not table.flow:
            rows = [*table.entries]
    changes: list[Change] = []
    for each in inner:
        changes += _padding(each, text)
    for shape, alike in groupby(rows, key=lambda row: _shape(row, text)):
        if len(shape) > 1:
            changes += _columns(list(alike), text)
    return changes


def _shape(row: _Row, text: str) -> tuple[Any, ...]:
    """Return what rows that are aligned have in common; nothing for one that is not between brackets on one line."""
    key, node = row
    if isinstance(node, ScalarNode) or not node.flow or "\n" in text[node.start : node.end]:
        return ()
    if isinstance(node, SequenceNode):
        if key is None:
            return (_column(text, node.start), *range(len(node.items)))
        return ()
    if key is not None:
        return tuple(name.value for name, _ in node.entries)
    return ()


def _columns(rows: Sequence[_Row], text: str) -> list[Change]:
    """Return the changes that align rows; none where a line would become too long."""
    lines = [_cells(node) for _, node in rows]
    widths = [0] * len(lines[0])
    begin = 0
    for (key, node), cells in zip(rows, lines, strict=True):
        for i, (start, end) in enumerate(cells):
            widths[i] = max(widths[i], end - start)
        if key is None:
            begin = max(begin, _column(text, node.start))
        else:
            begin = max(begin, _column(text, key.end + len(": ")))
    if begin + sum(widths) + len(", ") * len(widths) > LONGEST:
        return []
    changes: list[Change] = []
    for (key, node), cells in zip(rows, lines, strict=True):
        if key is not None:
            changes.append((key.end, node.start, ":".ljust(begin - _column(text, key.end))))
        for (start, end), (following, _), width in zip(cells, cells[1:], widths, strict=False):
            changes.append((end, following, ", ".ljust(width - (end - start) + len(", "))))
    for start, end, gap in changes:
        if text[start:end].strip() != gap.strip():
            return []
    return changes


def _cells(node: Node) -> list[tuple[int, int]]:
    if isinstance(node, SequenceNode):
        return [(item.start, item.end) for item in node.items]
    if isinstance(node, MappingNode):
        return [(name.start, value.end) for name, value in node.entries]
    return []


def _column(text: str, at: int) -> int:
    return at - text.rfind("\n", 0, at) - 1


# -- fixes of mistakes whose hints say what to write ------------------------------------------------------------------

Change: TypeAlias = tuple[int, int, str]
"""Where a piece of a text begins and ends, and what is to stand there."""
_LINE_END = re.compile(r"\r\n|\r|\n")


def fixed(text: str, fixes: Iterable[Fix]) -> str:
    """Return a text with fixes put in; of two that overlap, the first is."""
    starts = [0, *(match.end() for match in _LINE_END.finditer(text))]
    changes = []
    for span, replacement in fixes:
        start = starts[span.line - 1] + span.column - 1
        changes.append((start, starts[span.end_line - 1] + span.end_column - 1, replacement))
    return spliced(text, changes)


def spliced(text: str, changes: Iterable[Change]) -> str:
    """Return a text with pieces of it replaced; of two that overlap, the first is."""
    pieces = []
    done = 0
    for start, end, replacement in sorted(changes):
        if start >= done:
            pieces += [text[done:start], replacement]
            done = end
    return "".join([*pieces, text[done:]])


def fix_files(problems: Iterable[Diagnostic]) -> int:
    """Put the fixes of errors into the files that they are about, and return their number."""
    by_file: dict[str, set[Fix]] = {}
    for each in problems:
        fix = each.fix
        if fix is not None and each.severity == "error":
            by_file.setdefault(fix.span.origin.name, set()).add(fix)
    for name, fixes in by_file.items():
        path = pathlib.Path(name)
        with path.open(encoding="utf-8", newline="") as file:
            text = file.read()
        write_text(path, fixed(text, fixes))
    return sum(map(len, by_file.values()))
