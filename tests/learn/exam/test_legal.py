"""Learners and yardsticks of an exam on tasks with legal actions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from taskspec import load
from taskspec.base.diagnostics import SpecError
from taskspec.exact.scores.returns import Results
from taskspec.language.task.legal import action_mask, choices, legal_at_random, restricted
from taskspec.learn.exam.case import Case, ExamTerms
from taskspec.learn.exam.fingerprints import fingerprint
from taskspec.learn.exam.trial import baselines
from taskspec.learn.experiments.tabular_learners import monte_carlo, q_learning
from taskspec.learn.observed_policies import observed_value

TASK = "textbook/Gambler?goal=10&start=5"


class Watching:
    """An environment that refuses illegal actions."""

    def __init__(self, env: Any) -> None:
        self.env = env
        self.mask = np.zeros(0)

    def reset(self, **options: Any) -> Any:
        seen, info = self.env.reset(**options)
        self.mask = info["action_mask"]
        return seen, info

    def step(self, action: int) -> Any:
        assert self.mask[action - 1] == 1
        *found, info = self.env.step(action)
        self.mask = info["action_mask"]
        return (*found, info)


@pytest.mark.parametrize("train", [q_learning, monte_carlo])
def test_references_take_legal_actions_alone(train: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    task = load(TASK)
    case = Case(task, (0,), ExamTerms(3000, ("reward",)))
    inside = Case.env
    monkeypatch.setattr(Case, "env", lambda self: Watching(inside(self)))
    learned = train(case)
    results = Results(task)
    found = observed_value(results, learned, 0).deterministic.value
    assert results.worst is not None and results.optimal is not None
    assert results.worst.value - 1e-9 <= found <= results.optimal.value + 1e-9


def test_baselines_are_of_legal_actions() -> None:
    """A fixed stake is taken where it is legal, and a random legal one elsewhere."""
    task = load(TASK)
    found = baselines(task, 100, "")
    random = found["random"]
    assert 0 < random < found["optimal"] == pytest.approx(0.4)
    assert len(found["constants"]) == 5
    one, *_, five = found["constants"]
    # Timid play of 1 in a fair way to ruin: (r^5 - 1) / (r^10 - 1) with r = q / p = 3 / 2.
    assert random + one * (found["expert"] - random) == pytest.approx((1.5**5 - 1) / (1.5**10 - 1))
    assert random + five * (found["expert"] - random) == pytest.approx(0.4)


def test_random_actions_are_uniform_over_the_legal_ones() -> None:
    task = load(TASK)
    states = {"s": np.repeat(np.arange(1, 10), 4000)}
    words = np.random.default_rng(0).integers(0, 2**32, len(states["s"]), dtype=np.uint32)
    stakes = legal_at_random(task, states, words)["stake"]
    for s in range(1, 10):
        legal = min(s, 10 - s)
        counts = np.bincount(stakes[states["s"] == s], minlength=6)[1:]
        assert counts[legal:].sum() == 0
        assert counts[:legal] == pytest.approx(np.full(legal, 4000 / legal), rel=0.2)
    over = {"s": np.array([0, 10])}
    assert not action_mask(task, over).any() and choices(task, over).all()


def test_probabilities_are_restricted() -> None:
    legal = np.array([[True, True, False], [False, True, True]])
    found = restricted(np.array([[0.25, 0.25, 0.5], [1.0, 0.0, 0.0]]), legal)
    assert found.tolist() == [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]


def test_built_in_learners_take_legal_actions_alone() -> None:
    jax = pytest.importorskip("jax")
    pytest.importorskip("optax")
    from taskspec.learn.learners.deep.world import World

    task = load(TASK)
    world = World.of(task, absorb=False)
    walk = world.begin(jax.random.key(0), 64)
    _, steps = world.rollout(walk, lambda seen, noise: world.head.uniform(noise), jax.random.key(1), 50)
    capital = np.asarray(steps.seen).argmax(axis=-1)
    stakes = np.asarray(steps.action)[..., 0] + 1
    assert (stakes <= np.minimum(capital, 10 - capital)).all()
    assert len(np.unique(stakes)) == 5


def test_what_knows_no_legal_actions_says_so() -> None:
    with pytest.raises(SpecError, match=r"E712.*illegal"):
        fingerprint(load(TASK), q=np.zeros((11, 5)))
