"""What the checks of all kinds of expressions share: the parts of an expression, what is asked of them, and mistakes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NoReturn, TypeVar

from taskspec.diagnostics import Collector
from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import Scope, Value
from taskspec.lang.types import Domain, Kind, Shape, Type
from taskspec.limits import how_to_raise, limits

T = TypeVar("T")


class Poisoned(Exception):
    """A part is broken and has been reported; what depends on it is given up."""


_OF_VALUES = ("E307", "E314", "E315", "E407", "E408")
"""Mistakes that may hang on the values of parameters: shapes, sizes, ranges."""
_WITHOUT_VALUE = ("E307", "E315", "E401", "E402", "E407", "E408")
"""Those of expressions that have no value for some parameters."""
_ALL_OR_ANY = "comparing vectors compares element by element; write `all(...)` or `any(...)`"


@dataclass(frozen=True, slots=True)
class ClampedIndex:
    """An index that may lie outside a vector of `length` elements: `node` is what `index` is moved to."""

    node: Node
    index: Node
    length: int
    place: s.Place


class BaseChecker(ABC):
    """What a check asks of the parts of an expression; `lang.check` says what each kind of expression is."""

    def __init__(self, builder: Builder, collector: Collector) -> None:
        self.builder = builder
        self.collector = collector
        self.moved: dict[int, ClampedIndex] = {}  # by id of the node
        self.found: dict[tuple[int, int], tuple[s.Expr, Value]] = {}
        """What each part of an expression came to in the scope of a section, by their ids; in comprehensions and calls it has
        no meaning of its own."""
        self.parameters: dict[str, Any] = {}
        """The values of the parameters, for messages."""
        self._lenient = False
        self._expanded = 0
        self._times = 1  # how often the present expression is written out by comprehensions around it

    @abstractmethod
    def value(self, expr: s.Expr, scope: Scope, want: Domain | None = None) -> Value:
        """The value of an expression; `want` is the domain whose labels it may name.

        Raises:
            Poisoned: when it is broken; every mistake in it has been reported.
            SpecError: (E314) when there have been too many expressions by now.
        """

    def check(self, expr: s.Expr, scope: Scope, want: Domain | None = None) -> Value | None:
        """The value of an expression, or None when it is broken (and reported)."""
        try:
            return self.value(expr, scope, want)
        except Poisoned:
            return None

    def numeric(self, expr: s.Expr, scope: Scope) -> Node:
        """An expression that must be a number, a condition or a vector; a choice gives what its label stands for."""
        return self.number_of(self.value(expr, scope))

    def number_of(self, value: Value) -> Node:
        """A value in arithmetic: a label is the value that it stands for, or else its position."""
        domain = value.domain
        if domain is None or domain.values is None or domain.value_type is None:
            return value.node
        rows = Type(domain.value_type.kind, (len(domain.labels), *domain.value_type.shape))
        flat = [v for row in domain.values for v in (row if isinstance(row, tuple) else (row,))]
        return self.builder.structure("index", [self.builder.const(flat, rows), value.node])

    def numerics(self, exprs: Iterable[s.Expr], scope: Scope) -> list[Node]:
        """All of them, reporting the mistakes of each before giving up."""
        return self.each([(lambda e=e: self.numeric(e, scope)) for e in exprs])  # type: ignore[misc]

    def each(self, jobs: Sequence[Callable[[], T]]) -> list[T]:
        """Results of all the jobs; every one runs, then a broken one gives up."""
        results, broken = [], False
        for job in jobs:
            try:
                results.append(job())
            except Poisoned:
                broken = True
        if broken:
            raise Poisoned
        return results

    def stack(self, nodes: list[Node], expr: s.Expr) -> Node:
        """A vector of elements, which must be of one shape."""
        shapes = {n.type.shape for n in nodes}
        if len(shapes) > 1:
            self.fail("E307", expr, "the elements of this vector have different shapes",
                      "`concat(x, y)` lays vectors end to end")  # fmt: skip
        return self.builder.structure("vector", nodes)

    def condition(self, expr: s.Expr, scope: Scope, of_many: Callable[[Shape], str | None] | None = None) -> Node:
        """An expression that must be a single condition; `of_many` may say what to do about several of some shape."""
        node = self.numeric(expr, scope)
        if node.type.kind is not Kind.BOOL:
            hint = "compare it with something, e.g. `x != 0`" if node.type.is_scalar else None
            self.fail("E306", expr, f"a condition is needed here, not {_article(node.type)}", hint)
        if not node.type.is_scalar:
            hint = self.of_many(expr, scope) or (of_many and of_many(node.type.shape)) or _ALL_OR_ANY
            self.fail("E307", expr, f"one condition is needed here, not {node.type.size} at once", hint)
        return node

    def of_many(self, expr: s.Expr, scope: Scope) -> str | None:
        """What was meant by several conditions where one is needed, as far as their form tells."""
        return None

    def constant(self, expr: s.Expr, scope: Scope, what: str, instead: str | None = None) -> Const:
        """An expression that must be known once parameters are; `instead` is what to write where it is not."""
        node = self.numeric(expr, scope)
        if not isinstance(node, Const):
            self.fail(
                "E312",
                expr,
                f"{what} must be a constant: it may use parameters and constants, not the state",
                instead,
            )
        return node

    def integer(self, expr: s.Expr, scope: Scope, what: str, instead: str | None = None) -> int:
        node = self.constant(expr, scope, what, instead)
        if not node.type.is_scalar or node.type.kind is Kind.REAL:
            self.fail("E306", expr, f"{what} must be an int, not {_article(node.type)}")
        return int(node.value)

    @contextmanager
    def lenient(self, on: bool = True) -> Iterator[None]:
        """What has no value for these parameters is given up inside without a report; what a name stands for is not meant."""
        before, self._lenient = self._lenient, on
        try:
            yield
        finally:
            self._lenient = before

    def fail(self, code: str, expr: s.Expr | s.Slice, message: str, hint: str | None = None) -> NoReturn:
        if self._lenient and code in _WITHOUT_VALUE:
            raise Poisoned
        self.collector.add(code, expr.place, message, hint, self.values_of(expr) if code in _OF_VALUES else ())
        raise Poisoned

    def values_of(self, *exprs: s.Expr | s.Slice | None) -> list[str]:
        """The values of the parameters that expressions name, as a note: at others they may be right."""
        names = (x for expr in exprs if expr is not None for x in s.names(expr))
        named = dict.fromkeys(x.id for x in names if isinstance(x, s.Name) and x.id in self.parameters)
        return [f"with {', '.join(f'{name} = {self.parameters[name]}' for name in named)}"] if named else []

    def expand(self, expr: s.Expr, count: int = 1) -> None:
        """Count what is written out on the author's behalf: calls of definitions, elements of comprehensions."""
        self._expanded += count
        most, wanted = limits().expansions, max(count * self._times, self._expanded)
        if wanted > most:
            message = f"definitions and comprehensions write out more than {most:,} expressions"
            self.fail("E314", expr, message, how_to_raise("expansions", wanted))

    @contextmanager
    def repeated(self, count: int) -> Iterator[None]:
        """What is checked inside is written out so many times."""
        self._times *= count
        try:
            yield
        finally:
            self._times //= count

    def poison(self) -> NoReturn:
        """Give up on a part whose mistakes are reported."""
        raise Poisoned


def _article(type: Type) -> str:
    text = str(type)
    return f"an {text}" if text[0] in "aeiou" else f"a {text}"
