"""Surface syntax -> typed core: resolves names and labels, checks kinds and shapes, and reports every mistake with its place.

An expression with several mistakes reports them all: the parts are checked one by one, a mistake goes to the collector at once,
and only what needs the value of a broken part is given up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NoReturn, TypeVar, assert_never

from taskspec.diagnostics import Collector, Diagnostic, SpecError, nearest, suggest
from taskspec.lang import alternatives, calls, comparisons, sets, subscripts, tables
from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import FunctionDef, Lazy, Scope, Unavailable, Value
from taskspec.lang.types import Domain, Kind, Refused, Type
from taskspec.limits import how_to_raise, limits

T = TypeVar("T")
CONSTANTS = {"pi": math.pi, "inf": math.inf}
_ARITHMETIC = {"+": "add", "-": "sub", "*": "mul", "/": "div", "//": "floordiv", "%": "mod"}
_TRUTHS = {**dict.fromkeys(("yes", "on"), "write `true`"), **dict.fromkeys(("no", "off"), "write `false`")}


class Poisoned(Exception):
    """A part is broken and has been reported; what depends on it is given up."""


class Checker:
    """Checks expressions of one task against scopes; nodes come from one builder, messages go to one collector."""

    def __init__(self, builder: Builder, collector: Collector) -> None:
        self.builder = builder
        self.collector = collector
        self.moved: dict[int, subscripts.Moved] = {}  # by id of the node
        self._expanded = self._checked = 0
        self._most = limits().expressions
        self._times = 1  # how often the present expression is written out by comprehensions around it

    # -- entry ----------------------------------------------------------------------------------------------------

    def check(self, expr: s.Expr, scope: Scope, want: Domain | None = None) -> Value | None:
        """The value of an expression, or None when it is broken (and reported)."""
        try:
            return self.value(expr, scope, want)
        except Poisoned:
            return None

    # -- the pass -------------------------------------------------------------------------------------------------

    def value(self, expr: s.Expr, scope: Scope, want: Domain | None = None) -> Value:
        """The value of an expression; `want` is the domain whose labels it may name.

        Raises:
            Poisoned: when it is broken; every mistake in it has been reported.
            SpecError: (E314) when there have been too many expressions by now.
        """
        self._checked += 1
        if self._checked > self._most:
            message = f"the task has more than {self._most:,} expressions, each counted as often as it is written out"
            hint = how_to_raise("expressions", 2 * self._most)
            raise SpecError([Diagnostic("E314", expr.place.span, message, hint)])
        try:
            return self._value(expr, scope, want)
        except Refused as refused:
            self.fail(refused.code, expr, refused.message, refused.hint)
        except RecursionError:
            pass  # said below, where the stack has room again
        self.fail("E314", expr, "this is nested too deeply, with the definitions that it uses")

    def _value(self, expr: s.Expr, scope: Scope, want: Domain | None) -> Value:
        match expr:
            case s.Number(value=number):
                return self._number(number, want)
            case s.Boolean(value=truth):
                return self._boolean(truth, want)
            case s.Quoted(value=label):
                return self.label(label, expr, scope, want)
            case s.Name():
                return self._name(expr, scope, want)
            case s.Unary() | s.Binary() | s.Logical():
                return Value(self._operator(expr, scope))
            case s.Compare():
                return Value(comparisons.compare(self, expr, scope))
            case s.IfElse(condition=condition, then=then, otherwise=otherwise):
                return alternatives.select(self, [(condition, then)], otherwise, scope, want)
            case s.Piecewise(branches=branches, otherwise=otherwise):
                return alternatives.select(self, branches, otherwise, scope, want)
            case s.Call():
                return calls.call(self, expr, scope, want)
            case s.Subscript():
                return Value(subscripts.subscript(self, expr, scope))
            case s.Vector(items=items):
                return Value(self._vector(items, expr, scope))
            case s.Comprehension(is_set=False):
                return Value(self._stack(sets.unroll(self, expr, scope), expr))
            case s.Weights():
                return tables.weighted(self, expr, scope, want)
            case s.Table():
                return tables.table(self, expr, scope, want)
            case s.SetOf() | s.Comprehension():
                hint = "draw from it with `Uniform({...})`, or test with `x in {...}`"
                self.fail("E306", expr, "a set is not a value", hint)
            case _:
                assert_never(expr)

    def numeric(self, expr: s.Expr, scope: Scope) -> Node:
        """An expression that must be a number, a condition or a vector; a mapped choice gives the value it stands for."""
        return self.number_of(self.value(expr, scope), expr)

    def number_of(self, value: Value, expr: s.Expr) -> Node:
        if value.domain is None:
            return value.node
        domain = value.domain
        if domain.values is None or domain.value_type is None:
            labels = ", ".join(domain.labels[:4]) + (", ..." if len(domain.labels) > 4 else "")
            self.fail("E306", expr, f"this is a choice between labels ({labels}), not a number",
                      "compare it (`x == label`), or give its labels values: `values: {label: value}`")  # fmt: skip
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

    def condition(self, expr: s.Expr, scope: Scope) -> Node:
        """An expression that must be a single condition."""
        node = self.numeric(expr, scope)
        if node.type.kind is not Kind.BOOL:
            hint = "compare it with something, e.g. `x != 0`" if node.type.is_scalar else None
            self.fail("E306", expr, f"a condition is needed here, not {_article(node.type)}", hint)
        if not node.type.is_scalar:
            self.fail("E307", expr, f"one condition is needed here, not {node.type.size} at once",
                      "comparing vectors compares element by element; write `all(...)` or `any(...)`")  # fmt: skip
        return node

    def constant(self, expr: s.Expr, scope: Scope, what: str) -> Const:
        """An expression that must be known once parameters are."""
        node = self.numeric(expr, scope)
        if not isinstance(node, Const):
            self.fail(
                "E312",
                expr,
                f"{what} must be a constant: it may use parameters and constants, not the state",
            )
        return node

    def integer(self, expr: s.Expr, scope: Scope, what: str) -> int:
        node = self.constant(expr, scope, what)
        if not node.type.is_scalar or node.type.kind is Kind.REAL:
            self.fail("E306", expr, f"{what} must be an int, not {_article(node.type)}")
        return int(node.value)

    def fail(self, code: str, expr: s.Expr | s.Slice, message: str, hint: str | None = None) -> NoReturn:
        self.collector.add(code, expr.place, message, hint)
        raise Poisoned

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

    # -- leaves ---------------------------------------------------------------------------------------------------

    def _number(self, number: int | float, want: Domain | None) -> Value:
        if want is not None and want.values is not None and want.values.count(number) == 1:
            return Value(self.builder.scalar(want.values.index(number)), want)
        if want is not None and str(number) in want.labels:
            return Value(self.builder.scalar(want.labels.index(str(number))), want)
        return Value(self.builder.scalar(number))

    def _boolean(self, truth: bool, want: Domain | None) -> Value:
        return Value(self.builder.scalar(truth))

    def label(self, label: str, expr: s.Expr, scope: Scope, want: Domain | None) -> Value:
        """A word that can only be a label."""
        if want is not None and label in want.labels:
            return Value(self.builder.scalar(want.labels.index(label)), want)
        found = scope.labelled(label)
        if want is None and len(found) == 1:
            return Value(self.builder.scalar(found[0].labels.index(label)), found[0])
        if want is not None:
            self.fail(
                "E313",
                expr,
                f"'{label}' is not one of {', '.join(want.labels)}",
                suggest(label, want.labels),
            )
        if found:
            self.fail("E313", expr, f"'{label}' is a label of several choices, and nothing here says which is meant",
                      "compare it with the component it belongs to")  # fmt: skip
        self.fail("E302", expr, f"'{label}' is not defined here", suggest(label, scope.names()))

    def _name(self, expr: s.Name, scope: Scope, want: Domain | None) -> Value:
        if want is not None and not expr.primed and expr.id in want.labels:
            return self.label(expr.id, expr, scope, want)
        binding = scope.lookup(expr.written)
        match binding:
            case Value():
                return binding
            case Lazy(resolve=resolve):
                return resolve(expr)
            case FunctionDef(arguments=arguments):
                self.fail("E304", expr, f"'{expr.id}' is a function of {', '.join(arguments)}; call it")
            case Unavailable(code=code, message=message, hint=hint):
                self.fail(code, expr, message, hint)
            case None:
                return self._unbound(expr, scope, want)

    def _unbound(self, expr: s.Name, scope: Scope, want: Domain | None) -> Value:
        if expr.id in CONSTANTS and not expr.primed:
            return Value(self.builder.scalar(CONSTANTS[expr.id]))
        if expr.primed:
            if scope.lookup(expr.id) is None:
                self.fail(
                    "E302",
                    expr,
                    f"'{expr.written}' is not defined here",
                    suggest(expr.id, scope.names()),
                )
            self.fail("E308", expr, f"'{expr.id}' has no next value here", "a prime stands only on state components, "
                      "in `dynamics`, `reward` and `terminal`")  # fmt: skip
        if expr.id in ("true", "false"):
            self.fail(
                "E302",
                expr,
                f"'{expr.id}' is not defined here",
                f"write {expr.id.capitalize()} inside an expression",
            )
        if scope.labelled(expr.id) or (want is not None and nearest(expr.id, want.labels)):
            return self.label(expr.id, expr, scope, want)
        if calls.is_function(expr.id):
            self.fail("E304", expr, f"'{expr.id}' is a function; call it with arguments")
        hint = _TRUTHS.get(expr.id.lower()) or suggest(expr.id, scope.names())
        if hint is None and want is not None:
            return self.label(expr.id, expr, scope, want)
        self.fail("E302", expr, f"'{expr.id}' is not defined here", hint)

    # -- operators ------------------------------------------------------------------------------------------------

    def _operator(self, expr: s.Unary | s.Binary | s.Logical, scope: Scope) -> Node:
        b = self.builder
        match expr:
            case s.Unary(op="not", operand=operand):
                return b.apply("not", self.numeric(operand, scope))
            case s.Unary(op=sign, operand=operand):
                node = self.numeric(operand, scope)
                return b.apply("neg", node) if sign == "-" else b.cast(node, Kind.INT)
            case s.Binary(op="**", left=left, right=right):
                return b.power(*self.numerics((left, right), scope))
            case s.Binary(op=op, left=left, right=right):
                return b.apply(_ARITHMETIC[op], *self.numerics((left, right), scope))
            case s.Logical(op=op, operands=operands):
                nodes = self.numerics(operands, scope)
                result = nodes[0]
                for node in nodes[1:]:
                    result = b.apply(op, result, node)
                return result
            case _:
                assert_never(expr)

    def _vector(self, items: tuple[s.Expr, ...], expr: s.Expr, scope: Scope) -> Node:
        return self._stack(self.numerics(items, scope), expr)

    def _stack(self, nodes: list[Node], expr: s.Expr) -> Node:
        if not nodes:
            self.fail("E307", expr, "a vector needs at least one element")
        shapes = {n.type.shape for n in nodes}
        if len(shapes) > 1:
            self.fail("E307", expr, "the elements of this vector have different shapes",
                      "`concat(x, y)` lays vectors end to end")  # fmt: skip
        return self.builder.structure("vector", nodes)


def _article(type: Type) -> str:
    text = str(type)
    return f"an {text}" if text[0] in "aeiou" else f"a {text}"
