"""One build: the merged spec, the builder, the names; expressions as syntax, and values of components."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from taskspec.base.diagnostics import Collector
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.scope import Binding, Lazy, Poisoned, Scope, Value, numbered
from taskspec.language.expressions.types import Domain, Kind, Refused, Role, Shape, shape
from taskspec.language.source import Path
from taskspec.language.task.forms import Forms, is_word
from taskspec.language.task.merge import Merged
from taskspec.language.task.parts import Component, Parameter, Surface

# -- values of components -----------------------------------------------------------------------------------------


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
    if isinstance(expr, s.Call) and expr.function in ("put", "concat"):
        return f"declare '{c.name}' `type: real` if it is to hold reals"
    if isinstance(expr, s.Binary) and expr.op == "/":
        return "`x // y` divides ints, rounded down"
    return "`floor(x)` and `round(x)` give ints"


# Shared by all parts of a build: the merged spec, one builder, one collector, and the names resolved so far.


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
        """Make a scope of parameters and constants alone."""
        scope = Scope(self.constants, draws=why_no_draws)
        self.scopes.append(scope)
        return scope

    def collect_labels(self) -> None:
        """Collect the labels of all components, and which of them are no names."""
        components = (*self.state, *self.action, *self.memory)
        self.domains = []
        for c in components:
            if c.domain is not None:
                self.domains.append(c.domain)
        labels: list[str] = []
        for domain in self.domains:
            labels += domain.labels
        self.forms.labels = frozenset(label for label in labels if not is_word(label))

    def surface(self) -> Surface:
        """Collect the author's sections, with the value of each part."""
        checker = self.checker
        sections = {}
        for name, scope in self.named_scopes.items():
            sections[id(scope)] = name
        meanings = {}
        for (part, at), meaning in checker.results.items():
            if at in sections:
                meanings[(sections[at], part)] = meaning
        return Surface(
            self.exprs, self.named_scopes, tuple(checker.moved.values()), meanings, self.shapes, checker.argument_axes,
            checker.checked,
        )  # fmt: skip

    def expr(self, path: Path) -> s.Expr:
        """Expression at a path.

        Raises:
            Poisoned: when it is broken; its mistakes are reported.
        """
        expr = self.forms.expr(path)
        if expr is None:
            raise Poisoned
        return expr

    def report(self, code: str, path: Path, message: str, hint: str | None = None) -> None:
        self.collector.add(code, self.merged.span(path), message, hint)

    def report_key(self, code: str, path: Path, message: str, hint: str | None = None) -> None:
        self.collector.add(code, self.merged.key_span(path), message, hint)

    def stop(self, code: str, path: Path, message: str, hint: str | None = None) -> NoReturn:
        """Report a mistake in the value at a path, without which what reads it means nothing."""
        self.report(code, path, message, hint)
        raise Poisoned

    def place(self, *path: str) -> s.Place:
        return self.forms.place(path)

    def bound(self, c: Component, role: Role) -> Binding:
        if c.name in self.broken:
            return Lazy(poison, c.domain)
        return self.read(c, role)

    def read(self, c: Component, role: Role) -> Value:
        entry = self.data[role.value].get(c.name, {})  # an abstraction has components of its own
        low = entry.get("low")
        high = entry.get("high")
        ends = (low if isinstance(low, int) else -math.inf, high if isinstance(high, int) else math.inf)
        node = self.builder.read(role, c.name, c.type, c.least, c.most)
        return Value(node, c.domain, late=True, ends=ends)  # late even where it has no elements and is a constant

    def shaped(self, name: str, value: Value) -> Value:
        """Record the shape of a definition's or a noise's value, for the printers."""
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
        """Make a binding that is worked out once, on first use; a circle is reported."""
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
        """Value of a constant or a parameter; None for a broken one."""
        return self.resolve(self.constants[name], self.place("constants", name))

    def resolve(self, binding: Binding, place: s.Place) -> Value | None:
        """Work out the value of a binding now; None for a broken one (reported), or one without a single value."""
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
