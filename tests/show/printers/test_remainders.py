"""Remainders as mathematics: brackets wherever a reader could take `mod` over more than it is of."""

import pytest

from tests.show.printers.test_mathematics import written


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("x % (y * a)", r"x \bmod (ya)"),
        ("x % y * a", r"(x \bmod y) \cdot a"),
        ("x % -y", r"x \bmod (- y)"),
        ("x % y % a", r"(x \bmod y) \bmod a"),
        ("x % y != 0", r"\taskspecone [x \not\equiv 0\,\,(\mathrm{mod}\,y)]"),
        ("(x % y) // a", r"\lfloor (x \bmod y) / a \rfloor"),
        ("x - y % a", r"x - (y \bmod a)"),
        ("x % y + a", r"(x \bmod y) + a"),
        ("x + y % a", r"x + (y \bmod a)"),
        ("-x * y % a", r"(- xy) \bmod a"),
        ("x**2 % a", r"x^2 \bmod a"),
        ("x % y == a % 2", r"\taskspecone [x \bmod y = a \bmod 2]"),
        ("x % y % a == 0", r"\taskspecone [(x \bmod y) \equiv 0\,\,(\mathrm{mod}\,a)]"),
        ("x + y + a - (a - y)", "x + y + a - (a - y)"),
    ],
)  # fmt: skip
def test_brackets_of_remainders(source: str, expected: str) -> None:
    assert written(source) == expected
