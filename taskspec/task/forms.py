"""YAML values -> surface syntax: texts, numbers, vectors, `if:`/`then:` lists, `by:`/`rows:` tables, probabilities."""

from __future__ import annotations

import re
from keyword import iskeyword
from typing import Any

from taskspec.base.diagnostics import Collector, Span, SpecError
from taskspec.base.limits import limits
from taskspec.lang import syntax as s
from taskspec.lang.parse import literal, parse, parse_into
from taskspec.source import LEFT_OUT, Path
from taskspec.task.merge import Merged

_FOR = re.compile(r"\sfor\s")
Tree = dict[str, Any] | list[Any] | str | int | float | bool | None


class Forms:
    """Reads expressions of one merged spec; mistakes go to the collector."""

    def __init__(self, merged: Merged, collector: Collector) -> None:
        self.merged = merged
        self.collector = collector
        self.is_partial = False
        """Whether something was left out of the spec, so that there is no task even where no more is wrong."""
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
            case str() if value == LEFT_OUT:
                self.is_partial = True
                return None
            case str() if value.strip() in self.labels:
                return s.Quoted(value.strip(), self.place(path))
            case str():
                return self._parsed(self.text(path, value), path)
            case list():
                return self._list(value, path)
            case dict():
                return self._mapping(value, path)
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
        """`if:`/`then:` entries and a last `else:`."""
        branches = []
        otherwise = None
        broken = False
        for i, item in enumerate(items):
            here = (*path, i)
            last = i == len(items) - 1
            if set(item) == {"else"} and last:
                otherwise = self.tree(item["else"], (*here, "else"))
                broken |= otherwise is None
            elif set(item) == {"if", "then"} and not last:
                condition = self.tree(item["if"], (*here, "if"))
                then = self.tree(item["then"], (*here, "then"))
                if condition is None or then is None:
                    broken = True
                else:
                    branches.append((condition, then))
            else:
                self._bad_piece(item, here, last)
                broken = True
        if broken or otherwise is None:
            return None
        return s.Piecewise(tuple(branches), otherwise, self.place(path)) if branches else otherwise

    def _bad_piece(self, item: dict[str, Any], path: Path, last: bool) -> None:
        odd = sorted(set(item) - {"if", "then", "else"})
        if odd:
            self.collector.add("E209", self.merged.key_span((*path, odd[0])), f"'{odd[0]}' has no meaning here",
                               "each entry is `if:` and `then:`, the last one `else:`")  # fmt: skip
        elif last:
            self.collector.add("E209", self.place(path), "these cases need a last `else:`", "- else: value")
        else:
            self.collector.add("E209", self.place(path), "this case needs `if:` and `then:`", "`else:` comes last")

    def _mapping(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        if "by" in value or "rows" in value:
            return self._table(value, path)
        if value.keys() & {"if", "then", "else"}:
            self.collector.add(
                "E209",
                self.place(path),
                "cases are written as a list",
                "- if: condition\n  then: value\n- else: value",
            )
            return None
        return self._weights(value, path)

    def _weights(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        if not value:
            self.collector.add("E301", self.place(path), "an expression is missing here")
            return None
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
        odd = [key for key in value if key not in ("by", "rows")]
        for key in odd:
            self.collector.add("E208", self.merged.key_span((*path, key)), f"'{key}' has no meaning in a table",
                               "a table has `by:` and `rows:`")  # fmt: skip
        for key in ("by", "rows"):
            if key not in value:
                self.collector.add("E208", self.place(path), f"this table needs `{key}:`")
                return None
        if not isinstance(value["rows"], dict) or not value["rows"]:
            self.collector.add(
                "E208",
                self.merged.span((*path, "rows")),
                "the rows of a table are a mapping: `key: value`",
            )
            return None
        by = value["by"] if isinstance(value["by"], list) else [value["by"]]
        columns = [
            self.tree(item, (*path, "by", i) if isinstance(value["by"], list) else (*path, "by"))
            for i, item in enumerate(by)
        ]
        rows = self._rows(value["rows"], len(by), (*path, "rows"))
        found = tuple(c for c in columns if c is not None)
        if rows is None or odd or len(found) < len(columns):
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
