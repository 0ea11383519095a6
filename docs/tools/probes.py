"""The page of the probes: what each of them exposes, computed from the fixed points of wrong Bellman operators."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from docs.tools.markdown import filled, table
from taskspec.exact.policies.policy import greedy
from taskspec.exact.scores.difficulty import difficulty
from taskspec.exact.scores.returns import Results
from taskspec.language.task.task import Task
from taskspec.learn.exam.asked_tasks import tasks_of
from taskspec.learn.exam.dynamics import dynamics_of
from taskspec.learn.exam.learned_values import is_read
from taskspec.learn.exam.operators import GOOD, OPERATORS
from taskspec.learn.exam.ways import greedy_ways

PAGE = Path(__file__).parents[1] / "explain" / "probes.md"
GAMMAS = (0.9, 0.99)
"""Discounts of learners."""
PASSES = 0.9
"""The score from which a policy passes."""


def probes() -> str:
    """Return the page of the probes."""
    exposures = {task: exposed(task) for task in tasks_of(("probes",), None)}
    finite = [found for found in exposures.values() if found]
    seen = Counter(name for found in finite for name in found)
    common = [name for name in OPERATORS if seen[name] == len(finite)]
    usual = [name for name in OPERATORS if len(finite) / 2 <= seen[name] < len(finite)]
    rows = []
    missed = {name for name, operator in OPERATORS.items() if operator.of != "values" and operator.recognise is None}
    missed -= set(GOOD)
    for task, found in exposures.items():
        own = {name: gamma for name, gamma in found.items() if name not in (*common, *usual)}
        rows.append((task.name, task.capability or "", *_difficulty(task), _listed(own)))
        missed -= set(found)
    parts = {
        "probes": table(("probe", "capability", "lookahead", "value norm", "further mistakes that fail"), rows),
        "common": ", ".join(common),
        "usual": ", ".join(usual),
        "missed": ", ".join(name for name in OPERATORS if name in missed),
    }
    return filled(PAGE, parts)


def _difficulty(task: Task) -> Iterator[str]:
    """Yield how far one has to look ahead, and how much chance matters; nothing where that is not known."""
    for value in difficulty(task, ["lookahead", "value_norm"]).values():
        yield "" if value is None else f"{value:.3g}"


def exposed(task: Task) -> dict[str, float]:
    """Return the operators whose greedy policy fails a task, each with the largest discount at which it does."""
    found: dict[str, float] = {}
    for gamma in GAMMAS:
        for name, value in scores(task, gamma).items():
            if value < PASSES and (name == "on policy" or name not in GOOD):
                found[name] = gamma
    return found


@cache
def scores(task: Task, gamma: float) -> dict[str, float]:
    """Return the score of the greedy policy of each operator's fixed point; nothing where observations hide the state."""
    if not is_read(task):
        return {}
    dynamics = dynamics_of(task, gamma)
    results = Results(task, 1)
    assert results.random is not None
    assert results.expert is not None
    found = {}
    for name, ways in greedy_ways(task, gamma).items():
        if not ways[-1].settles:
            continue
        pi = greedy(ways[-1].fixed_point.T).T
        V = np.zeros(dynamics.model.n_states)
        for _ in range(task.horizon or 0):
            V = (pi * (dynamics.R + dynamics.following(V))).sum(axis=0)
        value = float(dynamics.model.start @ V)
        found[name] = (value - results.random.value) / (results.expert.value - results.random.value)
    return found


def _listed(found: dict[str, float]) -> str:
    words = []
    for name, gamma in found.items():
        words.append(name if gamma == GAMMAS[-1] else f"{name} (discount {gamma:g})")
    return ", ".join(words)
