"""The plugin of pytest, in runs of pytest: what passes, what a failure prints, options, markers, workers, and its cost."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]
ROOT = Path(__file__).parent.parent

LEARNERS = """
import numpy as np
import pytest
from taskspec.exam import Case, Learned, learns_from


@learns_from("reward")
def train(case: Case, limit_is_an_end: bool = False) -> Learned:
    env, rng = case.env(), np.random.default_rng(case.seed)
    q = np.zeros((case.observation_space.n, case.action_space.n))
    obs, _ = env.reset()
    for _ in range(case.steps):
        action = q[obs].argmax() if rng.random() < 0.5 else rng.integers(len(q[obs]))
        after, reward, terminated, truncated, _ = env.step(action)
        done = terminated or (truncated and limit_is_an_end)
        q[obs, action] += 0.02 * (reward + 0.8 * (0 if done else q[after].max()) - q[obs, action])
        obs = env.reset()[0] if terminated or truncated else after
    return Learned(q, discount=0.8)


@learns_from("reward")
def wrong(case: Case) -> Learned:
    return train(case, limit_is_an_end=True)
"""

COIN_WALK = """
taskspec: 1
name: CoinWalk
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: choice, values: [safe, risky]}}
horizon: 10
initial: {s: 0}
dynamics: {s': "(s + 1) % 4 if a == safe else (s + (2 if Bernoulli(1/2) else 0)) % 4"}
reward: "(3 if s == 3 else 0) + (1/2 if a == risky and s == 1 else 0) - (2 if s == 2 and a == risky else 0)"
"""


def ran(pytester: pytest.Pytester, tests: str, *options: str) -> pytest.RunResult:
    """Run tests beside the learners, in a process of its own."""
    pytester.makefile(".yaml", coin_walk=COIN_WALK)
    pytester.makepyfile(learners=LEARNERS, test_mine=f"import pytest\nfrom learners import *\n\n{tests}")
    return pytester.runpytest_subprocess("-p", "taskspec_pytest", *options)


def test_a_right_learner_passes_and_a_wrong_one_fails_with_cause_task_and_command(pytester: pytest.Pytester) -> None:
    result = ran(
        pytester,
        """
        @pytest.mark.exam(tasks="coin_walk.yaml", seeds=2)
        def test_right(exam):
            exam(train, steps="20k", twins=0).passes()

        @pytest.mark.exam(tasks="coin_walk.yaml", seeds=5)
        def test_wrong(exam):
            exam(wrong, steps="20k", twins=0).passes()
        """.replace("\n        ", "\n"),
        "--strict-markers",
    )
    result.assert_outcomes(passed=1, failed=1)
    printed = result.stdout.str()
    assert "Traceback" not in printed and "pytest_plugin.py" not in printed
    assert "CoinWalk-v0: nearest known mistake: a learner for which the time limit ends" in " ".join(printed.split())
    assert "name: CoinWalk" in printed
    (line,) = set(re.findall(r"^To reproduce: (.*)", printed, re.MULTILINE))  # CI repeats it in the summary
    command = shlex.split(line)
    assert command[:3] == ["taskspec", "exam", "learners.py:wrong"]
    again = subprocess.run(
        [sys.executable, "-m", *command], cwd=pytester.path, capture_output=True, text=True, check=False
    )
    assert again.returncode == 1 and "the time limit ends" in " ".join(again.stdout.split())


@pytest.mark.slow
def test_workers_of_xdist_and_options_of_the_command_line(pytester: pytest.Pytester) -> None:
    pytest.importorskip("xdist")
    result = ran(
        pytester,
        """
        @pytest.mark.parametrize("learner", [train, "learners.py:train"], ids=["function", "file"])
        def test_right(exam, learner):
            found = exam(learner, tasks="Sort", steps=100).exam
            assert list(found["tasks"]) == ["derail/EarlyTermPos-v0"] and found["seeds"] == [0, 1]
            assert found["steps"] == 2000
        """.replace("\n        ", "\n"),
        *("-n", "2", "--exam-tasks", "EarlyTermPos", "--exam-seeds", "2", "--exam-steps", "2k", "--exam-out", "found"),
    )
    result.assert_outcomes(passed=2)
    assert len(list(pytester.path.glob("found/test_mine.py-test_right*/report.html"))) == 2
    assert len(list(pytester.path.glob("found/*"))) == 2


MISTAKES = {
    "exam(train, task='Sort')": "an exam has no argument 'task': ",
    "exam(train, seeds='few')": "the exam's 'seeds' is a number such as 50k, not 'few'",
    "exam(train, suite='probs')": "there is no suite 'probs'",
    "exam('nowhere.py:train')": "nowhere.py",
}


INSIDE = """
def test_inside(exam):
    def stays(case):
        raise ValueError("it crashes")

    exam(stays, tasks=["EarlyTermPos"], seeds=1, steps=10, twins=0).passes()
"""


def test_mistakes_in_a_test_are_messages(pytester: pytest.Pytester) -> None:
    tests = [f"def test_{i}(exam):\n    {call}.passes()\n" for i, call in enumerate(MISTAKES)]
    result = ran(pytester, "\n".join([*tests, INSIDE]))
    result.assert_outcomes(failed=len(MISTAKES) + 1)
    printed = " ".join(result.stdout.str().split())
    for message in MISTAKES.values():
        assert message in printed
    assert "pytest_plugin.py" not in printed
    assert "ValueError: it crashes" in printed and ", in stays" in printed and "test_mine.py:" in printed
    result.stdout.fnmatch_lines(["To reproduce: pytest test_mine.py::test_inside"])  # no file names the function


def test_the_plugin_is_an_entry_point_and_imports_nothing_where_it_is_not_used(pytester: pytest.Pytester) -> None:
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert config["project"]["entry-points"]["pytest11"] == {"taskspec_pytest": "taskspec_pytest"}
    pytester.makepyfile(
        """
        import sys

        def test_it():
            heavy = ("numpy", "gymnasium", "pydantic", "taskspec")
            assert {name for name in sys.modules if name.partition(".")[0] in heavy} == set()
        """
    )
    pytester.runpytest_subprocess("-p", "taskspec_pytest", "-p", "no:hypothesispytest").assert_outcomes(passed=1)
