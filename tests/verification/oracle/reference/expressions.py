"""Expressions: everything that is written is evaluated, in the order in which it is written."""

from __future__ import annotations

import ast
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from tests.verification.oracle.reference import operators
from tests.verification.oracle.reference.chance import Chance
from tests.verification.oracle.reference.distributions import DISTRIBUTIONS, Call
from tests.verification.oracle.reference.functions import FUNCTIONS
from tests.verification.oracle.reference.late import names_late
from tests.verification.oracle.reference.syntax import parse
from tests.verification.oracle.reference.values import (
    Choice,
    Value,
    Wrong,
    elementwise,
    joint_kind,
    number,
    same,
    scalar,
    settled,
    vector,
)

Lookup = Callable[[str], Value | None]

BUILT_IN = {"pi": scalar(math.pi), "inf": scalar(math.inf)}


@dataclass(frozen=True)
class Function:
    """A definition with arguments."""

    arguments: tuple[str, ...]
    body: Any


@dataclass
class Place:
    """Which expression is being evaluated, and how many of its draws have been met: the keys of its draws."""

    root: str = ""
    met: int = 0


def no_choice(name: str) -> Choice | None:
    return None


@dataclass
class Scope:
    """What names mean where an expression stands."""

    lookup: Lookup
    functions: dict[str, Function]
    labelled: Callable[[str], Choice | None] = no_choice
    """The choice that a name is of, found without evaluating anything."""
    late: Callable[[str], bool] = lambda name: False
    """Whether a name is known only when the task runs, found without evaluating anything."""
    chance: Chance | None = None
    place: Place = field(default_factory=Place)
    local: dict[str, Value] = field(default_factory=dict)
    outer: Scope | None = None
    """The scope without local names, where the bodies of functions are read."""

    def key(self) -> tuple[str, int]:
        self.place.met += 1
        return self.place.root, self.place.met

    def inner(self, names: dict[str, Value]) -> Scope:
        return replace(self, local={**self.local, **names}, outer=self.outer or self)

    def body(self, names: dict[str, Value]) -> Scope:
        top = self.outer or self
        return replace(top, local=names, outer=top)


def evaluate(text: str, scope: Scope, expected: Choice | None = None) -> Value:
    return visit(parse(text), scope, expected)


def visit(node: ast.expr, scope: Scope, expected: Choice | None = None) -> Value:
    """The value of an expression; `expected` is the choice whose labels may stand here."""
    match node:
        case ast.Constant(value=str() as label):
            return of_label(label, expected)
        case ast.Constant(value=bool() | int() | float() as x):
            return scalar(x)
        case ast.Name(id=name):
            return of_name(name, scope, expected)
        case ast.IfExp():
            return branch(node, scope, expected)
        case ast.BoolOp(op=op, values=values):
            join = operators.both_hold if isinstance(op, ast.And) else operators.either_holds
            parts = [operators.conditions(visit(v, scope)) for v in values]
            return functools.reduce(functools.partial(elementwise, join, "bool"), parts)
        case ast.UnaryOp(op=op, operand=operand):
            return unary(op, visit(operand, scope))
        case ast.BinOp(left=left, op=op, right=right):
            return operators.binary(op, visit(left, scope), visit(right, scope))
        case ast.Compare():
            return comparison(node, scope)
        case ast.Tuple(elts=parts) | ast.List(elts=parts):
            return vector([visit(p, scope) for p in parts])
        case ast.ListComp(elt=element, generators=generators):
            parts = [visit(element, inner) for inner in scopes(generators, scope)]
            return vector(parts) if parts else replace(vector(parts), fixed=not names_late(node, scope))
        case ast.Subscript(value=value, slice=index):
            return subscript(visit(value, scope), index, scope)
        case ast.Call():
            return call(node, scope, expected)
    raise Wrong(f"this is no expression: {ast.dump(node)}")


def of_label(label: str, expected: Choice | None) -> Value:
    if expected is None or label not in expected.labels:
        raise Wrong(f"no label {label} here")
    return Value("choice", (), (expected.labels.index(label),), True, choice=expected)


def of_name(name: str, scope: Scope, expected: Choice | None) -> Value:
    if name in scope.local:
        return scope.local[name]
    if name in BUILT_IN:
        return BUILT_IN[name]
    value = scope.lookup(name)
    return of_label(name, expected) if value is None else value


def unary(op: ast.unaryop, operand: Value) -> Value:
    match op:
        case ast.Not():
            return operators.invert(operand)
        case ast.USub():
            return operators.negate(operand)
        case ast.UAdd():
            return operators.plus(operand)
    raise Wrong("no such operator")


