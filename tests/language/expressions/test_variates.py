"""A base variate is one entry: a new one runs alike on all backends, has bounds, and enters exact rewards by its mean."""

import math
from collections.abc import Iterator
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import taskspec
from taskspec.exact import extract
from taskspec.language import draws
from taskspec.language.expressions.dists import DISTS, Argument, Dist
from taskspec.language.expressions.types import REAL, Kind
from taskspec.language.expressions.variates import VARIATES
from taskspec.language.expressions.variates.entry import Enumeration, Variate, each, power, product, rows
from taskspec.language.task.task import Task
from taskspec.programs.backend_table import BACKENDS
from tests.shared.conformance import Agreement
from tests.shared.sections import build_text

LOGISTIC = Variate(
    name="logistic", kind=Kind.REAL, bounds=lambda draw, args: (-23, 23), cut=True, mean=lambda b, draw: b.scalar(0.0),
    many=lambda x, draw, args, words: x.exponentials(words) - x.exponentials(~words),
    kernel=lambda k, draw, words: [f"f64(exponential32({w}) - exponential32(~{w}))" for w in words],
)  # fmt: skip
"""The logarithm of odds, of one word."""


def minima(draw: Any, args: Any, numbers: Any) -> Any:
    """The smaller of two indices below n."""
    found = []
    for counts in each(args[0], draw.type.size):
        k = np.arange(int(counts.max()))[:, None]
        found.append(numbers.ratio(np.where(k < counts, 2 * (counts - k) - 1, 0), counts * counts))
    return product(draw, found, np.int64)


MINIMUM = Variate(
    name="minimum", kind=Kind.INT, bounds=lambda draw, args: (0, args[0].high - 1),
    words=lambda draw: 2 * draw.type.size,
    many=lambda x, draw, args, words: x.xp.minimum(
        x.indices(words[0::2], rows(x, draw, args[0])), x.indices(words[1::2], rows(x, draw, args[0]))
    ),
    kernel=lambda k, draw, words: [
        f"min(i32(index({v}, {n})), i32(index({w}, {n})))"
        for v, w, n in zip(words[0::2], words[1::2], k.argument(draw), strict=True)
    ],
    outcomes=Enumeration(lambda draw, bounds: power(bounds(draw.args[0])[1], draw.type.size), minima, weighted=False),
)  # fmt: skip
WRITTEN = {
    "Logistic": Dist(
        "Logistic", (), lambda b, given, shape: b.draw("logistic", (), REAL), "Odds.", r"\operatorname{Logistic}",
        shaped=False, samples=({},),
    ),
    "Smaller": Dist(
        "Smaller", (Argument("n", low=1),),
        lambda b, given, shape: b.draw("minimum", (b.within(given["n"], 1, 9),), given["n"].type),
        "The smaller of two.", r"\operatorname{Min}({n})", shaped=False, samples=({"n": 3},),
    ),
}  # fmt: skip
SPEC = """
state:
  k: {type: int, low: 0, high: 5}
action:
  a: {type: int, low: 0, high: 1}
horizon: 6
initial: {k: Smaller(4)}
dynamics: {k': "min(Smaller(k + 1) + a, 5)"}
reward: k + 2 * Logistic() + 3
"""


@pytest.fixture
def task() -> Iterator[Task]:
    with patch.dict(VARIATES, logistic=LOGISTIC, minimum=MINIMUM), patch.dict(DISTS, WRITTEN):
        yield build_text(SPEC)


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_a_new_entry_runs_alike_on_all_backends(task: Task, backend: Any) -> None:
    if BACKENDS[backend].needs is not None:
        pytest.importorskip(BACKENDS[backend].needs)
    Agreement(task, backend, 5, "SameStep").run(30)


def test_its_values_are_those_of_its_formula(task: Task) -> None:
    env = taskspec.make(task)
    env.reset(seed=3)
    (logit,) = [d for d in task.process.step_draws if d.base == "logistic"]
    place = task.step_words.first[logit.site]
    for step in range(6):
        before = env.state["k"]
        reward = env.step(0)[1]
        word = draws.words(3, draws.STEP, step, task.step_words.count)[place]
        p = (word + 0.5) / 2**32
        assert reward == pytest.approx(before + 2 * math.log(p / (1 - p)) + 3, abs=1e-4)


def test_exact_analysis_goes_through_its_outcomes_and_takes_its_mean(task: Task) -> None:
    model = extract(task)
    assert model.steps[0].R[0] == pytest.approx(3)
    going = model.steps[0].P.toarray()[2]  # k = 2, a = 0: the smaller of two of 0, 1, 2
    assert going[:3] == pytest.approx([5 / 9, 3 / 9, 1 / 9])
