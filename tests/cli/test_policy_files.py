"""Policies in files: generators, `predict`, and returns beyond all floats."""

import re
from pathlib import Path

from taskspec.data import demonstrations
from taskspec.exact.scores.returns import Return
from tests.exact.policies.test_policies import risky_return
from tests.shared.commands import Done


def test_returns_beyond_all_floats_have_no_mean(tmp_path: Path) -> None:
    text = SUMS.replace("REWARD", "1e308 * b").replace("horizon: 1", "horizon: 9")
    (tmp_path / "more.yaml").write_text(text, encoding="utf-8")
    assert re.search(r"^ *random +∞ +\(1,000 episodes\)$", Done("solve", tmp_path / "more.yaml").out, re.MULTILINE)


FILE = """
import numpy as np


def noisy(observation, rng):
    return int(rng.random() < 0.3)


class Alternating:
    def predict(self, observation, state=None, episode_start=None):
        steps = np.zeros(len(observation), int) if state is None else state
        return steps % 2, steps + 1


alternating = Alternating()
"""


WRONG = """
def fails(observation):
    return observation["place"]


def forgets(observation):
    observation + 1
"""


def test_a_function_that_fails_or_returns_nothing_is_a_message(tmp_path: Path) -> None:
    path = tmp_path / "model.py"
    path.write_text(WRONG, encoding="utf-8")
    for command in (["run"], ["demos", "-o", tmp_path / "shown.npz"]):
        for name, said in (("fails", "fails failed: TypeError"), ("forgets", "forgets returned no action")):
            done = Done(*command, "RiskyPath", "--policy", f"{path}:{name}")
            assert done.status == 1 and said in " ".join(done.err.split()), done.err


def test_files_may_take_a_generator_or_predict_wherever_policies_are_taken(tmp_path: Path) -> None:
    path = tmp_path / "model.py"
    path.write_text(FILE, encoding="utf-8")
    returns = Done("run", "RiskyPath", "--policy", f"{path}:noisy", "-n", 2000, "--json").data["returns"]
    found = Return.estimated(returns)
    low, high = found.interval(0.9999)
    assert low <= risky_return(0.3) <= high
    again = Done("run", "RiskyPath", "--policy", f"{path}:noisy", "-n", 2000, "--json").data["returns"]
    assert returns == again
    run = Done("run", "RiskyPath", "--policy", f"{path}:alternating", "-n", 2, "--json").data["returns"]
    assert run == [3.0, 3.0]
    assert demonstrations("RiskyPath", f"{path}:alternating", episodes=2).acts.tolist() == [0, 1, 0, 1, 0] * 2


SUMS = """
taskspec: 1
name: Sums
state: {b: {type: real, low: 0, high: 1}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 1
initial: {b: "Uniform(1/2, 1)"}
dynamics: {b': "Uniform(1/2, 1)"}
reward: REWARD
"""
