"""YAML values -> surface syntax: texts, numbers, vectors, `if:`/`then:` lists, `by:`/`rows:` tables, probabilities.

Each value is looked at once: its form follows from what it is, and what is wrong with that form is reported there.
"""

from __future__ import annotations

import re
from keyword import iskeyword
from typing import Any

from taskspec.base.diagnostics import Collector, Span, SpecError
from taskspec.base.limits import limits
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import literal, parse, parse_into
from taskspec.language.source import Path
from taskspec.language.task.merge import Merged
from taskspec.language.task.schema import values
from taskspec.language.task.schema.values import Problem

_FOR = re.compile(r"\sfor\s")
_CASE = frozenset(("if", "then", "else"))
_TABLE = frozenset(("by", "rows"))
Tree = dict[str, Any] | list[Any] | str | int | float | bool | None


class Forms:
    """Reads the expressions of one merged spec; mistakes go to the collector."""

    def __init__(self, merged: Merged, collector: Collector) -> None:
        self.merged = merged
        self.collector = collector
        self.labels: frozenset[str] = frozenset()
        """Labels that are no names (`very cross`, `go-left`): alone, such a text is the label and no expression."""

    def expr(self, path: Path) -> s.Expr | None:
        """Read the expression at a path; None for a broken one (reported)."""
        return self.tree(self.value(path), path)

    def optional(self, path: Path) -> s.Expr | None:
        """Read the expression at a path; None for a broken one (reported), or without one."""
        if self.value(path[:-1]).get(path[-1]) is None:
            return None
        return self.expr(path)

    def value(self, path: Path) -> Any:
        node: Any = self.merged.data
        for step in path:
            node = node[step]
        return node

    def text(self, path: Path, value: str) -> s.SourceText:
        return s.SourceText(value, lambda start, end: self.merged.span(path, start, end))

    def place(self, path: Path) -> s.Place:
        """Span of the whole value at a path."""
        return s.Place(s.SourceText("", lambda start, end: self.merged.span(path)), 0, 0)

    def report(self, problem: Problem, path: Path) -> None:
        if problem.of_key:
            place = self.merged.key_span
        else:
            place = self.merged.span
        self.collector.add(problem.code, place((*path, *problem.path)), problem.message, problem.hint)

    def tree(self, value: Tree, path: Path) -> s.Expr | None:
        match value:
            case None | "":
                self.report(values.wrong_kind("an expression", None), path)
            case bool() | int() | float():
                return literal(value, s.SourceText(str(value), lambda start, end: self.merged.span(path)))
            case str() if value.strip() in self.labels:
                return s.Quoted(value.strip(), self.place(path))
            case str():
                return self.parsed(self.text(path, value), path)
            case list() if any(isinstance(item, dict) and item.keys() & _CASE for item in value):
                return self._cases(value, path)
            case list():
                return self._vector(value, path)
            case dict() if value.keys() & _TABLE:
                return self._table(value, path)
            case dict() if value.keys() & _CASE:
                hint = "write each case with a dash: `- if: ...`, and a last `- else: ...`"
                self.report(Problem("E209", (), "a value by cases is a list", hint), path)
            case dict():
                return self._weights(value, path)
        return None

    def parsed(self, text: s.SourceText, path: Path) -> s.Expr | None:
        """Parse a text; a text without a mistake is parsed once for all builds of the spec."""
        key = (path, text.value, limits().characters)
        syntax: s.Expr | None = self.merged.parsed.get(key) or parse_into(text, self.collector)
        if syntax is not None:
            self.merged.parsed[key] = syntax
        return syntax

    def _vector(self, items: list[Any], path: Path) -> s.Expr | None:
        if len(items) == 1 and isinstance(items[0], str) and _FOR.search(items[0]):
            return self.parsed(self._in_brackets(items[0], (*path, 0)), path)
        exprs = [self.tree(item, (*path, i)) for i, item in enumerate(items)]
        elements = tuple(e for e in exprs if e is not None)
        if len(elements) == len(items):
            return s.Vector(elements, self.place(path))
        return None

    def _in_brackets(self, item: str, path: Path) -> s.SourceText:

        def locate(start: int, end: int) -> Span:
            return self.merged.span(path, max(start - 1, 0), min(end - 1, len(item)))

        return s.SourceText(f"[{item}]", locate)

    # -- cases ----------------------------------------------------------------------------------------------------

    def _cases(self, items: list[Any], path: Path) -> s.Expr | None:
        branches = []
        otherwise = None
        for i, item in enumerate(items):
            here = (*path, i)
            if not isinstance(item, dict):
                message = f"expected a case (`if` and `then`), found {values.kind(item)}"
                self.report(Problem("E209", (), message), here)
                continue
            parts = {}
            for key in ("if", "then", "else"):
                if key in item:
                    parts[key] = self.tree(item[key], (*here, key))
            if self._is_case(item, i == len(items) - 1, here):
                condition = parts.get("if")
                then = parts.get("then")
                otherwise = parts.get("else")
                if condition is not None and then is not None:
                    branches.append((condition, then))
        if otherwise is None or len(branches) < len(items) - 1:
            return None
        if branches:
            return s.Piecewise(tuple(branches), otherwise, self.place(path))
        return otherwise

    def _is_case(self, item: dict[str, Any], is_last: bool, path: Path) -> bool:
        if is_last and "else" not in item:
            hint = "add `- else: ...` for all other cases"
            self.report(Problem("E209", (), "the last case must be `else`", hint), path)
        if "else" not in item:
            return self._has_keys(item, ("if", "then"), "E209", "case", path) and not is_last
        if not is_last:
            self.report(Problem("E209", (), "`else` comes last", None, of_key=True), (*path, "else"))
        if item.keys() & {"if", "then"}:
            hint = "give `else` a dash of its own"
            self.report(Problem("E214", (), "`else` stands alone", hint, of_key=True), (*path, "else"))
            return False
        return self._has_keys(item, ("else",), "E209", "case", path) and is_last

    def _has_keys(self, entry: dict[str, Any], keys: tuple[str, ...], code: str, what: str, path: Path) -> bool:
        for key in entry:
            if key not in keys:
                self.report(values.unknown_key(key, keys), (*path, key))
        lacking = [key for key in keys if key not in entry]
        if lacking:
            self.report(Problem(code, (), f"this {what} has no `{lacking[0]}`"), path)
        return entry.keys() == set(keys)

    # -- probabilities --------------------------------------------------------------------------------------------

    def _weights(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        if not value:
            self.report(Problem("E204", (), "expected an expression, found an empty mapping"), path)
            return None
        pairs = []
        for key, weight in value.items():
            here = (*path, key)
            outcome = self.key(key, here)
            p = self._weight(weight, here)
            if outcome is not None and p is not None:
                pairs.append((outcome, p))
        if len(pairs) == len(value):
            return s.Weights(tuple(pairs), self.place(path))
        return None

    def _weight(self, weight: Tree, path: Path) -> s.Expr | None:
        match weight:
            case dict():
                message = "rows are nested deeper than `by` is long, or a probability is a mapping"
                self.report(Problem("E208", (), message, f"a table stands by itself, not below `{path[-1]}`"), path)
            case list():
                hint = (
                    "a mapping is a draw; a vector for each label is a list of vectors, in order, "
                    "and `ways[a]` is the vector of a label"
                )
                self.report(values.wrong_kind("a probability", weight, hint), path)
            case _:
                return self.tree(weight, path)
        return None

    def key(self, key: str, path: Path) -> s.Expr | None:
        """Read a key of a table or of a distribution: an expression on the left of a colon."""
        text = s.SourceText(str(key), lambda start, end: _part(self.merged.key_span(path), str(key), start, end))
        if key in ("true", "false"):
            return literal(key == "true", text)
        label = s.Quoted(str(key), s.Place(text, 0, len(str(key))))
        if str(key) in self.labels:
            return label
        known = (path, "key", text.value, limits().characters)
        parsed: s.Expr | None = self.merged.parsed.get(known)
        if parsed is not None:
            return parsed
        try:
            parsed = self.merged.parsed[known] = parse(text)
            return parsed
        except SpecError as error:
            if len(str(key).split()) > 1 and not any(c in str(key) for c in "()[]+*/%<>=,"):
                return label  # such as `top left`
            self.collector.extend(error.diagnostics)
            return None

    # -- tables ---------------------------------------------------------------------------------------------------

    def _table(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        is_table = self._has_keys(value, ("by", "rows"), "E208", "table", path)
        by = value.get("by")
        entries = [by]
        if isinstance(by, list):
            entries = by
        if not entries or not all(isinstance(each, str) and each for each in entries):
            if "by" in value:
                problem = Problem("E208", (), "`by` lists what the table looks at", "for example `by: [s, a]`")
                self.report(problem, (*path, "by"))
            return None
        places: list[Path] = [(*path, "by")]
        if isinstance(by, list):
            places = [(*path, "by", i) for i in range(len(by))]
        columns = tuple(column for column in map(self.expr, places) if column is not None)
        rows = None
        if "rows" in value:
            rows = self._rows(value["rows"], len(entries), (*path, "rows"))
        if rows is None or not is_table or len(columns) < len(entries):
            return None
        return s.Table(columns, rows, self.place(path))

    def _rows(self, rows: Any, depth: int, path: Path) -> tuple[s.TableRow, ...] | None:
        if not isinstance(rows, dict) or not rows:
            self.report(Problem("E208", (), f"expected rows (`value: cell`), found {values.kind(rows)}"), path)
            return None
        result: list[s.TableRow] = []
        for key, cell in rows.items():
            here = (*path, key)
            label = None
            if key != "else":
                label = self.key(key, here)
            body = self._cell(cell, depth, here)
            if body is not None and (label is not None or key == "else"):
                result.append(s.TableRow(label, body, self.place(here)))
        if len(result) < len(rows):
            return None
        return tuple(result)

    def _cell(self, cell: Any, depth: int, path: Path) -> s.Expr | tuple[s.TableRow, ...] | None:
        is_rows = isinstance(cell, dict) and bool(cell) and not cell.keys() & _TABLE
        if is_rows and depth > 1:
            return self._rows(cell, depth - 1, path)
        if is_rows and "else" in cell:
            message = "rows are nested deeper than `by` is long"
            self.report(Problem("E208", (), message, "add to `by` what these rows look at"), path)
            return None
        return self.tree(cell, path)


def is_word(label: str) -> bool:
    """Test whether a label reads as a name in expressions; others (`go-left`, `top left`, `in`) read as something else."""
    return label.isidentifier() and not iskeyword(label)


def _part(span: Span, key: str, start: int, end: int) -> Span:
    if span.line != span.end_line or span.end_column - span.column != len(key):
        return span
    return Span(span.origin, span.line, span.column + start, span.line, span.column + end)
