"""Laws of learning: what each keeps, on exact models; which learners obey them, and what an exam says of those that do not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exact import Results
from taskspec.exam import Case, examine, learns_from, obeys
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.learn.exam.laws import LAWS
from tests.shared.commands import Done

pytestmark = pytest.mark.usefixtures("warm")

Array = np.ndarray[Any, Any]

BANDIT = """
taskspec: 1
name: Bandit
state: {s: {type: int, low: 0, high: 1}}
action: {a: {type: choice, values: [low, high]}}
horizon: 2
initial: {s: 0}
dynamics: {s': 1 - s}
reward: "0.6 if a == high else 0.2"
expert: high
symmetries: {swapped: {observation: {s: 1 - s}}}
"""
MINE = """
import numpy as np
from taskspec.exam import learns_from


@learns_from("reward")
def train(case):
    env, rng = case.env(), np.random.default_rng(case.seed)
    best = np.zeros((case.observation_space.n, case.action_space.n))
    obs, _ = env.reset()
    for _ in range(case.steps):
        action = rng.integers(case.action_space.n)
        after, reward, terminated, truncated, _ = env.step(action)
        best[obs, action] = max(best[obs, action], min(reward, 1))
        obs = env.reset()[0] if terminated or truncated else after
    return best
"""
TASKS = (
    "RiskyPath",
    "EarlyTermNeg",
    "EarlyTermPos",
    "Branching?L=3",
    "probes/EndInPlace",
    "probes/Slip",
    "probes/Hazard",
)


def returns(task: Task) -> Array:
    """The optimal, the random and the worst return."""
    known = Results(task)
    return np.array([getattr(known, name).value for name in ("optimal", "random", "worst")])


@pytest.mark.parametrize("law", LAWS)
def test_what_a_law_keeps_is_kept_on_exact_models(law: str) -> None:
    """Returns are the same or an affine function of those before, so that scores are the same."""
    tried = 0
    for task in (*map(taskspec.load, TASKS), build(read_text(BANDIT))):
        changed = LAWS[law].changed(task)
        if changed is None or Results(changed).model is None:
            continue
        tried += 1
        best, random, worst = before = returns(task)
        after = returns(changed)
        if LAWS[law].keeps != "best policies":
            assert after == pytest.approx(before, abs=1e-9)
        share = (worst - random) / (best - random)
        assert (after[2] - after[1]) / (after[0] - after[1]) == pytest.approx(share, abs=1e-9)
    assert tried >= (1 if law in ("distractors", "symmetry") else 3)


def averages(case: Case, clip: float) -> Array:
    """The mean reward of each action, in each state."""
    env = case.env()
    rng = np.random.default_rng(case.seed)
    sums = np.zeros((case.observation_space.n, case.action_space.n))
    visits = np.zeros_like(sums)
    obs, _ = env.reset()
    for _ in range(case.steps):
        action = rng.integers(case.action_space.n)
        after, reward, terminated, truncated, _ = env.step(action)
        sums[obs, action] += np.clip(reward, -clip, clip)
        visits[obs, action] += 1
        obs = env.reset()[0] if terminated or truncated else after
    return sums / np.maximum(visits, 1)


@obeys("scale", "relabelled")
@learns_from("reward")
def right(case: Case) -> Array:
    return averages(case, np.inf)


@obeys("scale")
@learns_from("reward")
def clipping(case: Case) -> Array:
    return averages(case, 1.0)


def test_a_law_that_a_learner_declares_is_judged_and_others_are_reported() -> None:
    task = build(read_text(BANDIT))
    terms: dict[str, Any] = {"tasks": [task], "seeds": 5, "steps": 50, "twins": 0}
    found = examine(right, **terms)
    assert found["flags"] == [] and {score["law"] for score in found["laws"]} == {"scale", "relabelled"}
    (flag,) = examine(clipping, **terms)["flags"]
    assert flag["kind"] == "law" and "the score is 0.00 instead of 1.00 (p = 0.0079)" in flag["message"]
    assert "laws" not in examine(clipping, **terms, laws=False)
    undeclared = examine(learns_from("reward")(lambda case: averages(case, 1.0)), **terms, laws=True)
    assert undeclared["flags"] == []
    by_law = {score["law"]: score for score in undeclared["laws"]}
    broken = {law for law, score in by_law.items() if score.get("broken")}
    assert broken == {"delay", "reward_at_end", "potential", "scale", "shift"}  # it sees the next reward alone, clipped
    assert by_law["distractors"]["error"] == "its observation space is a Box, which has no `n`"


@pytest.mark.slow
def test_the_command_line_tries_all_laws(tmp_path: Path) -> None:
    (tmp_path / "bandit.yaml").write_text(BANDIT, encoding="utf-8")
    (tmp_path / "mine.py").write_text(MINE, encoding="utf-8")
    asked = ("--tasks", tmp_path / "bandit.yaml", "--seeds", 5, "--steps", 50, "--twins", 0, "-j", 1)
    done = Done("exam", f"{tmp_path / 'mine.py'}:train", *asked, "--laws", "-o", tmp_path / "found", columns=80)
    assert done.status == 0, done.out + done.err
    assert "distractors           0  not tried on 1 task: AttributeError" in done.out
    assert "permuted_actions      1  no" in done.out and "Bandit 1.00 → 0.00 (p = 0.0079)" in done.out


def test_a_law_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="there is no law 'scal': did you mean 'scale'"):
        obeys("scal")
