"""One build: the merged spec, the builder, the names; expressions as syntax, and values of components."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from keyword import iskeyword
from typing import Any, NoReturn

from taskspec.base.diagnostics import Collector, Span, SpecError
from taskspec.base.limits import limits
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.parse import literal, parse, parse_into
from taskspec.language.expressions.scope import Binding, Lazy, Poisoned, Scope, Value, numbered
from taskspec.language.expressions.types import Domain, Kind, Refused, Role, Shape, shape
from taskspec.language.source import Path
from taskspec.language.task.merge import Merged
from taskspec.language.task.parts import Component, Parameter, Surface

# ---------- forms
# YAML values -> surface syntax: texts, numbers, vectors, `if:`/`then:` lists, `by:`/`rows:` tables, probabilities.

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

    def optional(self, path: Path) -> s.Expr | None:
        """Return the expression at a path; None when it is broken (and reported), or when there is nothing."""
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
        """Return the whole value at a path, as a place."""
        return s.Place(s.SourceText("", lambda start, end: self.merged.span(path)), 0, 0)

    def tree(self, value: Tree, path: Path) -> s.Expr | None:
        match value:
            case bool() | int() | float():
                return literal(value, s.SourceText(str(value), lambda start, end: self.merged.span(path)))
            case str() if value.strip() in self.labels:
                return s.Quoted(value.strip(), self.place(path))
            case str():
                return self.parsed(self.text(path, value), path)
            case list():
                return self._list(value, path)
            case dict():
                if "by" in value:
                    return self._table(value, path)
                return self._weights(value, path)
            case None:
                self.collector.add("E301", self.place(path), "an expression is missing here")
                return None

    def parsed(self, text: s.SourceText, path: Path) -> s.Expr | None:
        """Return the expression of a text; what is read without a mistake is read once for all builds of the spec."""
        key = (path, text.value, limits().characters)
        found: s.Expr | None = self.merged.parsed.get(key) or parse_into(text, self.collector)
        if found is not None:
            self.merged.parsed[key] = found
        return found

    def _list(self, items: list[Any], path: Path) -> s.Expr | None:
        if items and all(isinstance(i, dict) and i.keys() & {"if", "then", "else"} for i in items):
            return self._pieces(items, path)
        if len(items) == 1 and isinstance(items[0], str) and _FOR.search(items[0]):
            return self.parsed(self._in_brackets(items[0], (*path, 0)), path)
        exprs = [self.tree(item, (*path, i)) for i, item in enumerate(items)]
        found = tuple(e for e in exprs if e is not None)
        if len(found) == len(items):
            return s.Vector(found, self.place(path))
        return None

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
        if branches:
            return s.Piecewise(tuple(branches), otherwise, self.place(path))
        return otherwise

    def _weights(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        pairs = []
        for key, p in value.items():
            outcome = self.key(key, (*path, key))
            weight = self.tree(p, (*path, key))
            if outcome is not None and weight is not None:
                pairs.append((outcome, weight))
        if len(pairs) == len(value):
            return s.Weights(tuple(pairs), self.place(path))
        return None

    def key(self, key: str, path: Path) -> s.Expr | None:
        """Return a key of a table or of a distribution: an expression on the left of a colon."""
        text = s.SourceText(str(key), lambda start, end: _part(self.merged.key_span(path), str(key), start, end))
        if key in ("true", "false"):
            return literal(key == "true", text)
        label = s.Quoted(str(key), s.Place(text, 0, len(str(key))))
        if str(key) in self.labels:
            return label
        known = (path, "key", text.value, limits().characters)
        found: s.Expr | None = self.merged.parsed.get(known)
        if found is not None:
            return found
        try:
            found = self.merged.parsed[known] = parse(text)
            return found
        except SpecError as error:
            if len(str(key).split()) > 1 and not any(c in str(key) for c in "()[]+*/%<>=,"):
                return label  # such as `top left`
            self.collector.extend(error.diagnostics)
            return None

    def _table(self, value: dict[str, Any], path: Path) -> s.Expr | None:
        by = value["by"]
        places: list[Path] = [(*path, "by")]
        if isinstance(by, list):
            places = [(*path, "by", i) for i in range(len(by))]
        columns = list(map(self.expr, places))
        rows = self._rows(value["rows"], len(columns), (*path, "rows"))
        found = tuple(c for c in columns if c is not None)
        if rows is None or len(found) < len(columns):
            return None
        return s.Table(found, rows, self.place(path))

    def _rows(self, rows: dict[str, Any], depth: int, path: Path) -> tuple[s.TableRow, ...] | None:
        result: list[s.TableRow] = []
        for key, cell in rows.items():
            here = (*path, key)
            label = None if key == "else" else self.key(key, here)
            body: s.Expr | tuple[s.TableRow, ...] | None
            if depth > 1 and isinstance(cell, dict) and not cell.keys() & {"by", "rows"}:
                body = self._rows(cell, depth - 1, here)
            else:
                body = self.tree(cell, here)
            if body is not None and (label is not None or key == "else"):
                result.append(s.TableRow(label, body, self.place(here)))
        if len(result) < len(rows):
            return None
        return tuple(result)


def is_word(label: str) -> bool:
    """Return whether a label reads as a name in expressions; others (`go-left`, `top left`, `in`) read as something else."""
    return label.isidentifier() and not iskeyword(label)


def _part(span: Span, key: str, start: int, end: int) -> Span:
    """Return a range of characters of a key written on one line (a quoted key counts as a whole)."""
    if span.line != span.end_line or span.end_column - span.column != len(key):
        return span
    return Span(span.origin, span.line, span.column + start, span.line, span.column + end)


# ---------- context
# What the parts of a build share: the merged spec, the builder, the names; and values of components.


def assign(checker: Checker, expr: s.Expr, scope: Scope, component: Component) -> Node | None:
    """Return an expression as a value of a component; None when it is broken (and reported to the checker's collector)."""
    value = checker.check(expr, scope, component.domain)
    if value is None:
        return None
    try:
        return _fit(checker, value, expr, component)
    except Poisoned:
        return None
    except Refused as refused:
        _blame(checker, refused, expr, scope, component)
        return None


def _blame(checker: Checker, refused: Refused, expr: s.Expr, scope: Scope, component: Component) -> None:
    """Report a value that does not fit: at the alternatives that do not, where it is one of several."""
    blamed = False
    for part in s.alternatives(expr):
        try:
            _fit(checker, checker.value(part, scope, component.domain), part, component)
        except Poisoned:
            blamed = True
        except Refused as own:
            checker.collector.add(own.code, part.place, own.message, own.hint)
            blamed = True
    if not blamed:
        checker.collector.add(refused.code, expr.place, refused.message, refused.hint)


def _fit(checker: Checker, value: Value, expr: s.Expr, c: Component) -> Node:
    """Return the value as one of a component; Refused when it cannot be."""
    if c.domain is None:
        node = checker.number_of(value)
    else:
        node = numbered(checker, value, c.domain)
    if node.type.kind > c.type.kind:
        message = f"'{c.name}' is {_NAMED[c.type.kind]}, but this is {_NAMED[node.type.kind]}"
        raise Refused(message, "E306", "compare it, e.g. `x > 0`" if c.type.kind is Kind.BOOL else _whole(expr, c))
    b = checker.builder
    node = b.held(b.stretch(b.cast(node, c.type.kind), c.type.shape))
    if not node.type.size and not c.type.size:  # `[...]` with no element has one axis
        node = b.structure("reshape", [node], c.type.shape)
    if node.type.shape != c.type.shape:
        raise Refused(f"'{c.name}' has shape {list(c.type.shape)}, but this has {list(node.type.shape)}", "E307")
    return node


_NAMED = {Kind.BOOL: "a bool", Kind.INT: "an int", Kind.REAL: "a real"}


def _whole(expr: s.Expr, c: Component) -> str:
    """Return what to do about a real that is to be an int."""
    if isinstance(expr, s.Call) and expr.function in ("put", "concat"):
        return f"declare '{c.name}' `type: real` if it is to hold reals"
    if isinstance(expr, s.Binary) and expr.op == "/":
        return "`x // y` divides ints, rounded down"
    return "`floor(x)` and `round(x)` give ints"


# What every part of a build shares: the merged spec, one builder, one collector, and the names resolved so far.


EXPRESSIONS = ("definitions", "noise", "initial", "dynamics", "observation", "measures")
"""Sections of named expressions."""


class Context:
    """The state of one build; its parts fill in the attributes in the order of the pipeline."""

    def __init__(self, merged: Merged, collector: Collector) -> None:
        self.merged = merged
        self.data = merged.data
        self.collector = collector
        self.builder = Builder()
        self.checker = Checker(self.builder, collector)
        self.forms = Forms(merged, collector)
        self.parameters: list[Parameter] = []
        self.required: list[tuple[Node, str]] = []
        self.constants: dict[str, Binding] = {}
        self.state: tuple[Component, ...] = ()
        self.action: tuple[Component, ...] = ()
        self.memory: tuple[Component, ...] = ()
        self.domains: list[Domain] = []
        self.broken: set[str] = set()
        """Components that are declared wrongly (and reported): what reads them is given up."""
        self.horizon: int | None = None
        self.raw_initial: dict[str, Node] = {}
        """Initial values as they are written, in and out of range."""
        self.exprs: dict[str, Any] = {section: {} for section in EXPRESSIONS}
        """The parsed sections; empty until they are parsed, where a mistake comes before."""
        self.scopes: list[Scope] = []  # every scope made, for what was used
        self.named_scopes: dict[str, Scope] = {}
        self.shapes: dict[str, Shape] = {}  # of definitions and of noise
        self._busy: list[str] = []  # names that are being expanded

    def move(self, merged: Merged) -> None:
        """Take the places of expressions from another text that says the same."""
        merged.parsed.update(self.merged.parsed)
        self.merged = merged
        self.forms.merged = merged

    def constant_scope(self, why_no_draws: str | None = None) -> Scope:
        """Return a scope of parameters and constants alone."""
        scope = Scope(self.constants, draws=why_no_draws)
        self.scopes.append(scope)
        return scope

    def collect_labels(self) -> None:
        """Collect the labels of all components, and which of them are no names."""
        components = (*self.state, *self.action, *self.memory)
        self.domains = [c.domain for c in components if c.domain is not None]
        labels = (label for domain in self.domains for label in domain.labels)
        self.forms.labels = frozenset(label for label in labels if not is_word(label))

    def surface(self) -> Surface:
        """Return what the author wrote, and what each part of it came to."""
        checker = self.checker
        sections = {id(scope): name for name, scope in self.named_scopes.items()}
        meanings = {(sections[at], part): found for (part, at), found in checker.found.items() if at in sections}
        return Surface(
            self.exprs, self.named_scopes, tuple(checker.moved.values()), meanings, self.shapes, checker.argument_axes,
            checker.checked,
        )  # fmt: skip

    def expr(self, path: Path) -> s.Expr:
        """Return the expression at a path.

        Raises:
            Poisoned: when it is broken; its mistakes are reported.
        """
        expr = self.forms.expr(path)
        if expr is None:
            raise Poisoned
        return expr

    def report(self, code: str, path: Path, message: str, hint: str | None = None) -> None:
        """Report a mistake in the value at a path."""
        self.collector.add(code, self.merged.span(path), message, hint)

    def report_key(self, code: str, path: Path, message: str, hint: str | None = None) -> None:
        """Report a mistake in the key at a path."""
        self.collector.add(code, self.merged.key_span(path), message, hint)

    def stop(self, code: str, path: Path, message: str, hint: str | None = None) -> NoReturn:
        """Report a mistake in the value at a path, without which what reads it means nothing."""
        self.report(code, path, message, hint)
        raise Poisoned

    def place(self, *path: str) -> s.Place:
        """Return a whole section as a place."""
        return self.forms.place(path)

    def bound(self, c: Component, role: Role) -> Binding:
        """Return what the name of a component means."""
        if c.name in self.broken:
            return Lazy(poison, c.domain)
        return self.read(c, role)

    def read(self, c: Component, role: Role) -> Value:
        """Return the present value of a component."""
        entry = self.data[role.value].get(c.name, {})  # an abstraction has components of its own
        low = entry.get("low")
        high = entry.get("high")
        ends = (low if isinstance(low, int) else -math.inf, high if isinstance(high, int) else math.inf)
        node = self.builder.read(role, c.name, c.type, c.least, c.most)
        return Value(node, c.domain, late=True, ends=ends)  # late even where it has no elements and is a constant

    def shaped(self, name: str, value: Value) -> Value:
        """Return a definition's or a noise's value, whose shape the printers ask for."""
        self.shapes[name] = shape(value.node.type, value.domain)
        return value

    # -- names worked out on first use ----------------------------------------------------------------------------

    @contextmanager
    def guard(self, name: str, at: s.Expr) -> Iterator[None]:
        """Expand a name inside; expanding it there again is a circle."""
        if name in self._busy:
            circle = " -> ".join([*self._busy[self._busy.index(name) :], name])
            self.checker.fail("E310", at, f"'{name}' needs its own value: {circle}")
        self._busy.append(name)
        try:
            yield
        finally:
            self._busy.remove(name)

    def lazy(self, name: str, make: Callable[[], Value]) -> Lazy:
        """Return a binding worked out once, on first use; a circle is reported."""
        known: list[Value | None] = []

        def resolve(at: s.Name) -> Value:
            if not known:
                with self.guard(name, at):
                    try:
                        known.append(make())
                    except Poisoned:
                        known.append(None)
            if known[0] is None:
                raise Poisoned
            return known[0]

        return Lazy(resolve)

    def constant(self, name: str) -> Value | None:
        """Return what a constant or a parameter is; None for one that is broken."""
        return self.resolve(self.constants[name], self.place("constants", name))

    def resolve(self, binding: Binding, place: s.Place) -> Value | None:
        """Return the value of a binding, worked out now; None for one that is broken (and reported), or has no single value."""
        try:
            if isinstance(binding, Lazy):
                return binding.resolve(s.Name("", False, place))
        except Poisoned:
            pass
        except Refused as refused:
            self.collector.add(refused.code, place, refused.message, refused.hint)
        if isinstance(binding, Value):
            return binding
        return None

    # -- values of components -------------------------------------------------------------------------------------

    def assign(self, expr: s.Expr | None, scope: Scope, component: Component) -> Node | None:
        """Return an expression as a value of a component; None when there is none, or either is broken (and reported)."""
        if expr is None or component.name in self.broken:
            self.checker.check(expr, scope, component.domain)
            return None
        return assign(self.checker, expr, scope, component)


def poison(*_: object) -> Value:
    """Stand for a name that is broken and has been reported."""
    raise Poisoned
