"""The table of functions: every sample of every function is accepted, and has the type that its value has."""

from fractions import Fraction
from typing import Any

import pytest

from taskspec.base.diagnostics import Collector, Origin, Span
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.ir import Const
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.parse import parse
from taskspec.language.expressions.scope import Scope
from taskspec.language.expressions.syntax import SourceText
from tests.shared.for_each import for_each

SAMPLES = [(f.name, sample) for f in FUNCTIONS.values() for sample in f.samples]


def constant(expression: str) -> Const:
    origin = Origin("<test>", expression)
    text = SourceText(expression, lambda start, end: Span(origin, 1, start + 1, 1, end + 1))
    collector = Collector()
    value = Checker(Builder(), collector).check(parse(text), Scope({}))
    collector.raise_if_errors()
    assert value is not None and isinstance(value.node, Const)
    return value.node


@for_each(("name", "sample"), SAMPLES)
def test_every_sample_can_be_written_and_folds_to_a_constant(name: str, sample: tuple[Any, ...]) -> None:
    node = constant(f"{name}({', '.join(map(repr, sample))})")
    assert len(node.flat) == node.type.size


def test_a_function_of_several_takes_one_vector_too() -> None:
    assert constant("max((3, 1, 2))").value == 3
    assert constant("min((3, 1, 2))").value == 1
    assert constant("concat((3, 1))").flat == (3, 1)


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1/3", Fraction(1, 3)),
        ("1 - 1/3 - 1/6", Fraction(1, 2)),
        ("-(1/3) * 2", Fraction(-2, 3)),
        ("1/3 + 0.5", 1 / 3 + 0.5),
        ("1/0", float("inf")),
    ],
)
def test_fractions_stay_exact_until_they_meet_a_float(expression: str, value: Fraction | float) -> None:
    found = constant(expression).value
    assert type(found) is type(value)
    assert found == value
