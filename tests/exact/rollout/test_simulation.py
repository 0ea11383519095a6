"""Returns of policies beside the means of episodes."""

from pathlib import Path

import numpy as np
import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.exact import extract
from taskspec.exact.model.points import Cost
from taskspec.exact.rollout.rollout import _affordable, at_random, simulate
from taskspec.exact.scores.returns import Results
from taskspec.language import draws as variates
from taskspec.language.registry import load
from tests.shared.sections import build_text
from tests.shared.solved import random_return
from tests.shared.specs import spec_file
from tests.shared.tasks import model_of, shipped, spec

ROOT = Path(__file__).parents[3]

EVERY = [
    ("risky_path", None), ("early_term", "EarlyTermPos"), ("early_term", "EarlyTermNeg"), ("branching", None),
    ("init_shift", "InitShiftExpert"), ("init_shift", "InitShiftLearner"), ("noisy_obs", None), ("sort", None),
    ("proc_goal", None), ("proc_goal", "seals"), ("sort", "seals"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "variant"), EVERY)
def test_random_returns_by_simulation(name: str, variant: str | None) -> None:
    task = shipped(name, variant)
    returns = simulate(task, at_random(task), episodes=4000, seed=7)
    error = returns.std(ddof=1) / np.sqrt(len(returns))
    assert abs(returns.mean() - random_return(model_of(task))) <= 5 * error + 1e-9


@pytest.mark.parametrize(("name", "variant"), EVERY)
def test_experts_by_simulation(name: str, variant: str | None) -> None:
    from taskspec.exact.rollout.rollout import by_expert

    task = shipped(name, variant)
    results = Results(task)
    assert results.expert is not None
    returns = simulate(task, by_expert(task), episodes=2000, seed=3)
    error = returns.std(ddof=1) / np.sqrt(len(returns))
    assert abs(returns.mean() - results.expert.value) <= 5 * error + 1e-9


@pytest.mark.parametrize("name", ["umbrella", "frozen_lake", "queue", "contextual_bandit", "random_transition", "taxi"])
def test_other_specs_by_simulation(name: str) -> None:
    task = shipped(name, suite="seals") if name == "random_transition" else spec(name)
    returns = simulate(task, at_random(task), episodes=3000, seed=1)
    error = returns.std(ddof=1) / np.sqrt(len(returns))
    assert abs(returns.mean() - random_return(extract(task))) <= 5 * error + 1e-9


def test_episodes_that_seldom_end_are_given_up_early() -> None:
    """A few of many end within 2,000 steps, so that some would still be running after 20,000."""
    task = build_text(
        "state: {s: {type: real}}\naction: {a: {type: bool}}\nhorizon: none\n"
        "initial: {s: 0}\ndynamics: {s': s}\nreward: 1\nterminal: Bernoulli(1/10000)\n"
    )
    with pytest.raises(SpecError, match="after 2,000 steps"):
        simulate(task, at_random(task), 50)


def test_a_poisson_draw_is_charged_for_every_count_that_is_searched() -> None:
    """Its rate is known only at run time, so that each of its words is compared with a sum for each count."""
    path = spec_file("epidemic")
    found = [Cost(load(path, N=n).process.next, simulated=True).seconds(64, 1) for n in (10, 1000)]
    assert found[1] > 5 * found[0]
    assert 5 * _affordable(load(path)) < _affordable(spec("queue"))


def test_rows_of_a_table_of_probabilities_become_words_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In fractions that takes a millisecond a row, and episodes look rows up in thousands of steps."""
    rows = "{s': 'Categorical(P[s])'}"
    task = build_text(
        "constants: {P: '[[1/3, 1/3, 1/3], [1/2, 1/4, 1/4], [1/7, 2/7, 4/7]]'}\nhorizon: 50\n"
        "state: {s: {type: int, low: 0, high: 2}}\naction: {a: {type: bool}}\n"
        f"initial: {{s: 0}}\ndynamics: {rows}\nreward: s\n"
    )
    found = []
    made = variates.thresholds
    monkeypatch.setattr(variates, "thresholds", lambda row: found.append(row) or made(row))
    simulate(task, at_random(task), episodes=500, seed=1)
    assert 1 <= len(found) <= 3
