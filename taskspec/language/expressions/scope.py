"""Meanings of names where an expression stands, and what the checks of all expressions share."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, NoReturn, TypeVar

from taskspec.base.diagnostics import Collector
from taskspec.base.limits import how_to_raise, limits
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import is_distribution
from taskspec.language.expressions.ir import Const, Node, have_one_shape
from taskspec.language.expressions.types import INT, Domain, Kind, Refused, Type

T = TypeVar("T")

_OF_VALUES = ("E307", "E314", "E315", "E407", "E408")
"""Mistakes that may hang on the values of parameters: shapes, sizes, ranges."""
_WITHOUT_VALUE = ("E307", "E315", "E401", "E402", "E407", "E408")
"""Those of expressions that have no value for some parameters."""
_ALL_OR_ANY = "write `all(...)` or `any(...)`; `where(condition, x, y)` chooses element by element"


@dataclass(frozen=True, slots=True)
class Value:
    """A checked expression: its core node, and its domain when it is a choice (the node is then the label's index).

    `late` is set for a name that is known only when the task runs, even if it is a constant. `ends` are the bounds of
    a component where they are written as numbers, so that they are the same for all parameters.
    """

    node: Node
    domain: Domain | None = None
    late: bool = False
    ends: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Lazy:
    """A name whose value is worked out on first use (definitions, next values, noise).

    `domain` belongs to a component's next value, and is known before.
    """

    resolve: Callable[[s.Name], Value]
    domain: Domain | None = None


@dataclass(frozen=True, slots=True)
class FunctionDef:
    """A definition with arguments: its body is checked at every call, in the scope where it was written."""

    name: str
    arguments: tuple[str, ...]
    body: s.Expr
    scope: Scope
    enter: Callable[[s.Call], AbstractContextManager[None]] = field(compare=False)

    @property
    def signature(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"

    def accepts(self, count: int) -> bool:
        return count == len(self.arguments)


@dataclass(frozen=True, slots=True)
class Unavailable:
    """A name that exists but not here: the message gives the reason."""

    code: str
    message: str
    hint: str | None = None


Binding = Value | Lazy | FunctionDef | Unavailable


class Scope:
    """Names visible in one section, and the domains that labels are looked up in.

    `used` collects every name that was looked up, through all scopes that share it. `draws` is None where random draws are
    allowed, else a sentence with the reason why they are not.
    """

    def __init__(self, bindings: dict[str, Binding], domains: Iterable[Domain] = (), draws: str | None = None) -> None:
        self.bindings = bindings
        self.domains = tuple(domains)
        self.draws = draws
        self.parent: Scope | None = None
        self.used: set[str] = set()

    def child(self, bindings: dict[str, Binding]) -> Scope:
        """Make a scope that also sees the given names (arguments, variables of a comprehension)."""
        inner = Scope(bindings, self.domains, self.draws)
        inner.parent = self
        inner.used = self.used
        return inner

    def _and_parents(self) -> Iterator[Scope]:
        scope: Scope | None = self
        while scope is not None:
            yield scope
            scope = scope.parent

    def lookup(self, written: str) -> Binding | None:
        for scope in self._and_parents():
            if written in scope.bindings:
                self.used.add(written)
                return scope.bindings[written]
        return None

    def names(self) -> Iterator[str]:
        """List every name that could have been meant, labels included."""
        for scope in self._and_parents():
            yield from scope.bindings
        for domain in self.domains:
            yield from domain.labels

    def is_label(self, word: str) -> bool:
        domains = list(self.domains)
        for scope in self._and_parents():
            for b in scope.bindings.values():
                if isinstance(b, Value) and b.domain is not None:
                    domains.append(b.domain)
        return any(word in domain.labels for domain in domains)

    def labelled(self, label: str) -> list[Domain]:
        return list(dict.fromkeys(d for d in self.domains if label in d.labels))


# -- binding times ------------------------------------------------------------------------------------------------
#
# Binding times: state, action, time and draws are known at run time only, even if they are constant. It decides which
# indices count from the end (`lang.calls`), and where fractions end: what is known late is computed in floats, even where its
# value is known when the task is built.


def named(value: Value, expr: s.Expr, scope: Scope) -> Value:
    """Mark the value of a definition or an argument as the value of a name."""
    if isinstance(value.node, Const) and varies(expr, scope):
        return replace(value, late=True)
    return value


def varies(expr: s.Expr, scope: Scope) -> bool:
    """Test whether an expression names something that is bound at run time."""
    if isinstance(expr, s.Name):  # most arguments are names
        return _known_late(expr, scope.lookup(expr.written))
    names = list(s.names(expr))
    own = set(s.targets(expr))
    measured: set[int] = set()
    for call in names:
        if isinstance(call, s.Call) and call.function == "len":
            measured.update(map(id, s.names(call.args)))
    for name in names:
        if id(name) in measured or (isinstance(name, s.Name) and name.id in own):
            continue
        if _known_late(name, scope.lookup(name.written)):
            return True
    return False


def _known_late(at: s.Name | s.Call, binding: Binding | None) -> bool:
    match binding:
        case Value(node=node, late=late):
            return late or not isinstance(node, Const)
        case Lazy(resolve=resolve) if isinstance(at, s.Name):
            return _known_late(at, resolve(at))
        case FunctionDef(arguments=arguments, body=body, scope=scope):
            return varies(body, scope.child({a: Unavailable("", "") for a in arguments}))
        case _:
            return isinstance(at, s.Call) and is_distribution(at.function)


# -- the parts of an expression -----------------------------------------------------------------------------------


class Poisoned(Exception):
    """A part is broken and has been reported; what depends on it is given up."""


@dataclass(frozen=True, slots=True)
class ClampedIndex:
    """An index that may lie outside a vector of `length` elements: `node` is what `index` is moved to."""

    node: Node
    index: Node
    length: int
    place: s.Place


class BaseChecker(ABC):
    """The parts of an expression as a check asks for them; `lang.check` has the cases of each kind of expression.

    `found` has the value of each part of an expression in the scope of a section, by their ids; in comprehensions and calls it
    has no meaning of its own. `parameters` are the values of the parameters, for messages.
    """

    def __init__(self, builder: Builder, collector: Collector) -> None:
        self.builder = builder
        self.collector = collector
        self.moved: dict[int, ClampedIndex] = {}  # by id of the node
        self.results: dict[tuple[int, int], tuple[s.Expr, Value]] = {}
        self.parameters: dict[str, Any] = {}
        self.argument_axes: dict[tuple[str, str], int] = {}  # of definitions with arguments, as they are called
        self._lenient = False
        self._expanded = 0
        self._times = 1  # how often the present expression is written out by comprehensions around it

    @abstractmethod
    def value(self, expr: s.Expr, scope: Scope, want: Domain | None = None) -> Value:
        """Check an expression; `want` is the domain whose labels it may name.

        Raises:
            Poisoned: when it is broken; every mistake in it has been reported.
            SpecError: (E314) when there have been too many expressions by now.
        """

    def check(self, expr: s.Expr | None, scope: Scope, want: Domain | None = None) -> Value | None:
        """Check an expression; None without one, and for a broken one (reported)."""
        if expr is None:
            return None
        try:
            return self.value(expr, scope, want)
        except Poisoned:
            return None

    def numeric(self, expr: s.Expr, scope: Scope) -> Node:
        """Check an expression that must be a number, a condition or a vector; a choice gives the value of its label."""
        return self.number_of(self.value(expr, scope))

    def number_of(self, value: Value) -> Node:
        """Convert a value for arithmetic: a label to the value that it is mapped to, or else to its position."""
        domain = value.domain
        if domain is None or domain.values is None or domain.value_type is None:
            return value.node
        flat: list[Any] = []
        for row in domain.values:
            flat.extend(row if isinstance(row, tuple) else (row,))
        rows = Type(domain.value_type.kind, (len(domain.labels), *domain.value_type.shape))
        return self.builder.structure("index", [self.builder.const(flat, rows), value.node])

    def numerics(self, exprs: Iterable[s.Expr], scope: Scope) -> list[Node]:
        """Check all of them, reporting the mistakes of each before giving up."""
        return self.each(self.numeric, [(expr, scope) for expr in exprs])

    def each(self, job: Callable[..., T], given: Iterable[tuple[Any, ...]]) -> list[T]:
        """Call a function with each of some arguments; give up after all, if one was broken."""
        results = []
        broken = False
        for arguments in given:
            try:
                results.append(job(*arguments))
            except Poisoned:
                broken = True
        if broken:
            raise Poisoned
        return results

    def operands(self, exprs: Sequence[s.Expr], scope: Scope) -> list[Node]:
        """Check the operands of an operation; among those that are known late, fractions are floats."""
        nodes = self.numerics(exprs, scope)
        constants = [n for n in nodes if isinstance(n, Const)]
        if len(constants) < len(nodes):
            return nodes
        reals = []
        for n in constants:
            if n.type.kind is Kind.REAL:
                reals.append(n.flat)
        if not any(type(v) is Fraction for flat in reals for v in flat) or not any(varies(e, scope) for e in exprs):
            return nodes
        return list(map(self.builder.held, nodes))

    def stack(self, nodes: list[Node], expr: s.Expr) -> Node:
        """Make a vector of elements, which must be of one shape."""
        if not have_one_shape(nodes):
            hint = "`concat(x, y)` lays vectors end to end"
            self.fail("E307", expr, "the elements of this vector have different shapes", hint)
        return self.builder.structure("vector", nodes)

    def condition(self, expr: s.Expr, scope: Scope) -> Node:
        node = self.numeric(expr, scope)
        if node.type.kind is not Kind.BOOL:
            hint = "compare it with something, e.g. `x != 0`"
            self.fail("E306", expr, f"a condition is needed here, not {node.type.with_article}", hint)
        if not node.type.is_scalar:
            self.fail("E307", expr, f"one condition is needed here, not {node.type.size} at once", _ALL_OR_ANY)
        return node

    def constant(self, expr: s.Expr, scope: Scope, what: str) -> Const:
        node = self.numeric(expr, scope)
        if not isinstance(node, Const):
            self.fail("E312", expr, f"{what} must be a constant: it may use parameters and constants, not the state")
        return node

    def integer(self, expr: s.Expr, scope: Scope, what: str) -> int:
        node = self.constant(expr, scope, what)
        if not node.type.is_scalar or node.type.kind is Kind.REAL:
            self.fail("E306", expr, f"{what} must be an int, not {node.type.with_article}")
        return int(node.value)

    @contextmanager
    def lenient(self, on: bool = True) -> Iterator[None]:
        """Give up inside without a report on what has no value for these parameters, except for the values of names."""
        before = self._lenient
        self._lenient = on
        try:
            yield
        finally:
            self._lenient = before

    def fail(self, code: str, expr: s.Expr | s.Slice, message: str, hint: str | None = None) -> NoReturn:
        if not self._lenient or code not in _WITHOUT_VALUE:
            self.collector.add(code, expr.place, message, hint, self.values_of(expr) if code in _OF_VALUES else ())
        raise Poisoned

    @contextmanager
    def refusing(self, expr: s.Expr) -> Iterator[None]:
        """Report at an expression what is refused inside."""
        try:
            yield
        except Refused as refused:
            self.fail(refused.code, expr, refused.message, refused.hint)

    def values_of(self, *exprs: s.Expr | s.Slice | None) -> list[str]:
        """Note the values of the parameters that expressions name: at others they may be right."""
        values = {}
        for name in s.names(tuple(e for e in exprs if e is not None)):
            if isinstance(name, s.Name) and name.id in self.parameters:
                values[name.id] = f"{name.id} = {self.parameters[name.id]}"
        if values:
            return [f"with {', '.join(values.values())}"]
        return []

    def expand(self, expr: s.Expr, count: int = 1) -> None:
        """Count what is written out on the author's behalf: calls of definitions, elements of comprehensions."""
        self._expanded += count
        most = limits().expansions
        wanted = max(count * self._times, self._expanded)
        if wanted > most:
            message = f"definitions and comprehensions write out more than {most:,} expressions"
            self.fail("E314", expr, message, how_to_raise("expansions", wanted))

    @contextmanager
    def repeated(self, count: int) -> Iterator[None]:
        """Count expressions that are checked inside so many times."""
        self._times *= count
        try:
            yield
        finally:
            self._times //= count


# -- labels and ints: which label an int is, where a choice is given a value ------------------------------------------


def numbered(checker: BaseChecker, value: Value, domain: Domain) -> Node:
    """Convert a value to positions of labels: of a label of the choice, or of an int that is a position or a value.

    A value of no label is -1, or beyond the last position.

    Raises:
        Refused: (E306) when it is neither, or when values of labels are no different ints.
    """
    if value.domain == domain:
        return value.node
    if value.domain is not None and value.domain.values is None:
        message = f"one of the labels {domain.listed} is needed here, not a choice between other labels"
        raise Refused(message, hint="a table says which goes with which: `{by: ..., rows: {...}}`")
    node = checker.number_of(value)
    if node.type.kind is Kind.REAL:
        message = f"one of the labels {domain.listed} is needed here, not a real"
        raise Refused(message, hint="`floor(x)` and `round(x)` give ints")
    b = checker.builder
    node = b.cast(node, Kind.INT)
    values = domain.values
    if values is None or domain.value_type is None:
        return node
    if domain.value_type != INT or len(set(values)) < len(values):
        message = f"the labels {domain.listed} do not stand for different ints, so a number does not identify a label"
        raise Refused(message, hint="a table gives each number its label: `{by: i, rows: {0: label, 1: label}}`")
    if all(v == values[0] + i for i, v in enumerate(values)):  # type: ignore[operator]
        return b.apply("sub", node, b.scalar(values[0]))
    result: Node = b.scalar(-1)
    for position, number in enumerate(values):
        result = b.apply("where", b.apply("eq", node, b.scalar(number)), b.scalar(position), result)
    return result


def check_comparable(one: Domain | None, other: Domain | None) -> None:
    """Refuse (E306) to compare labels of two choices by where they stand in them."""
    if one is None or other is None or one == other or (one.values is not None and other.values is not None):
        return
    message = f"labels of one choice ({one.listed}) are not labels of another ({other.listed})"
    raise Refused(message, hint="where their positions are meant, say so with arithmetic: `x + 0 == y + 0`")
