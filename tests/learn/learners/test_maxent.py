"""Maximum-entropy learners beside closed forms, sums over paths written out, and numerical gradients."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.data import Tabular, demonstrations, tabular
from taskspec.exact import score
from taskspec.learn.learners import learner
from taskspec.learn.learners.maxent import expected_visits, soft_policy, visits
from taskspec.learn.learners.paper_settings import Matching
from tests.shared.cases import Granted

BANDIT = """
taskspec: 1
name: Bandit
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: int, low: 1, high: 3}}
horizon: 1
initial: {s: 0}
dynamics: {"s'": a}
reward: {by: ["s'"], rows: {1: 0, 2: 1, 3: 1.5, else: 0}}
"""


def learned(name: str, task: str, seeds: int = 2, **settings: float) -> np.ndarray:
    """Policies (K, T, S, A) of tasks whose states are seen as they are."""
    asked = learner(name)
    asked = replace(asked, settings=replace(asked.settings, **settings))
    return np.array([np.asarray(p) for p in asked(Granted(task, seeds=seeds))])


def test_on_a_bandit_actions_are_as_frequent_as_they_were_shown(tmp_path: Path) -> None:
    (tmp_path / "bandit.yaml").write_text(BANDIT, encoding="utf-8")
    task = taskspec.load(tmp_path / "bandit.yaml")
    shown = demonstrations(task, "soft(1)", episodes=400, seed=5)
    counts = np.bincount(shown.acts, minlength=4)[1:] / 400
    for name in ("mce", "maxent"):
        (policy,) = learner(name)(Granted(task, seeds=1, demonstrations=shown))
        assert np.allclose(np.asarray(policy)[0, 0], counts, atol=1e-4)
        ways = np.arange(1, 4)
        gains = policy.reward(np.zeros(3, int), ways, ways) - policy.reward.values[1]
        assert np.allclose(gains, np.log(counts / counts[0]), atol=1e-3)


def test_causal_learners_take_the_safe_path_and_the_others_cannot() -> None:
    safe = learned("mce", "RiskyPath")
    risky = learned("maxent", "RiskyPath", iterations=3000)
    for table in safe:
        assert score("RiskyPath", table).normalised > 0.999
    for table in risky:
        assert score("RiskyPath", table).normalised < 0.2


def test_ends_that_absorb_are_matched() -> None:
    for table in learned("mce", "EarlyTermNeg"):
        assert score("EarlyTermNeg", table).normalised > 0.999
    found = tabular("EarlyTermNeg")
    shown = demonstrations("EarlyTermNeg", episodes=4)
    assert visits(found, shown, True).sum() == 11 and visits(found, shown, False).sum() < 11


@pytest.mark.parametrize("causal", [True, False])
def test_soft_policies_are_those_of_all_paths_written_out(causal: bool) -> None:
    """Where chance plays no part, both are the distribution in which a path is as likely as e to its worth."""
    found = tabular("EarlyTermNeg")
    rng = np.random.default_rng(0)
    worth = rng.standard_normal((1, found.n_states))
    short = replace(found, horizon=3)
    weights: dict[int, float] = dict.fromkeys(range(found.n_actions), 0.0)
    (start,) = np.flatnonzero(found.p0)
    for actions in itertools.product(range(found.n_actions), repeat=3):
        s = start
        total = 0.0
        for a in actions:
            s = int(found.P[s, a].argmax())
            total += worth[0, s]
        weights[actions[0]] += np.exp(total)
    wanted = np.array(list(weights.values())) / sum(weights.values())
    tables = soft_policy(short, worth, Matching(causal=causal, floor=0.0))
    assert np.allclose(tables[0, 0, :, start], wanted)


def test_the_slope_is_that_of_the_likelihood() -> None:
    """Of the value at the start, whose slope the visits are, by differences."""
    found = tabular("RiskyPath")
    rng = np.random.default_rng(1)
    worth = rng.standard_normal(found.n_states)
    slope = [(start_value(found, worth + h) - start_value(found, worth - h)) / 2e-5 for h in 1e-5 * np.eye(len(worth))]
    tables = soft_policy(found, worth[None], Matching(causal=True))
    assert np.allclose(expected_visits(found, tables)[0], slope, atol=1e-6)


def start_value(found: Tabular, worth: np.ndarray) -> float:
    value = worth
    for _ in range(found.horizon or 0):
        value = worth + np.log(np.exp(found.P @ value).sum(axis=1))
    return float(found.p0 @ value)


@pytest.mark.parametrize("task", ["NoisyObs", "Parabola", "LargestSum"])
def test_tasks_that_cannot_be_matched_are_refused(task: str) -> None:
    with pytest.raises(SpecError) as raised:
        learner("mce")(Granted(task))
    assert raised.value.diagnostics[0].code == "E724"


@pytest.mark.slow
def test_imitation_finds_the_same_policy() -> None:
    mce = pytest.importorskip("imitation.algorithms.mce_irl")
    found = tabular("RiskyPath")
    worth = np.random.default_rng(2).standard_normal(4)
    _, _, policy = mce.mce_partition_fh(found.imitation(), reward=worth)
    ours = soft_policy(replace(found, horizon=(found.horizon or 0) - 1), worth[None], Matching(causal=True))
    assert np.allclose(policy[: len(ours)], np.moveaxis(ours[:, 0], -1, -2))
