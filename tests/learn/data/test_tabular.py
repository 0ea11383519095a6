"""Arrays of exact models, beside planning written anew, simulated episodes, and the packages that take them."""

from pathlib import Path

import numpy as np
import pytest

import taskspec
from taskspec.data import Tabular, demonstrations, tabular
from taskspec.exact import scores
from tests.shared.sections import whole_spec
from tests.shared.specs import spec_file

TASKS = [
    "RiskyPath",
    "Branching",
    "EarlyTermNeg",
    "EarlyTermPos",
    "InitShiftLearner",
    "Sort",
    "ProcGoal?D=3",
    "seals/CliffWorld",
    "seals/RandomTransition",
    spec_file("frozen_lake"),
]


def best(found: Tabular) -> float:
    """The optimal return by backward induction."""
    values = np.zeros(found.n_states)
    assert found.horizon is not None
    for _ in range(found.horizon):
        values = (found.R + found.discount * found.P @ values).max(axis=1)
    return float(found.p0 @ values)


@pytest.mark.parametrize("task", TASKS, ids=lambda task: Path(task).stem)
def test_planning_on_the_arrays_gives_the_optimal_return(task: str) -> None:
    loaded = taskspec.load(task)
    found = taskspec.data.tabular(loaded)
    assert found.P.shape == (found.n_states, found.n_actions, found.n_states) and found.R.shape == found.P.shape[:2]
    assert np.allclose(found.P.sum(axis=2), 1) and np.isclose(found.p0.sum(), 1) and (found.P >= 0).all()
    optimal = scores(loaded).optimal
    assert optimal is not None and np.isclose(best(found), optimal.value)
    for a, part in enumerate(found.sparse):
        assert np.array_equal(part.toarray(), found.P[:, a])


STOCK = """
state:
  n: {type: int, low: 0, high: 2}
action:
  a: {type: choice, values: [buy, sell]}
legal: a == buy or n > 0
horizon: 3
initial:
  n: 0
dynamics:
  n': "min(n + 1, 2) if a == buy else max(n - 1, 0)"
reward: 2 if a == sell else -1
"""


def test_planning_on_the_arrays_needs_the_legal_actions(tmp_path: Path) -> None:
    path = tmp_path / "stock.yaml"
    path.write_text(whole_spec(STOCK))
    found = tabular(path)
    assert found.legal.tolist() == [[True, False], [True, True], [True, True]]
    assert tabular("RiskyPath").legal.all()
    optimal = scores(path).optimal
    assert optimal is not None and optimal.value == 0
    values = np.zeros(found.n_states)
    for _ in range(3):
        values = np.where(found.legal, found.R + found.P @ values, -np.inf).max(axis=1)
    assert found.p0 @ values == 0
    assert best(found) == 6


def test_ends_are_states_that_absorb() -> None:
    found = tabular("EarlyTermNeg")
    (end,) = np.flatnonzero(found.absorbed)
    assert found.P[end, :, end].tolist() == [1, 1] and found.R[end].tolist() == [0, 0]
    assert found.P[:, :, end].sum() > 2
    assert not tabular("RiskyPath").absorbed.any()


@pytest.mark.parametrize("task", ["RiskyPath", "Branching", "NoisyObs"])
def test_occupancy_counts_states_of_episodes(task: str) -> None:
    found = tabular(task)
    assert found.horizon is not None
    exact = found.occupancy("epsilon(0.5)")
    assert np.isclose(exact.sum(), found.horizon + 1)
    if task == "NoisyObs":
        with pytest.raises(taskspec.SpecError, match="not a function of the state"):
            _ = found.observations
        return
    shown = demonstrations(task, "epsilon(0.5)", episodes=3000)
    counts = np.zeros(found.n_states)
    for trajectory in shown.trajectories:
        np.add.at(counts, found.index(trajectory.obs), 1 / 3000)
    assert np.abs(counts - exact).max() < 0.15


def test_observations_are_those_of_the_environment() -> None:
    found = tabular("Branching")
    env = taskspec.make("Branching")
    env.reset(seed=0)
    for i in range(found.n_states):
        state = {name: value for name, value in found.model.state(i).items() if name in env.state}
        assert env.reset(seed=0, options={"state": state})[0] == found.observations[i]
    assert np.array_equal(found.features.argmax(axis=1), found.observations)
    assert np.array_equal(found.index(found.observations), np.arange(found.n_states))


def test_what_cannot_be_tabulated_says_why(tmp_path: Path) -> None:
    with pytest.raises(taskspec.SpecError, match="infinitely many values"):
        tabular("Parabola")
    text = spec_file("risky_path").read_text()
    endless = tmp_path / "endless.yaml"
    endless.write_text(text.split("claims:")[0].replace("horizon: 5", "horizon: none\ndiscount: 0.5"))
    with pytest.raises(taskspec.SpecError, match="no horizon"):
        tabular(endless).occupancy("random")


def test_seals_and_ours_step_alike() -> None:
    pytest.importorskip("seals")
    found = tabular("RiskyPath")
    env = found.seals()
    env.reset(seed=1)
    totals = []
    for _ in range(400):
        env.reset()
        totals.append(sum(env.step(action)[1] for action in (1, 0, 0, 0, 0)))
    policy = np.zeros(5, int)
    policy[0] = 1
    exact = 0.0
    now = found.p0
    for t in range(5):
        exact += now @ found.R[:, policy[t]]
        now = now @ found.P[:, policy[t]]
    assert abs(np.mean(totals) - exact) < 4 * np.std(totals) / 20
