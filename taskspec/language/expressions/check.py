"""Surface syntax -> typed core: resolve names and labels, check kinds and shapes.

An expression with several mistakes reports them all: the parts are checked one by one, a mistake goes to the collector at once,
and only what needs the value of a broken part is given up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial, reduce
from typing import assert_never

from taskspec.base.diagnostics import Advice, Collector, Diagnostic, SpecError, nearest, suggest
from taskspec.base.limits import how_to_raise, limits
from taskspec.language.expressions import alternatives, calls, sets
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.operators import FUNCTIONS, INFIX
from taskspec.language.expressions.scope import BaseChecker, FunctionDef, Lazy, Scope, Unavailable, Value
from taskspec.language.expressions.types import Domain, Kind, Refused

CONSTANTS = {"pi": math.pi, "inf": math.inf}
_PRIMES = (
    "only state components have one, which `dynamics`, `reward` and `terminal` may use; "
    "`memory` may use the next value of an observation"
)


def truth_hint(word: str) -> Advice | None:
    """Suggest `true` or `false` for a truth value of other formats."""
    truth = {"yes": "true", "on": "true", "no": "false", "off": "false"}.get(word.lower())
    if truth is None:
        return None
    return Advice(f"a truth value is `{truth}`", word, truth)


class TooManyExpressions(SpecError):
    """A task comes to more expressions than the limit allows (E314)."""


class Checker(BaseChecker):
    """Checks expressions of one task against scopes; nodes come from one builder, messages go to one collector."""

    def __init__(self, builder: Builder, collector: Collector) -> None:
        super().__init__(builder, collector)
        self.checked = 0
        self._most = limits().expressions

    def value(self, expr: s.Expr, scope: Scope, want: Domain | None = None) -> Value:
        self.checked += 1
        if self.checked > self._most:
            message = f"the task has more than {self._most:,} expressions, each counted as often as it is written out"
            hint = how_to_raise("expressions", 2 * self._most)
            raise TooManyExpressions([Diagnostic("E314", expr.place.span, message, hint)])
        try:
            value = self._value(expr, scope, want)
            if scope.parent is None:
                self.results[id(expr), id(scope)] = expr, value
            return value
        except Refused as refused:
            self.fail(refused.code, expr, refused.message, refused.hint)
        except RecursionError:
            pass  # said below, where the stack has room again
        self.fail("E314", expr, "this is nested too deeply, with the definitions that it uses")

    def _value(self, expr: s.Expr, scope: Scope, want: Domain | None) -> Value:  # noqa: C901, PLR0912
        match expr:
            case s.Number(value=number):
                return self._number(number, want)
            case s.Boolean(value=truth):
                return Value(self.builder.scalar(truth))
            case s.Quoted(value=label):
                return self._label(label, expr, scope, want)
            case s.Name():
                return self._name(expr, scope, want)
            case s.Unary() | s.Binary() | s.Logical():
                return Value(self._operator(expr, scope))
            case s.Compare():
                return Value(sets.compare(self, expr, scope))
            case s.IfElse(condition=condition, then=then, otherwise=otherwise):
                return alternatives.select(self, [(condition, then)], otherwise, scope, want)
            case s.Piecewise(branches=branches, otherwise=otherwise):
                return alternatives.select(self, branches, otherwise, scope, want)
            case s.Call():
                return calls.call(self, expr, scope, want)
            case s.Subscript():
                return calls.subscript(self, expr, scope, want)
            case s.Vector(items=items):
                values = self.each(self._element, [(item, want, scope) for item in items])
                return self._vector(values, items, expr, want)
            case s.Comprehension(is_set=False, element=element):
                values = sets.unroll(self, expr, scope, partial(self._element, element, want))
                return self._vector(values, [element] * len(values), expr, want)
            case s.Weights():
                return alternatives.weighted(self, expr, scope, want)
            case s.Table():
                return alternatives.table(self, expr, scope, want)
            case s.SetOf() | s.Comprehension():
                hint = "draw from it with `Uniform({...})`, or test with `x in {...}`"
                self.fail("E306", expr, "a set is not a value", hint)
            case _:
                assert_never(expr)

    # -- vectors: of labels where these are wanted, else of numbers -------------------------------------------------

    def _element(self, expr: s.Expr, want: Domain | None, scope: Scope) -> Value:
        if want is None:
            return Value(self.numeric(expr, scope))
        return self.value(expr, scope, want)

    def _vector(self, elements: Sequence[Value], exprs: Sequence[s.Expr], whole: s.Expr, want: Domain | None) -> Value:
        nodes, domain = alternatives.unify(self, elements, exprs, want)
        return Value(self.stack(nodes, whole), domain)

    # -- leaves ---------------------------------------------------------------------------------------------------

    def _number(self, number: int | float, want: Domain | None) -> Value:
        if want is not None and want.values is not None and want.values.count(number) == 1:
            return Value(self.builder.scalar(want.values.index(number)), want)
        if want is not None and str(number) in want.labels:
            return Value(self.builder.scalar(want.labels.index(str(number))), want)
        return Value(self.builder.scalar(number))

    def _label(self, label: str, expr: s.Expr, scope: Scope, want: Domain | None) -> Value:
        domains = scope.labelled(label)
        if want is None and len(domains) == 1:
            want = domains[0]
        if want is not None and label in want.labels:
            return Value(self.builder.scalar(want.labels.index(label)), want)
        if want is not None:
            self.fail("E313", expr, f"'{label}' is not one of {', '.join(want.labels)}", suggest(label, want.labels))
        if domains:
            message = f"'{label}' is a label of several choices, and nothing here says which is meant"
            self.fail("E313", expr, message, "compare it with the component it belongs to")
        self.fail("E302", expr, f"'{label}' is not defined here", suggest(label, scope.names()))

    def _name(self, expr: s.Name, scope: Scope, want: Domain | None) -> Value:
        if want is not None and not expr.primed and expr.id in want.labels:
            return self._label(expr.id, expr, scope, want)
        match scope.lookup(expr.written):
            case Value() as value:
                return value
            case Lazy(resolve=resolve):
                with self.lenient(False):
                    return resolve(expr)
            case FunctionDef(arguments=arguments):
                self.fail("E304", expr, f"'{expr.id}' is a function of {', '.join(arguments)}; call it")
            case Unavailable(code=code, message=message, hint=hint):
                self.fail(code, expr, message, hint)
            case None:
                return self._unbound(expr, scope, want)

    def _unbound(self, expr: s.Name, scope: Scope, want: Domain | None) -> Value:
        undefined = f"'{expr.written}' is not defined here"
        if expr.primed:
            if scope.lookup(expr.id) is None:
                self.fail("E302", expr, undefined, suggest(expr.id, scope.names()))
            primes = _PRIMES
            if expr.id == "t":
                primes = "after the step, it is `t + 1`"
            self.fail("E308", expr, f"'{expr.id}' has no next value here", primes)
        if expr.id in CONSTANTS:
            return Value(self.builder.scalar(CONSTANTS[expr.id]))
        if scope.labelled(expr.id) or (want is not None and nearest(expr.id, want.labels)):
            return self._label(expr.id, expr, scope, want)
        if calls.is_function(expr.id):
            self.fail("E304", expr, f"'{expr.id}' is a function; call it with arguments")
        hint = truth_hint(expr.id) or suggest(expr.id, scope.names())
        if hint is None and want is not None:
            return self._label(expr.id, expr, scope, want)
        self.fail("E302", expr, undefined, hint)

    # -- operators ------------------------------------------------------------------------------------------------

    def _operator(self, expr: s.Unary | s.Binary | s.Logical, scope: Scope) -> Node:
        b = self.builder
        match expr:
            case s.Unary(op="not", operand=operand):
                return b.apply("not", self.numeric(operand, scope))
            case s.Unary(op="-", operand=operand):
                return b.apply("neg", self.numeric(operand, scope))
            case s.Unary(operand=operand):
                return b.cast(self.numeric(operand, scope), Kind.INT)
            case s.Binary(op="**", left=left, right=right):
                return b.power(*self.operands((left, right), scope))
            case s.Binary(op=op, left=left, right=right):
                return b.apply(INFIX[op].op, *self.operands((left, right), scope))
            case s.Logical(op=op, operands=operands):
                return reduce(partial(b.apply, op), self.numerics(operands, scope))
            case _:
                assert_never(expr)


# Mistakes in the body of a function that nothing calls.
#
# The types of its arguments are known only where it is called, so names and functions are all that can be checked.


def check_uncalled(collector: Collector, function: FunctionDef) -> None:
    """Report (E302 to E305) names and functions that do not exist, and calls with arguments that they do not take."""
    scope = function.scope
    local = {*function.arguments, *s.targets(function.body), *CONSTANTS}
    for part in s.names(function.body):
        own = scope.lookup(part.written)
        match part:
            case s.Call() if isinstance(own, FunctionDef) or (own is None and part.function in FUNCTIONS):
                called = own if isinstance(own, FunctionDef) else FUNCTIONS[part.function]
                calls.refuse_keywords(collector, part)
                if not part.keywords and not called.accepts(len(part.args)):
                    message = f"{called.signature} was given {calls.count_of(len(part.args))}"
                    collector.add("E304", part.place, message)
            case s.Call():
                if own is None and not calls.is_function(part.function):
                    calls.no_function(collector, part, scope)
            case s.Name() if own is None and part.written not in local and not scope.is_label(part.id):
                message = f"'{part.written}' is not defined here"
                collector.add("E302", part.place, message, suggest(part.id, [*local, *scope.names()]))
