"""Arithmetic of numbers that are known to lie between two others: results lie between the ends that are given."""

import math
import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskspec.exact.solve.enclosure import EQUAL, Enclosure, NoNumber, absolute, arithmetic, compare, negative

numbers = st.fractions(-4, 4, max_denominator=6) | st.sampled_from([Fraction(k) for k in (-2, -1, 0, 1, 2)])
shares = st.sampled_from([Fraction(0), Fraction(1), Fraction(1, 3), Fraction(9, 10)])


@st.composite
def known(draw: Callable[..., Any]) -> tuple[Enclosure, Fraction]:
    """What is known of a number, and the number."""
    low, high = sorted((draw(numbers), draw(numbers)))
    if draw(st.booleans()):
        high = low
    return Enclosure(low, high), low + draw(shares) * (high - low)


OPERATORS = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "//": operator.floordiv, "%": operator.mod,
}  # fmt: skip
COMPARISONS = {"<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}


def holds(a: Enclosure, number: Fraction) -> bool:
    return a.low <= number <= a.high


@pytest.mark.parametrize("op", OPERATORS)
@given(known(), known())
def test_operations(op: str, one: tuple[Enclosure, Fraction], other: tuple[Enclosure, Fraction]) -> None:
    (a, x) = one
    (b, y) = other
    if op in ("/", "//", "%") and holds(b, Fraction(0)):
        with pytest.raises(NoNumber, match="by zero"):
            arithmetic(op, a, b)
        return
    found = arithmetic(op, a, b)
    assert holds(found, Fraction(OPERATORS[op](x, y)))
    assert found.is_exact or not (a.is_exact and b.is_exact)


@given(known(), st.integers(-3, 4))
def test_powers(one: tuple[Enclosure, Fraction], n: int) -> None:
    a, x = one
    if n < 0 and holds(a, Fraction(0)):
        with pytest.raises(NoNumber, match="by zero"):
            arithmetic("**", a, Enclosure.exactly(n))
        return
    found = arithmetic("**", a, Enclosure.exactly(n))
    assert holds(found, x**n)
    assert found.low >= 0 or n % 2


@given(st.fractions(Fraction(1, 100), 100, max_denominator=10**6), st.integers(-60, 60), st.integers(2, 5))
def test_roots(base: Fraction, p: int, q: int) -> None:
    """x is at least the q-th root of b**p where x**q is at least b**p."""
    if p % q == 0:
        return
    found = arithmetic("**", Enclosure.exactly(base), Enclosure.exactly(Fraction(p, q)))
    low = Fraction(found.low)
    high = Fraction(found.high)
    assert low > 0 and low**q <= base**p <= high**q
    assert high - low < low / 2**40


@given(known(), known())
def test_signs_and_hulls(one: tuple[Enclosure, Fraction], other: tuple[Enclosure, Fraction]) -> None:
    (a, x) = one
    (b, y) = other
    assert holds(negative(a), -x)
    assert holds(absolute(a), abs(x))
    assert absolute(a).low >= 0
    assert holds(a.hull(b), x)
    assert holds(a.hull(b), y)


@given(known())
def test_floats_of_a_number_are_rounded_outwards(one: tuple[Enclosure, Fraction]) -> None:
    a, x = one
    assert abs(x - Fraction(a.value)) <= Fraction(a.error)
    assert a.ends[0] <= a.low <= a.high <= a.ends[1]
    assert holds(Enclosure.around(a.value, a.error), x)


@given(known(), known(), st.none() | st.fractions(0, 1, max_denominator=4))
def test_comparisons_that_are_decided_are_true(
    one: tuple[Enclosure, Fraction], other: tuple[Enclosure, Fraction], tolerance: Fraction | None
) -> None:
    (a, x) = one
    (b, y) = other
    slack = tolerance or Fraction(0)
    for op, holds_of in COMPARISONS.items():
        shift = {"<=": -slack, ">=": slack}.get(op, Fraction(0))
        assert compare(op, a, b, tolerance) in (None, holds_of(x + shift, y))
    equal = abs(x - y) <= (EQUAL * max(abs(x), abs(y)) if tolerance is None else tolerance)
    assert compare("==", a, b, tolerance) in (None, equal)
    assert compare("!=", a, b, tolerance) in (None, not equal)


@given(numbers, numbers)
def test_of_exact_numbers_every_comparison_is_decided(x: Fraction, y: Fraction) -> None:
    a = Enclosure.exactly(x)
    b = Enclosure.exactly(y)
    for op, holds_of in COMPARISONS.items():
        assert compare(op, a, b) is holds_of(x, y)
    assert compare("==", a, b) is (abs(x - y) <= EQUAL * max(abs(x), abs(y)))


@given(known())
def test_infinity_equals_itself_alone(one: tuple[Enclosure, Fraction]) -> None:
    infinite = Enclosure.exactly(math.inf)
    assert compare("==", infinite, infinite) is True
    assert compare("==", infinite, one[0]) is False
    assert compare("==", infinite, Enclosure(Fraction(1), math.inf)) is None
    assert compare("<", one[0], infinite) is compare("<=", infinite, infinite) is True


def test_numbers_are_written_in_ten_digits_and_whole_ones_in_full() -> None:
    assert [str(Enclosure.exactly(Fraction(x))) for x in (12345678901, "1/3", 10**17)] == [
        "12345678901", "0.3333333333", "1e+17",
    ]  # fmt: skip
    assert str(Enclosure(Fraction(1), Fraction(2))) == "between 1 and 2"
