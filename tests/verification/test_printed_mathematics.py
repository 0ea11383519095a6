"""What is printed says what the expression says.

Random trees are printed, read back by readers of the tests' own, and compared with what they mean.
"""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskspec.language.expressions import syntax as s
from taskspec.show.printers import latex, mathematics, mathml, plain, text
from tests.verification.printed import latex as tex
from tests.verification.printed import mathml as xml
from tests.verification.printed import python, reading, trees, unicode
from tests.verification.printed.marks import Line
from tests.verification.printed.meaning import Meaning

FORMS: dict[str, Callable[[s.Expr], tuple[str, Line]]] = {
    "latex": lambda expr: _read(latex(mathematics(expr, trees.NOTATION)), tex.read),
    "mathml": lambda expr: _read(mathml(mathematics(expr, trees.NOTATION)), xml.read),
    "plain": lambda expr: _read(plain(mathematics(expr, trees.NOTATION)), unicode.read),
}
TREES = st.one_of(trees.numbers(), trees.conditions())
POINTS = st.integers(0, 30)  # keys of tables take all their values


def _read(source: str, reader: Callable[[str], Line]) -> tuple[str, Line]:
    return source, reader(source)


def meant(expr: s.Expr, point: int) -> int:
    return Meaning(trees.names(point), trees.LENGTHS).of(expr)


@pytest.mark.parametrize("form", FORMS)
@given(TREES, POINTS)
def test_mathematics_says_what_the_expression_says(form: str, expr: s.Expr, point: int) -> None:
    source, line = FORMS[form](expr)
    assert reading.value(line, trees.printed(trees.names(point))) == meant(expr, point), source


@given(TREES, POINTS)
def test_text_says_what_the_expression_says(expr: s.Expr, point: int) -> None:
    """Tables and lists of cases, which text writes as conditionals, included."""
    assert meant(python.read(text(expr)), point) == meant(expr, point), text(expr)
