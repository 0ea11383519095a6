"""Rows of a decision table that end early: a mapping there is read as rows, and must not be meant as a draw."""

import pytest

from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text

TWO = """
parameters: {p: {type: real, default: 0.25, low: 0, high: 1}}
state:
  s: {type: choice, values: [low, high]}
  n: {type: int, low: 0, high: 1}
  lit: {type: bool}
action: {a: {type: choice, values: [keep, reset]}}
horizon: 2
initial: {s: low, n: 0, lit: false}
dynamics:
  s': {by: [a, s], rows: {keep: s, reset: LABELS}}
  n': {by: [a, n], rows: {keep: n, reset: INTS}}
  lit': {by: [a, s, n], rows: {keep: lit, reset: TRUTHS}}
reward: {by: [a, s], rows: {keep: 0, reset: PAID}}
"""
CLEAR = {"LABELS": "{low: high, high: low}", "INTS": "{0: 1, 1: 1}", "TRUTHS": "true", "PAID": "{low: 1, high: 0}"}


def spec(**cells: str) -> str:
    text = TWO
    for name, cell in (CLEAR | cells).items():
        text = text.replace(name, cell)
    return text


@pytest.mark.parametrize(
    ("place", "cell", "draw", "rows"),
    [
        ("LABELS", "{low: 1/4, high: 3/4}", "{else: {low: 1/4, high: 3/4}}", "{low: 1/4, else: 3/4}"),
        ("LABELS", "{low: 1, high: 0}", "{else: {low: 1, high: 0}}", "{low: 1, else: 0}"),
        ("LABELS", "{low: p, high: 1 - p}", "{else: {low: p, high: 1 - p}}", "{low: p, else: 1 - p}"),
        ("INTS", "{0: 1, 1: 0}", "{else: {0: 1, 1: 0}}", "{0: 1, else: 0}"),
        ("INTS", "{0: 0.5, 1: 0.5}", "{else: {0: 0.5, 1: 0.5}}", "{0: 0.5, else: 0.5}"),
        ("TRUTHS", "{true: 1/4, false: 3/4}", "{else: {else: {true: 1/4, false: 3/4}}}", "{true: 1/4, else: 3/4}"),
        ("PAID", "{0: 1/2, 1: 1/2}", "{else: {0: 1/2, 1: 1/2}}", "{0: 1/2, else: 1/2}"),
    ],
)
def test_a_draw_or_rows(place: str, cell: str, draw: str, rows: str) -> None:
    (found,) = refusal(build_text, spec(**{place: cell})).diagnostics
    assert found.code == "E319"
    assert found.hint == f"the draw is written `reset: {draw}`, the rows `reset: {rows}`"
    build_text(spec(**{place: draw}))


@pytest.mark.parametrize(
    ("place", "cell"),
    [
        ("PAID", "{low: 0.25, high: 0.75}"),  # a label is no reward
        ("LABELS", "{low: 1, high: 1}"),
        ("INTS", "{0: 1, else: 0}"),
        ("TRUTHS", "{low: {0: true, 1: false}, high: false}"),
    ],
)
def test_rows_that_can_be_nothing_else(place: str, cell: str) -> None:
    build_text(spec(**{place: cell}))