def branch(node: ast.IfExp, scope: Scope, expected: Choice | None) -> Value:
    condition = visit(node.test, scope)
    expected = expected or choice_of(node, scope)
    values = [(lambda n=n: visit(n, scope, expected)) for n in (node.body, node.orelse)]
    return alternatives([condition], values, lambda: names_late(node, scope))


Values = Sequence[Callable[[], Value]]


def alternatives(conditions: Sequence[Value], values: Values, is_late: Callable[[], bool]) -> Value:
    """The first value whose condition holds, or else the last; one that parameters exclude may not exist, but names things."""
    decided = False
    found = []
    for i, value in enumerate(values):
        condition = conditions[i] if i < len(conditions) else None
        known = condition is not None and condition.fixed
        try:
            found.append((condition, value()))
        except Wrong:
            if not decided and not (known and not condition.item):
                raise
        decided = decided or (known and condition.item)
    result = found[-1][1]
    for condition, value in reversed(found[:-1]):
        result = choose(condition, value, result)
    return result if len(found) == len(values) else replace(result, fixed=result.fixed and not is_late())


def choose(condition: Value, x: Value, y: Value) -> Value:
    """`x if condition else y`: of one condition, two values of any kinds that go together."""
    if condition.kind != "bool" or condition.shape:
        raise Wrong("one condition is needed")
    if x.kind == y.kind == "choice" and x.choice == y.choice:
        picked = x if condition.item else y
        return replace(picked, fixed=picked.fixed and condition.fixed)
    if condition.fixed and x.shape and y.shape and x.shape != y.shape:
        return number(x if condition.item else y)
    kind = joint_kind([number(x), number(y)])
    return elementwise(lambda c, p, q: p if c else q, kind, condition, x, y)


def comparison(node: ast.Compare, scope: Scope) -> Value:
    """A chain of comparisons: each operand is evaluated once, from left to right."""
    operands = [node.left, *node.comparators]
    choice = first_choice(operands, scope)
    known: list[Value | list[Value]] = []
    for i, operand in enumerate(operands):
        asked_in = i > 0 and isinstance(node.ops[i - 1], ast.In | ast.NotIn)
        known.append(members(operand, scope, choice) if asked_in else visit(operand, scope, choice))
    links = [link(op, known[i], known[i + 1]) for i, op in enumerate(node.ops)]
    return functools.reduce(functools.partial(elementwise, operators.both_hold, "bool"), links)


def link(op: ast.cmpop, left: Value | list[Value], right: Value | list[Value]) -> Value:
    if isinstance(left, list):
        raise Wrong("a set is not a value")
    if isinstance(right, list):
        inside = any(same(left, member) for member in right)
        fixed = left.fixed and all(m.fixed for m in right)
        return Value("bool", (), (inside == isinstance(op, ast.In),), fixed)
    return operators.compare(op, left, right)


def first_choice(operands: Sequence[ast.expr], scope: Scope) -> Choice | None:
    """The choice that the labels of a comparison belong to: that of the first operand that has one."""
    for operand in operands:
        for node in (operand, *(operand.elts if isinstance(operand, ast.Set) else ())):
            found = choice_of(node, scope)
            if found is not None:
                return found
    return None


def choice_of(node: ast.expr, scope: Scope) -> Choice | None:
    """The choice that an expression is of, found without evaluating draws."""
    match node:
        case ast.Name(id=name):
            return scope.local[name].choice if name in scope.local else scope.labelled(name)
        case ast.IfExp(body=x, orelse=y):
            return choice_of(x, scope) or choice_of(y, scope)
    return None


def members(node: ast.expr, scope: Scope, expected: Choice | None = None) -> list[Value]:
    """The elements of a set that is written out; equal ones count once."""
    match node:
        case ast.Set(elts=parts) | ast.Tuple(elts=parts) | ast.List(elts=parts):
            found = [visit(p, scope, expected) for p in parts]
        case ast.SetComp(elt=element, generators=[generator]):
            found = [visit(element, inner, expected) for inner in each(generator, scope)]
        case ast.Call(func=ast.Name(id="range" | "box")):
            found = points(node, scope)
        case _:
            raise Wrong("a set is needed")
    distinct: dict[Any, Value] = {}
    for v in found:
        distinct.setdefault((v.choice, v.data), v)
    return list(distinct.values())


def points(node: ast.expr, scope: Scope) -> list[Value]:
    """What a comprehension goes over: a range, a box, a set, or the rows of a constant vector."""
    match node:
        case ast.Call(func=ast.Name(id="range"), args=args):
            return [scalar(i) for i in range(*(visit(a, scope).item for a in args))]
        case ast.Call(func=ast.Name(id="box"), args=args):
            low, high, n = (visit(a, scope).item for a in args)
            return [vector(list(map(scalar, p))) for p in itertools.product(range(low, high + 1), repeat=n)]
        case ast.Set() | ast.SetComp():
            return members(node, scope)
    return number(visit(node, scope)).rows()


