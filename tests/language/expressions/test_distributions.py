"""Distributions as they are written: what their arguments are if they are left out, and how likely each count is."""

import math
from fractions import Fraction

import numpy as np
import pytest

import taskspec
from taskspec.exact import extract
from taskspec.language.expressions.dists import DISTS
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task

DEFAULTS = {
    ("Normal()", "Normal(0, 1)"), ("Normal(mean=3)", "Normal(3, 1)"), ("Normal(std=2)", "Normal(0, 2)"),
    ("Exponential()", "Exponential(1)"), ("Gamma(2)", "Gamma(2, 1)"),
}  # fmt: skip


def drawing(drawn: str, kind: str) -> Task:
    text = f"""
taskspec: 1
name: Drawing
state: {{x: {{type: {kind}}}}}
action: {{a: {{type: bool}}}}
horizon: 1
initial: {{x: "{drawn}"}}
dynamics: {{x': x}}
reward: x
"""
    return build(read_text(text, "drawing.yaml"))


@pytest.mark.parametrize(("short", "long"), sorted(DEFAULTS))
def test_arguments_that_are_left_out(short: str, long: str) -> None:
    first, second = (taskspec.make(drawing(drawn, "real")) for drawn in (short, long))
    values = [(first.reset(seed=seed)[0], second.reset(seed=seed)[0]) for seed in range(20)]
    assert all(np.array_equal(a, b) for a, b in values)
    assert len({float(np.ravel(a)[0]) for a, _ in values}) == 20


def test_every_argument_that_may_be_left_out_is_tried() -> None:
    may = {dist.name for dist in DISTS.values() if any(a.default is not None for a in dist.arguments)}
    assert may == {short.partition("(")[0] for short, _ in DEFAULTS}


def binomial(n: int, p: Fraction) -> list[Fraction]:
    return [math.comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(n + 1)]


def poisson(rate: float, most: int) -> list[float]:
    """Of counts up to `most`, which stands for all from there on."""
    below = [math.exp(-rate) * rate**k / math.factorial(k) for k in range(most)]
    return [*below, 1 - sum(below)]


@pytest.mark.parametrize(
    ("drawn", "expected"),
    [
        ("Binomial(4, 1/3)", binomial(4, Fraction(1, 3))), ("Binomial(5, 0.25)", binomial(5, Fraction(1, 4))),
        ("Binomial(1, 2/7)", binomial(1, Fraction(2, 7))), ("min(Poisson(2), 3)", poisson(2, 3)),
        ("min(Poisson(1/2), 1)", poisson(0.5, 1)),
        ("min(Geometric(1/4), 3)", [0, Fraction(1, 4), Fraction(3, 16), Fraction(9, 16)]),
    ],
)  # fmt: skip
def test_how_likely_each_count_is(drawn: str, expected: list[float]) -> None:
    model = extract(drawing(f"min({drawn}, 9)", "int, low: 0, high: 9"))
    assert model is not None
    found = {int(model.state(i)["x"]): float(p) for i, p in enumerate(model.start) if p > 0}
    assert found == pytest.approx({k: float(p) for k, p in enumerate(expected) if p})
