"""YAML values -> surface syntax: texts, numbers, vectors, `if:`/`then:` lists, `by:`/`rows:` tables, probabilities."""

from __future__ import annotations

import re
from keyword import iskeyword
from typing import Any

from taskspec.base.diagnostics import Collector, Span, SpecError
from taskspec.base.limits import limits
from taskspec.lang import syntax as s
from taskspec.lang.parse import literal, parse, parse_into
from taskspec.source import Path
from taskspec.task.merge import Merged

_FOR = re.compile(r"\sfor\s")
Tree = dict[str, Any] | list[Any] | str | int | float | bool | None


class Forms:
    """Reads expressions of one merged spec, whose shape is right; mistakes in texts go to the collector."""

    def __init__(self, merged: Merged, collector: Collector) -> None:
        self.merged = merged
        self.collector = collector
        self.labels: frozenset[str] = frozenset()
        """Labels that are no names (`very cross`, `go-left`): alone, such a text is the label and no expression."""

    def expr(self, path: Path) -> s.Expr | None:
        """Return the expression at a path, or None when it is broken (and reported)."""
        return self.tree(self.value(path), path)

    def value(self, path: Path) -> Any:
        node: Any = self.merged.data
        for step in path:
            node = node[step]
        return node

    def text(self, path: Path, value: str) -> s.SourceText:
        return s.SourceText(value, lambda start, end: self.merged.span(path, start, end))

    def place(self, path: Path) -> s.Place:
        """Return the whole value at a path, as a place."""
        return s.Place(s.SourceText("", lambda start, end: self.merged.span(path)), 0, 0)

    def tree(self, value: Tree, path: Path) -> s.Expr | None:
        match value:
            case bool() | int() | float():
                return literal(value, s.SourceText(str(value), lambda start, end: self.merged.span(path)))
            case str() if value.strip() in self.labels:
                return s.Quoted(value.strip(), self.place(path))
            case str():
                return self._parsed(self.text(path, value), path)
            case list():
                return self._list(value, path)
            case dict():
                return self._table(value, path) if "by" in value else self._weights(value, path)
            case None:
                self.collector.add("E301", self.place(path), "an expression is missing here")
                return None

    def _parsed(self, text: s.SourceText, path: Path) -> s.Expr | None:
        """Return the expression of a text; what is read without a mistake is read once for all builds of the spec."""
        key = (path, text.value, limits().characters)
        found = self.merged.parsed.get(key)
        if found is None:
            found = parse_into(text, self.collector)
            if found is not None:
                self.merged.parsed[key] = found
        return found

    def _list(self, items: list[Any], path: Path) -> s.Expr | None:
        if items and all(isinstance(i, dict) and i.keys() & {"if", "then", "else"} for i in items):
            return self._pieces(items, path)
        if len(items) == 1 and isinstance(items[0], str) and _FOR.search(items[0]):
            return parse_into(self._in_brackets(items[0], (*path, 0)), self.collector)
        exprs = [self.tree(item, (*path, i)) for i, item in enumerate(items)]
        found = tuple(e for e in exprs if e is not None)
        return s.Vector(found, self.place(path)) if len(found) == len(items) else None

    def _in_brackets(self, item: str, path: Path) -> s.SourceText:
        """Return the only text of a list with the brackets of the list: `[f(i) for i in range(n)]` is a comprehension."""

        def locate(start: int, end: int) -> Span:
            return self.merged.span(path, max(start - 1, 0), min(end - 1, len(item)))

        return s.SourceText(f"[{item}]", locate)

    def _pieces(self, items: list[dict[str, Any]], path: Path) -> s.Expr | None:
        """Return the entries `if:` and `then:`, and a last `else:`."""
        last = len(items) - 1
        otherwise = self.tree(items[last]["else"], (*path, last, "else"))
        branches = []
        for i, item in enumerate(items[:last]):
            condition = self.tree(item["if"], (*path, i, "if"))
            then = self.tree(item["then"], (*path, i, "then"))
            if condition is not None and then is not None:
                branches.append((condition, then))
        if otherwise is None or len(branches) < last:
            return None
        return s.Piecewise(tuple(branches), otherwise, self.place(path)) if branches else otherwise

    def _weights(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        pairs = []
        for key, p in value.items():
            outcome = self.key(key, (*path, key))
            weight = self.tree(p, (*path, key))
            if outcome is not None and weight is not None:
                pairs.append((outcome, weight))
        return s.Weights(tuple(pairs), self.place(path)) if len(pairs) == len(value) else None

    def key(self, key: str, path: Path) -> s.Expr | None:
        """Return a key of a table or of a distribution: an expression on the left of a colon."""
        text = s.SourceText(str(key), lambda start, end: _part(self.merged.key_span(path), str(key), start, end))
        if key in ("true", "false"):
            return literal(key == "true", text)
        label = s.Quoted(str(key), s.Place(text, 0, len(str(key))))
        if str(key) in self.labels:
            return label
        try:
            return parse(text)
        except SpecError as error:
            if _are_words(str(key)):
                return label
            self.collector.extend(error.diagnostics)
            return None

    def _table(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        by = value["by"]
        places: list[Path] = [(*path, "by")]
        if isinstance(by, list):
            places = [(*path, "by", i) for i in range(len(by))]
        columns = [self.expr(place) for place in places]
        rows = self._rows(value["rows"], len(columns), (*path, "rows"))
        found = tuple(c for c in columns if c is not None)
        if rows is None or len(found) < len(columns):
            return None
        return s.Table(found, rows, self.place(path))

    def _rows(self, rows: dict[str, Any], depth: int, path: Path) -> tuple[s.TableRow, ...] | None:
        result: list[s.TableRow] = []
        broken = False
        for key, cell in rows.items():
            here = (*path, key)
            label = None if key == "else" else self.key(key, here)
            body: s.Expr | tuple[s.TableRow, ...] | None
            if depth > 1 and isinstance(cell, dict) and not cell.keys() & {"by", "rows"}:
                body = self._rows(cell, depth - 1, here)
            else:
                body = self.tree(cell, here)
            if body is None or (label is None and key != "else"):
                broken = True
            else:
                result.append(s.TableRow(label, body, self.place(here)))
        return None if broken else tuple(result)


def is_word(label: str) -> bool:
    """Return whether a label reads as a name in expressions; others (`go-left`, `top left`, `in`) read as something else."""
    return label.isidentifier() and not iskeyword(label)


def _are_words(key: str) -> bool:
    """Return whether a key that is no expression is meant as a label, such as `top left`."""
    return any(c.isspace() for c in key.strip()) and not any(c in key for c in "()[]+*/%<>=,")


def _part(span: Span, key: str, start: int, end: int) -> Span:
    """Return a range of characters of a key written on one line (a quoted key counts as a whole)."""
    if span.line != span.end_line or span.end_column - span.column != len(key):
        return span
    return Span(span.origin, span.line, span.column + start, span.line, span.column + end)