def each(generator: ast.comprehension, scope: Scope) -> list[Scope]:
    """The scopes of a comprehension, one for each point that fulfils its conditions."""
    assert isinstance(generator.target, ast.Name)
    inner = [scope.inner({generator.target.id: p}) for p in points(generator.iter, scope)]
    return [s for s in inner if all(visit(c, s).item for c in generator.ifs)]


def scopes(generators: Sequence[ast.comprehension], scope: Scope) -> list[Scope]:
    """The scopes of all points of several clauses, the last of which goes fastest."""
    if not generators:
        return [scope]
    return [inner for outer in each(generators[0], scope) for inner in scopes(generators[1:], outer)]


def subscript(value: Value, index: ast.expr, scope: Scope) -> Value:
    return part(value, [place(i, scope) for i in (index.elts if isinstance(index, ast.Tuple) else [index])])


def place(index: ast.expr, scope: Scope) -> Value | slice:
    if not isinstance(index, ast.Slice):
        return visit(index, scope)
    ends = (index.lower, index.upper, index.step)
    return slice(*(None if e is None else visit(e, scope).item for e in ends))


def part(value: Value, places: Sequence[Value | slice]) -> Value:
    """What is left of a value at a place on each of its first axes."""
    if not places:
        return value
    first, *rest = places
    if isinstance(first, slice):
        cut = operators.section(value, first)
        return vector([part(row, rest) for row in cut.rows()]) if rest else cut
    return part(operators.element(value, first), rest)


def call(node: ast.Call, scope: Scope, expected: Choice | None) -> Value:
    assert isinstance(node.func, ast.Name)
    name = node.func.id
    if name in DISTRIBUTIONS:
        return draw(name, node, scope, expected)
    if name in ("fold", "scan"):
        return folded(node, scope)
    if name == "put" and isinstance(node.args[1], ast.Tuple | ast.List):  # an index for each axis, each by itself
        x, i, new = node.args
        return FUNCTIONS[name](*map(number, (visit(x, scope), *(visit(e, scope) for e in i.elts), visit(new, scope))))
    args = [visit(a, scope) for a in node.args]
    if name in scope.functions:
        f = scope.functions[name]
        return scope_forms()(f.body, scope.body(dict(zip(f.arguments, args, strict=True))), expected)
    return FUNCTIONS[name](*map(number, args))


def folded(node: ast.Call, scope: Scope) -> Value:
    """A definition of two arguments, taken through a vector."""
    step, start, x = node.args
    assert isinstance(step, ast.Name) and isinstance(node.func, ast.Name)
    f = scope.functions[step.id]
    value = visit(start, scope)
    found = []
    for element in number(visit(x, scope)).rows():
        value = scope_forms()(f.body, scope.body(dict(zip(f.arguments, (value, element), strict=True))), None)
        found.append(value)
    whole = value if node.func.id == "fold" else vector(found)
    return whole if found else settled(whole.kind, whole.shape, whole.data, fixed=not names_late(node, scope))


def scope_forms() -> Callable[[Any, Scope, Choice | None], Value]:
    """Bodies of definitions may have any form; imported late, as forms are made of expressions."""
    from tests.verification.oracle.reference.forms import form

    return form


def draw(name: str, node: ast.Call, scope: Scope, expected: Choice | None) -> Value:
    """A draw: its arguments first, then its own words."""
    if scope.chance is None:
        raise Wrong("no draw may stand here")
    keywords = {k.arg or "": visit(k.value, scope) for k in node.keywords if k.arg != "shape"}
    shape = next((visit(k.value, scope) for k in node.keywords if k.arg == "shape"), None)
    match node.args:
        case [ast.Dict(keys=keys, values=shares)]:
            values = [k for k in keys if k is not None]
            expected = expected or first_choice(values, scope)
            outcomes = [visit(k, scope, expected) for k in values]
            made = Call([], {}, outcomes=outcomes, shares=[visit(p, scope) for p in shares])
        case [ast.Set() | ast.SetComp() as elements] | [ast.Call(func=ast.Name(id="range" | "box")) as elements]:
            made = Call([], {}, outcomes=members(elements, scope, expected or first_choice([elements], scope)))
        case args:
            made = Call([visit(a, scope) for a in args], keywords)
    made.shape = None if shape is None else tuple(shape.data)
    return DISTRIBUTIONS[name](made, scope.chance, scope.key())
