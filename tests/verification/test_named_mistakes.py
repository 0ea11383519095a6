"""Mistakes are named: those of sampled learners from their values, those of operators by the rules of the probes."""

from __future__ import annotations

from functools import cache

import pytest

from docs.tools.probes import scores
from taskspec import load
from tests.learn.exam.test_diagnoses import PROBES, TOLD, told
from tests.learn.exam.test_fingerprints import TASKS, explained, learned_q
from tests.shared.sparse import sparse

SAMPLED = (
    "right", "on policy", "ends ignored", "next episode", "limit is an end", "same state", "mean of actions", "least action",
    "all states", "action before", "reward discounted", "discounted twice", "another discount", "immediate reward",
    "rewards clipped", "signs of rewards", "reward negated",
)  # fmt: skip
"""Mistakes of `target`; others are those of the learners in `tests/verification/exam_study`."""
ALIKE = {"ends ignored": [["ends ignored", "reset at the end"]]}
"""Groups that these tasks cannot tell apart: each of them begins in one state."""
SLOW = ("least action", "action before", "reward discounted")
"""Mistakes whose learners need more steps until their values settle."""


@pytest.mark.parametrize("mistake", sparse(SAMPLED, 15))
def test_a_sampled_learner_is_named_by_its_values(mistake: str) -> None:
    steps = 60_000 if mistake in SLOW else 25_000
    tables = [(task, learned_q(task, mistake, seed, steps)) for task in TASKS for seed in range(11, 14)]
    assert explained(tables) in ([mistake], *ALIKE.get(mistake, ()))


GAMMAS = (0.9, 0.95, 0.99)
AT_RANDOM = ("stale action", "any action", "mean of the batch")
"""Operators that leave a policy no better than a random one."""
SELDOM = ("rewards squashed",)
"""Operators that have it at some discounts alone."""


@cache
def exact_scores(gamma: float) -> dict[str, dict[str, float]]:
    """Return the scores of each operator's greedy policy, by task."""
    found: dict[str, dict[str, float]] = {}
    for probe in PROBES:
        for name, score in scores(load(f"probes/{probe}"), gamma).items():
            found.setdefault(name, {})[probe] = score
    return found


@pytest.mark.parametrize("gamma", sparse(GAMMAS, 3))
def test_each_rule_is_told_for_its_own_mistakes_and_no_other(gamma: float) -> None:
    for name, by_task in exact_scores(gamma).items():
        expected = [TOLD[name]] if name in TOLD else []
        if name in AT_RANDOM:
            expected = ["at_random"]
        assert told(by_task) == expected or (name in SELDOM and not told(by_task)), name
