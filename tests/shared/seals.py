"""Environments of the package seals, and comparisons of samples by chi-square tests."""

import warnings
from collections import Counter
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy import stats

pytest.importorskip("seals")

ALPHA = 1e-5
State = dict[str, Any]


def original(name: str, **options: Any) -> Any:
    """The registered environment with its time limit; some warn of their own float64 bounds."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*precision lowered by casting")
        return gym.make(f"seals/{name}-v0", disable_env_checker=True, **options)


def put(env: Any, state: State) -> Any:
    """Start an episode of ours in the given state."""
    return env.reset(options={"state": state})[0]


def homogeneous(first: Any, second: Any) -> bool:
    """Whether two samples of hashable outcomes may come from one distribution."""
    one = Counter(first)
    two = Counter(second)
    table = [(one[outcome], two[outcome]) for outcome in one | two]
    return len(table) == 1 or bool(stats.chi2_contingency(table).pvalue > ALPHA)


def fits(sample: Any, probabilities: Any) -> bool:
    """Whether a sample of indices may come from the distribution."""
    p = np.asarray(probabilities, dtype=np.float64)
    counts = np.bincount(sample, minlength=len(p))
    if counts[p == 0].any():  # what has probability 0 never happens
        return False
    counts = counts[p > 0]
    p = p[p > 0]
    return len(p) == 1 or bool(stats.chisquare(counts, p / p.sum() * len(sample)).pvalue > ALPHA)
