"""Distributions as they are written: what their arguments are if they are left out, and how likely each count is."""

import numpy as np
import pytest
from scipy import stats

import taskspec
from taskspec.exact import extract
from taskspec.language.expressions.dists import DISTS
from taskspec.language.task.task import Task
from tests.shared.sections import build_text

DEFAULTS = {
    ("Normal()", "Normal(0, 1)"), ("Normal(mean=3)", "Normal(3, 1)"), ("Normal(std=2)", "Normal(0, 2)"),
    ("Exponential()", "Exponential(1)"), ("Gamma(2)", "Gamma(2, 1)"),
}  # fmt: skip


def drawing(drawn: str, kind: str) -> Task:
    text = f"""
state: {{x: {{type: {kind}}}}}
action: {{a: {{type: bool}}}}
horizon: 1
initial: {{x: "{drawn}"}}
dynamics: {{x': x}}
reward: x
"""
    return build_text(text)


@pytest.mark.parametrize(("short", "long"), sorted(DEFAULTS))
def test_arguments_that_are_left_out(short: str, long: str) -> None:
    first = taskspec.make(drawing(short, "real"))
    second = taskspec.make(drawing(long, "real"))
    values = set()
    for seed in range(20):
        value = first.reset(seed=seed)[0].item()
        assert value == second.reset(seed=seed)[0].item()
        values.add(value)
    assert len(values) == 20


def test_every_argument_that_may_be_left_out_is_tried() -> None:
    tried = "".join(short for short, _ in DEFAULTS)
    for dist in DISTS.values():
        has_defaults = any(argument.default is not None for argument in dist.arguments)
        assert has_defaults == (f"{dist.name}(" in tried)


def binomial(n: int, p: float) -> list[float]:
    return list(stats.binom.pmf(range(n + 1), n, p))


def poisson(rate: float, most: int) -> list[float]:
    """Of counts up to `most`, which stands for all from there on."""
    return [*stats.poisson.pmf(range(most), rate), stats.poisson.sf(most - 1, rate)]


@pytest.mark.parametrize(
    ("drawn", "expected"),
    [
        ("Binomial(4, 1/3)", binomial(4, 1 / 3)), ("Binomial(5, 0.25)", binomial(5, 1 / 4)),
        ("Binomial(1, 2/7)", binomial(1, 2 / 7)), ("min(Poisson(2), 3)", poisson(2, 3)),
        ("min(Poisson(1/2), 1)", poisson(0.5, 1)),
        ("min(Geometric(1/4), 3)", [0, 1 / 4, 3 / 16, 9 / 16]),
    ],
)  # fmt: skip
def test_how_likely_each_count_is(drawn: str, expected: list[float]) -> None:
    model = extract(drawing(f"min({drawn}, 9)", "int, low: 0, high: 9"))
    assert model is not None
    chances = np.zeros(10)
    for i, p in enumerate(model.start):
        chances[int(model.state(i)["x"])] = p
    assert chances[: len(expected)] == pytest.approx(expected) and chances.sum() == pytest.approx(1)
