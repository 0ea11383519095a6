"""Numbers in which different expressions differ: arithmetic modulo a large prime, everything else a hash of its arguments.

Sums, differences, products and quotients are exact, so that `a - (b - c)` is `a - b + c`. Conditions are numbers too:
`and` is a product, `not x` is `1 - x`, and a comparison is a hash of its sides. Two expressions of different meaning are
equal with a probability of about 2**-60 (Schwartz and Zippel), so one point is enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from hashlib import blake2b
from typing import Any

PRIME = 2**61 - 1
SMALL = 1000  # exponents and table keys up to here are numbers; beyond, hashes
Value = int


def mixed(*parts: Any) -> Value:
    """A number that stands for an operation without laws of its own."""
    return int.from_bytes(blake2b(repr(parts).encode(), digest_size=8).digest()) % PRIME


def number(text: str) -> Value:
    """Digits, a decimal point and an exponent, as written."""
    from fractions import Fraction

    value = Fraction(text)
    return value.numerator * pow(value.denominator, -1, PRIME) % PRIME


def add(a: Value, b: Value) -> Value:
    return (a + b) % PRIME


def subtract(a: Value, b: Value) -> Value:
    return (a - b) % PRIME


def multiply(a: Value, b: Value) -> Value:
    return a * b % PRIME


def divide(a: Value, b: Value) -> Value:
    return a * (pow(b, -1, PRIME) if b else mixed("by zero")) % PRIME


def small(a: Value) -> int | None:
    """A number near 0, with its sign."""
    signed = a if a <= PRIME // 2 else a - PRIME
    return signed if abs(signed) <= SMALL else None


def power(a: Value, b: Value) -> Value:
    exponent = small(b)
    if exponent is None or (exponent < 0 and a == 0):
        return mixed("power", a, b)
    return pow(a, exponent, PRIME)


def modulo(a: Value, b: Value) -> Value:
    return mixed("mod", a, b)


def floor(a: Value) -> Value:
    return mixed("floor", a)


def equal(a: Value, b: Value) -> Value:
    if a == b:
        return 1
    both_known = small(a) is not None and small(b) is not None
    return 0 if both_known else mixed("equal", a, b)


def negation(a: Value) -> Value:
    return subtract(1, a)


def less(a: Value, b: Value) -> Value:
    return mixed("less", a, b)


def conjunction(values: Iterable[Value]) -> Value:
    return reduce(multiply, values, 1)


def disjunction(values: Iterable[Value]) -> Value:
    return negation(conjunction(map(negation, values)))


def choice(condition: Value, then: Value, otherwise: Value) -> Value:
    return add(multiply(condition, then), multiply(negation(condition), otherwise))


RELATIONS = {
    "=": equal,
    "≠": lambda a, b: negation(equal(a, b)),
    "<": less,
    ">": lambda a, b: less(b, a),
    "≥": lambda a, b: negation(less(a, b)),
    "≤": lambda a, b: negation(less(b, a)),
}


def index(whole: Value, below: Sequence[Any]) -> Value:
    """`v[i]`; a slice among the indices is a tuple of its parts."""
    return mixed("index", whole, *below)


def bound(depth: int) -> Value:
    """The variable of a sum, a quantifier or a set, by how many stand around it."""
    return mixed("bound", depth)


def integers(low: Value, high: Value) -> tuple[Any, ...]:
    """The set {low, ..., high}."""
    first = small(low)
    last = small(high)
    if first is not None and last is not None and last - first <= 3:
        return ("set", *(i % PRIME for i in range(first, last + 1)))
    return ("integers", low, high)


def member(a: Value, items: tuple[Any, ...]) -> Value:
    if items[0] == "set":
        return disjunction(equal(a, item) for item in items[1:])
    return mixed("member", a, items)
