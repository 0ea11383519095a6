"""Tasks as tables, shrunk tasks, and the search for a task that separates two learners."""

from pathlib import Path

import pytest

from taskspec import experiments, load
from taskspec.exact import Results
from taskspec.learn.exam.examinee import learner_of
from taskspec.tools.exchange.freezing import freeze
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.spec_text import spec_text, task_of_tables
from taskspec.tools.separation.separate import Search
from taskspec.tools.separation.shrink import shrink, size
from tests.shared.commands import Done

pytestmark = pytest.mark.usefixtures("warm")

LEARNERS = """
import numpy as np
from taskspec.exam import learns_from

def learn(case, counts_ends, gamma):
    env, rng = case.env(), np.random.default_rng(case.seed)
    q = np.zeros((int(case.observation_space.n), int(case.action_space.n)))
    obs, _ = env.reset()
    for _ in range(case.steps):
        action = int(q[obs].argmax()) if rng.random() > 0.2 else int(rng.integers(len(q[obs])))
        after, reward, terminated, truncated, _ = env.step(action)
        later = 0 if terminated and not counts_ends else q[after].max()
        q[obs, action] += 0.1 * (reward + gamma * later - q[obs, action])
        obs = env.reset()[0] if terminated or truncated else after
    return q

@learns_from("reward")
def right(case):
    return learn(case, False, 0.95)

@learns_from("reward")
def also_right(case):
    return learn(case, False, 0.93)

@learns_from("reward")
def past_the_end(case):
    return learn(case, True, 0.95)
"""
FAMILY = """
experiment: 1
name: few
tasks:
  - task: families/Table
    parameters: {S: [1, 2], A: 2, N: 6, c: 0, d: 1, e: 0.5, f: 0, instance_seed: {range: [0, SEEDS]}}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "q.py").write_text(LEARNERS)
    (tmp_path / "few.yaml").write_text(FAMILY.replace("SEEDS", "4"))
    return tmp_path


@pytest.mark.parametrize(
    "name",
    [
        "families/Table?S=4&c=1&instance_seed=3", "families/Chain?instance_seed=4", "derail/RiskyPath", "derail/Branching?L=3",
        "probes/Hazard", "probes/LookAlikes", "seals/CliffWorld", "seals/RandomTransition",
        "families/Table?A=2&N=7&S=2&c=0.5&e=0&f=0.1&instance_seed=144159",
    ],
)  # fmt: skip
def test_a_frozen_task_has_the_same_returns_and_proved_claims(name: str, tmp_path: Path) -> None:
    task = load(name)
    path = tmp_path / "frozen.yaml"
    path.write_text(spec_text(freeze(task)))
    known = Results(task, 1)
    found = Results(load(str(path)), 1)
    for which in ("optimal", "random", "worst"):
        assert getattr(found, which).value == pytest.approx(getattr(known, which).value, abs=1e-9)
    checked = Done("check", str(path))
    assert "3 proved" in checked.out


def test_freeze_refuses_what_has_no_tables() -> None:
    for name in ("derail/Parabola", "probes/Aim"):
        refused = Done("freeze", name)
        assert refused.status == 1
        assert "E712" in refused.err


def test_freeze_takes_the_seed_of_the_instance(tmp_path: Path) -> None:
    first = Done("freeze", "families/Table", "--seed", 1).out
    other = Done("freeze", "families/Table", "--seed", 2).out
    again = Done("freeze", "families/Table", "--seed", 1).out
    assert first == again != other
    assert "Bernoulli" not in first


def test_shrinking_keeps_what_holds_and_ends_where_nothing_smaller_does() -> None:
    """A gap between the optimal and the random return of 1/4 needs one state and one reward."""
    task = freeze(load("families/Table?S=4&A=3&N=6&c=0.5&instance_seed=8"))

    def gap(each: FrozenTask) -> float:
        results = Results(task_of_tables(each), 1)
        assert results.optimal is not None
        assert results.random is not None
        return results.optimal.value - results.random.value

    path = shrink(task, lambda tasks: [gap(each) >= 0.25 for each in tasks], lambda: False)
    assert path == sorted(path, key=size, reverse=True)
    assert min(map(gap, path)) >= 0.25
    assert len(path[-1].states) == 1
    assert path[-1].horizon == 1
    rewards = [outcome.reward for _, _, outcome in path[-1].steps()]
    assert sorted(map(abs, rewards)) == [0, 1]


def test_no_difference_is_found_between_right_learners(folder: Path) -> None:
    done = Done("separate", "q.py:right", "q.py:also_right", "--in", "few.yaml", "--steps", "1000", "-j", "2")
    assert done.out == "No difference found in 8 tasks of few.yaml.\n"


@pytest.mark.slow
def test_an_interrupt_keeps_the_best_so_far(folder: Path) -> None:
    def interrupted(words: str) -> None:
        if "worse" in words:
            raise KeyboardInterrupt

    search = Search(
        experiments.read("few.yaml"), learner_of("q.py:past_the_end"), learner_of("q.py:right"), steps=1000, workers=2,
        progress=interrupted,
    )  # fmt: skip
    found = search.run()
    assert found.worse == "q.py:past_the_end"
    assert not found.is_complete
