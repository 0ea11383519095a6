"""The functions of the language, by name: each takes values and gives a value."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

from tests.verification.oracle.reference import arithmetic as a
from tests.verification.oracle.reference.values import (
    Number,
    Value,
    Wrong,
    as_float,
    elementwise,
    joint_kind,
    number,
    settled,
    vector,
    watch,
)

Function = Callable[..., Value]
FUNCTIONS: dict[str, Function] = {}


def function(name: str) -> Callable[[Function], Function]:
    def register(f: Function) -> Function:
        FUNCTIONS[name] = f
        return f

    return register


def numeric(*values: Value) -> str:
    """The kind of a sum of these values: bools count as ints."""
    kind = joint_kind(number(v) for v in values)
    return "int" if kind == "bool" else kind


def elements(value: Value) -> list[Value]:
    """All elements of a vector or matrix, one by one."""
    flat = number(value)
    if not flat.shape:
        raise Wrong("a vector is needed")
    return [Value(flat.kind, (), (x,), flat.fixed, flat.rough) for x in flat.data]


def rounded(f: Callable[[Number], int]) -> Function:
    def of(x: Value) -> Value:
        if number(x).rough:
            for e in number(x).data:
                watch(2 * e, round(2 * e) if math.isfinite(e) else e, rough=True)
        return elementwise(f, "int", x)

    return of


FUNCTIONS.update(floor=rounded(a.floor), ceil=rounded(a.ceil), round=rounded(a.nearest))


def c_function(f: Callable[..., float], *, rough: bool = True) -> Function:
    return lambda *xs: elementwise(f, "real", *xs, rough=rough)


FUNCTIONS.update(
    sqrt=c_function(a.real_function(math.sqrt), rough=False),
    exp=c_function(a.real_function(math.exp)),
    log=c_function(a.logarithm),
    sin=c_function(a.real_function(math.sin)),
    cos=c_function(a.real_function(math.cos)),
    tan=c_function(a.real_function(math.tan)),
    tanh=c_function(a.real_function(math.tanh)),
    asinh=c_function(a.real_function(math.asinh)),
    atan2=c_function(a.real_function(math.atan2)),
)


@function("abs")
def absolute(x: Value) -> Value:
    return elementwise(abs, numeric(x), x)


@function("sign")
def sign(x: Value) -> Value:
    if number(x).rough:
        for e in number(x).data:
            watch(e, 0, rough=True)
    return elementwise(a.sign, numeric(x), x)


def extremum(pick: Callable[[Number, Number], Number]) -> Function:
    def of(x: Value, *rest: Value) -> Value:
        args = [x, *rest] if rest else elements(x)
        if not args:
            raise Wrong("there is no smallest element, and no largest one")
        kind = numeric(*args)
        return functools.reduce(
            lambda p, q: elementwise(pick, kind, p, q), args[1:], elementwise(a_number, kind, args[0])
        )

    return of


def a_number(x: Number) -> Number:
    return +x


FUNCTIONS.update(min=extremum(a.minimum), max=extremum(a.maximum))


@function("clip")
def clip(x: Value, low: Value, high: Value) -> Value:
    return elementwise(a.clip, numeric(x, low, high), x, low, high)


@function("where")
def where(condition: Value, x: Value, y: Value) -> Value:
    return elementwise(lambda c, p, q: p if c else q, joint_kind([number(x), number(y)]), condition, x, y)


def folded(f: Callable[[Number, Number], Number], start: int) -> Function:
    def of(x: Value) -> Value:
        parts = elements(x)
        kind = numeric(x)
        total = functools.reduce(f, (e.item for e in parts), start)
        return settled(kind, (), (total,), fixed=x.fixed, rough=number(x).rough or len(parts) > 2)

    return of


FUNCTIONS.update(sum=folded(a.add, 0), prod=folded(a.multiply, 1))


def condition(f: Callable[[Sequence[bool]], bool | int], kind: str) -> Function:
    return lambda x: settled(kind, (), (f([e.item for e in elements(x)]),), fixed=x.fixed)


FUNCTIONS.update(any=condition(any, "bool"), all=condition(all, "bool"), count=condition(sum, "int"))


def compared(x: Value) -> list[Any]:
    """Elements as they are compared: fractions beside floats are floats."""
    items = [e.item for e in elements(x)]
    return [as_float(i) for i in items] if any(isinstance(i, float) for i in items) else items


def order(x: Value) -> list[int]:
    """Indices that sort a vector: equals keep their places, nan comes last."""
    items = compared(x)
    if number(x).rough:
        sharp = sorted(items, key=lambda e: (a.is_nan(e), e))
        for p, q in itertools.pairwise(sharp):
            watch(p, q, rough=True)
    return sorted(range(len(items)), key=lambda i: (a.is_nan(items[i]), 0 if a.is_nan(items[i]) else items[i]))


@function("argsort")
def argsort(x: Value) -> Value:
    return settled("int", x.shape, order(x), fixed=x.fixed)


@function("sort")
def sort(x: Value) -> Value:
    flat = number(x)
    keys = sorted(flat.data, key=lambda e: (a.is_nan(e), 0 if a.is_nan(e) else e))
    return settled(flat.kind, flat.shape, keys, fixed=flat.fixed, rough=flat.rough)


def best(sense: int) -> Function:
    def of(x: Value) -> Value:
        items = compared(x)
        if not items:
            raise Wrong("there is no best element")
        real = [i for i, e in enumerate(items) if not a.is_nan(e)]
        chosen = min(real, key=lambda i: sense * items[i]) if real else 0
        for i in real:
            if i != chosen:
                watch(items[i], items[chosen], rough=number(x).rough)
        return settled("int", (), (chosen,), fixed=x.fixed)

    return of


FUNCTIONS.update(argmin=best(1), argmax=best(-1))


@function("cumsum")
def cumsum(x: Value) -> Value:
    sums: list[Number] = []
    for e in elements(x):
        sums.append(a.add(sums[-1], e.item) if sums else e.item)
    return settled(numeric(x), x.shape, sums, fixed=x.fixed, rough=number(x).rough or len(sums) > 2)


@function("dot")
def dot(x: Value, y: Value) -> Value:
    """Of vectors a number; a matrix is taken row by row, and one on the right column by column."""
    if len(number(x).shape) == 2:
        return touched(vector([dot(row, y) for row in number(x).rows()]), x, y)
    if len(number(y).shape) == 2:
        rows = [row.rows() for row in number(y).rows()]
        return touched(vector([dot(x, vector([row[j] for row in rows])) for j in range(number(y).shape[1])]), x, y)
    return FUNCTIONS["sum"](elementwise(a.multiply, numeric(x, y), x, y))


@function("reshape")
def reshape(x: Value, shape: Value) -> Value:
    flat = number(x)
    return settled(flat.kind, tuple(shape.data), flat.data, fixed=flat.fixed, rough=flat.rough)


@function("norm1")
def norm1(x: Value) -> Value:
    return FUNCTIONS["sum"](absolute(x))


@function("norm2")
def norm2(x: Value) -> Value:
    squares = FUNCTIONS["sum"](elementwise(a.multiply, numeric(x), x, x))
    return elementwise(a.real_function(math.sqrt), "real", squares, rough=squares.rough)


@function("concat")
def concat(*parts: Value) -> Value:
    rows: list[Value] = []
    for part in map(number, parts):
        rows.extend(part.rows() if part.shape else [part])
    made = vector(rows)
    known = all(part.fixed for part in parts)  # those without elements included
    return settled(joint_kind(map(number, parts)), made.shape, made.data, fixed=known, rough=made.rough)


@function("reverse")
def reverse(x: Value) -> Value:
    return touched(vector(number(x).rows()[::-1]), x)


def places(index: Value, n: int) -> list[int]:
    """Indices moved to the nearest places of a vector of length n; those known before the task runs count from either end."""
    return [max(0, min(n - 1, i + n if index.fixed and i < 0 else i)) for i in index.data]


def place(index: Value, n: int) -> int:
    (found,) = places(Value(index.kind, (1,), (index.item,), index.fixed), n)
    return found


@function("swap")
def swap(x: Value, i: Value, j: Value) -> Value:
    rows = number(x).rows()
    if not rows:
        raise Wrong("there is nothing to swap")
    p = place(number(i), len(rows))
    q = place(number(j), len(rows))
    rows[p], rows[q] = rows[q], rows[p]
    return touched(vector(rows), i, j)


@function("put")
def put(x: Value, i: Value, *rest: Value) -> Value:
    """The vector with a row replaced; with an index for each axis, in one vector or one by one, an element."""
    if not x.data:
        raise Wrong("there is no element")
    if len(x.shape) > 1 and i.shape == (len(x.shape),):
        return put(x, *i.rows(), *rest)
    *deeper, value = rest
    if deeper:
        row = number(x).rows()[place(number(i), x.shape[0])]
        return touched(put(x, i, put(row, *deeper, value)), i)
    rows = number(x).rows()
    new = number(value)
    if new.shape != rows[0].shape:
        new = elementwise(lambda _, v: v, new.kind, rows[0], new)
    rows[place(number(i), len(rows))] = new
    kind = joint_kind([number(x), new])
    return touched(settled(kind, x.shape, vector(rows).data, fixed=x.fixed and new.fixed, rough=vector(rows).rough), i)


def touched(value: Value, *by: Value) -> Value:
    """The value as what it is after values that are known only at run time had a say in it."""
    fixed = value.fixed and all(v.fixed for v in by)
    return settled(value.kind, value.shape, value.data, fixed=fixed, rough=value.rough)


@function("onehot")
def onehot(i: Value, n: Value) -> Value:
    return settled("int", (n.item,), [int(k == number(i).item) for k in range(n.item)], fixed=i.fixed)


@function("len")
def length(x: Value) -> Value:
    if not x.shape:
        raise Wrong("`len` needs a vector")
    return settled("int", (), (x.shape[0],), fixed=True)
