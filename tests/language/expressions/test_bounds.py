"""Bounds hold: for every rule, at the corners of boxes and beside them, by the arithmetic of every backend.

The same over millions of values: `python -m tests.verification.fuzz.bounds --seconds 600`.
"""

import math
import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.types import INT, INT_MAX, REAL, Kind, Role, Type
from tests.shared.sparse import sparse
from tests.verification.fuzz.bounds import COMPILED, EVERY, QUICK, breaches

INF = math.inf


@pytest.mark.parametrize("root", sparse(EVERY, 4))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.data_too_large])
@given(chance=st.randoms(use_true_random=False))
def test_of_every_operator(root: str, chance: random.Random) -> None:
    assert breaches(chance, QUICK, root)[1] == []


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.data_too_large])
@given(chance=st.randoms(use_true_random=False))
def test_of_trees_of_operators(chance: random.Random) -> None:
    assert breaches(chance, QUICK)[1] == []


@pytest.mark.parametrize("form", [pytest.param(f, marks=pytest.mark.slow) for f in COMPILED])
@pytest.mark.parametrize("root", EVERY)
def test_of_every_operator_compiled(root: str, form: str) -> None:
    pytest.importorskip(form)
    for seed in range(4):
        assert breaches(random.Random(seed), {form: COMPILED[form]}, root)[1] == []


# -- values worked out by hand ----------------------------------------------------------------------------------------


def read(b: Builder, low: float, high: float, type_: Type = REAL) -> Node:
    return b.read(Role.STATE, f"x{low}{high}", type_, low, high)


def test_sums_are_added_as_the_run_time_adds() -> None:
    b = Builder()
    tenths = read(b, 0.1, 0.1, Type(Kind.REAL, (10,)))
    total = sum([0.1] * 9, 0.1)
    assert total < 1  # ten times 0.1 is 0.9999999999999999 from left to right
    assert b.bounds(b.apply("sum", tenths)) == (total, total)
    assert b.bounds(b.apply("floor", b.apply("sum", tenths))) == (0, 0)
    assert b.bounds(b.apply("cumsum", tenths)) == (0.1, total)


def test_products_are_multiplied_as_the_run_time_multiplies() -> None:
    b = Builder()
    factors = read(b, 1.1, 1.1, Type(Kind.REAL, (5,)))
    product = math.prod([1.1] * 5)
    assert product != 1.1**5
    assert b.bounds(b.apply("prod", factors)) == (product, product)


def test_ints_are_exact() -> None:
    b = Builder()
    wide = read(b, 2**53 + 1, 2**53 + 1, INT)
    assert b.bounds(b.apply("sub", wide, b.scalar(2**53))) == (1, 1)
    assert b.certain(b.apply("mul", wide, wide)) == (-INF, INF)  # it may leave 64 bits, and then be anything


def test_what_comes_from_reals_is_not_certain() -> None:
    b = Builder()
    third = b.apply("floor", read(b, 0.0, 2.5))
    assert b.bounds(third) == (0, 2)
    assert b.certain(third) == (-INT_MAX, INT_MAX)
    assert b.within(third, 0, 2) is not third
    assert b.certain(b.within(third, 0, 2)) == (0, 2)
    s = read(b, 0, 2, INT)
    assert b.within(s, 0, 2) is s


@pytest.mark.parametrize(
    ("op", "low", "high", "finite"),
    [
        ("sqrt", 0.0, 4.0, True), ("sqrt", -1e-9, 4.0, False), ("log", 1e-9, 4.0, True), ("log", 0.0, 4.0, False),
        ("exp", -1e9, 699.0, True), ("exp", 0.0, 710.0, False), ("sin", -1e300, 1e300, True), ("tan", 0.0, 1.0, False),
    ],
)  # fmt: skip
def test_what_is_proved_to_be_a_number(op: str, low: float, high: float, finite: bool) -> None:
    b = Builder()
    assert b.finite(b.apply(op, read(b, low, high))) is finite


def test_overflow_and_what_follows_from_it_are_not_numbers() -> None:
    b = Builder()
    x = read(b, 0.0, 1000.0)
    endless = b.apply("exp", x)
    assert not b.finite(b.apply("sin", endless))  # nan where x is large enough
    shifted = b.apply("floor", b.apply("add", b.apply("sin", endless), b.scalar(5.0)))
    assert b.bounds(shifted)[0] == 0  # floor(nan) is 0
    assert not b.finite(b.apply("mul", read(b, 0.0, 1e200), read(b, 0.0, 1e200)))


def test_what_is_known_of_a_draw_is_not_taken_for_another() -> None:
    """Nodes are told apart by where they lie in memory: one that is dropped must not leave its bounds to the next."""
    b = Builder()
    for k in range(50):
        base = "normal" if k % 2 else "uniform"
        low = b.bounds(b.draw(base, (), Type(Kind.REAL)))[0]
        assert (low < 0) is bool(k % 2)
