"""The suite `seals`, cliff worlds and random decision processes, beside the package that it reproduces, seals 0.2.1.

Tables are compared number for number. What NumPy draws there, and our own stream here, is compared as distributions, by tests at
level `ALPHA` on fixed seeds; and with the numbers that NumPy drew in place of ours, the tables are equal.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import yaml

import taskspec
from taskspec.exact import extract, scores
from taskspec.language.task.task import Task
from tests.shared.seals import ALPHA, fits, homogeneous, original, put, stats
from tests.shared.sparse import sparse

SUITE = Path(__file__).parents[3] / "tasks" / "seals"
FORMS = {
    "CliffWorld7x4": "CliffWorld",
    "CliffWorld7x4XY": "CliffWorldXY",
    "CliffWorld15x6": "CliffWorldMedium",
    "CliffWorld15x6XY": "CliffWorldMediumXY",
    "CliffWorld100x20": "CliffWorldLarge",
    "CliffWorld100x20XY": "CliffWorldLargeXY",
    "Random": "RandomTransition",
}
OTHER_CLIFF = {
    "width": 5, "height": 3, "horizon": 4, "use_xy_obs": True, "rew_default": -2, "rew_goal": 7, "rew_cliff": -30, "fail_p": 0.6,
}  # fmt: skip
CLIFFS: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in FORMS if name != "Random"),
    ("CliffWorld7x4", OTHER_CLIFF),
    ("CliffWorld15x6XY", {"use_xy_obs": False, "fail_p": 0.0, "width": 3, "height": 2}),
]
SIZES = {"n_states": 6, "n_actions": 2, "branch_factor": 3, "horizon": 5, "random_obs": True, "obs_dim": 4}

each = pytest.mark.parametrize(("theirs", "ours"), FORMS.items(), ids=FORMS)
cliff = pytest.mark.parametrize(("name", "options"), sparse(CLIFFS, 2))


def pair(name: str, **options: Any) -> tuple[Any, Any]:
    """The registered environment and ours, given the same keywords."""
    return original(name, **options).unwrapped, gym.make(f"seals/{FORMS[name]}-v0", **options)


def test_both_packages_keep_their_ids() -> None:
    makers = {i: str(spec.entry_point).split(".")[0] for i, spec in gym.registry.items() if i.startswith("seals/")}
    assert {i for i, maker in makers.items() if maker == "taskspec"} == {f"seals/{n}-v0" for n in FORMS.values()}
    assert {i for i, maker in makers.items() if maker == "seals"} >= {f"seals/{n}-v0" for n in FORMS}


@each
def test_spaces_are_equal(theirs: str, ours: str) -> None:
    them, us = pair(theirs)
    assert us.observation_space == them.observation_space
    assert us.action_space == them.action_space


@each
def test_episodes_end_alike_and_tell_their_states(theirs: str, ours: str) -> None:
    them, us = pair(theirs)
    us.action_space.seed(0)
    them.reset(seed=0)
    us.reset(seed=0)
    for _ in range(them.horizon):
        action = us.action_space.sample()
        state = us.state["s"]
        *_, terminated, truncated, info = them.step(action)
        result = us.step(action)
        assert result[2:4] == (terminated, truncated)
        assert result[4] == {"old_state": state, "new_state": us.state["s"]}
        assert result[4].keys() == info.keys()
        assert all(isinstance(value, int) for value in result[4].values())
    assert terminated


@cliff
def test_tables_of_cliff_worlds(name: str, options: dict[str, Any]) -> None:
    them, us = pair(name, **options)
    assert_tables_agree(us.task, them, 1e-15)


def assert_tables_agree(task: Task, them: Any, tolerance: float) -> None:
    """Start, transitions and rewards of the whole model; terminations at the last step and never before."""
    model = extract(task, reachable=False)
    np.testing.assert_allclose(model.start, them.initial_state_dist, atol=tolerance)
    states = model.n_states
    actions = model.n_actions
    assert (states, actions) == (them.state_dim, them.action_dim)
    for t in (0, them.horizon - 1):
        step = model.step(t)
        last = t == them.horizon - 1
        table = step.P_end if last else step.P
        assert (step.P.nnz if last else 0 if step.P_end is None else step.P_end.nnz) == 0
        for a in range(actions):
            row = table[a * states : (a + 1) * states].toarray()
            np.testing.assert_allclose(row, them.transition_matrix[:, a], atol=tolerance)
            np.testing.assert_allclose(step.R[a * states : (a + 1) * states], them.reward_matrix, rtol=1e-6)


@cliff
def test_observations_of_cliff_worlds(name: str, options: dict[str, Any]) -> None:
    them, us = pair(name, **options)
    us.reset(seed=0)
    for s in range(0, them.state_dim, 1 + them.state_dim // 60):
        seen = put(us, {"s": s})
        assert seen.dtype == them.observation_matrix.dtype
        np.testing.assert_allclose(seen, them.observation_matrix[s], rtol=1e-6)


@pytest.mark.parametrize("options", [{}, OTHER_CLIFF], ids=["registered", "other"])
def test_steps_of_cliff_worlds(options: dict[str, Any]) -> None:
    them, us = pair("CliffWorld7x4", **options)
    us.reset(seed=0)
    for state, action in np.ndindex(them.state_dim, them.action_dim):
        reached = [step(them, us, state, action) for _ in range(60)]
        assert fits(reached, them.transition_matrix[state, action]), (state, action)


def step(them: Any, us: Any, state: int, action: int) -> int:
    put(us, {"s": state})
    obs, reward, terminated, truncated, info = us.step(action)
    reached = int(info["new_state"])
    assert reward == pytest.approx(float(them.reward_matrix[state]), rel=1e-6)
    assert (terminated, truncated) == (False, False)
    np.testing.assert_allclose(obs, them.observation_matrix[reached], rtol=1e-6)
    return reached


def returns(transitions: Any, rewards: Any, start: Any, horizon: int) -> tuple[float, float]:
    """Best and random return, by recursion over dense tables."""
    best = np.zeros(len(rewards))
    uniform = np.zeros(len(rewards))
    for _ in range(horizon):
        best = rewards + (transitions @ best).max(axis=1)
        uniform = rewards + (transitions @ uniform).mean(axis=1)
    return float(start @ best), float(start @ uniform)


@each
def test_scores_are_those_of_the_published_tables(theirs: str, ours: str) -> None:
    if theirs == "Random":  # another instance than NumPy's, so its own tables
        task = taskspec.load(f"seals/{ours}")
        arguments: Any = (*tables(task)[:3], 20)
    else:
        them, us = pair(theirs)
        task = us.task
        arguments = (them.transition_matrix, them.reward_matrix, them.initial_state_dist, them.horizon)
    found = scores(task)
    assert (found.optimal.value, found.random.value) == pytest.approx(returns(*arguments), rel=1e-9)


# -- random decision processes ----------------------------------------------------------------------------------------


def tables(task: Task) -> tuple[Any, Any, Any, Any, Any]:
    """By the constants of an instance: transitions (S, A, S), rewards (S,), start (S,), features (S, d), reward weights (d,)."""
    c = {name: np.asarray(value, dtype=np.float64) for name, value in task.constants.items()}
    b = task.values["b"]
    going = c["weight"] * (c["rank"] < c["successors"][..., None])
    start = c["start_weight"] * (c["start_rank"] < b)
    rewards = c["features"] @ c["reward_weights"]
    return going / going.sum(axis=-1, keepdims=True), rewards, start / start.sum(), c["features"], c["reward_weights"]


@lru_cache
def samples() -> tuple[list[Any], list[Any]]:
    """Tables of 80 instances of seals, and of 80 of ours."""
    from seals.diagnostics.random_trans import RandomTransitionEnv

    them = [RandomTransitionEnv(**SIZES, generator_seed=seed) for seed in range(80)]  # type: ignore[arg-type]
    drawn = [
        (e.transition_matrix, e.reward_matrix, e.initial_state_dist, e.observation_matrix, e.reward_weights)
        for e in them
    ]
    ours = [tables(taskspec.load("seals/RandomTransition", **SIZES, generator_seed=seed)) for seed in range(80)]
    return drawn, ours


def supports(instance: Any) -> list[tuple[int, ...]]:
    """For every state and action, the states that they may lead to."""
    return [tuple(np.flatnonzero(row)) for row in instance[0].reshape(-1, SIZES["n_states"])]


def test_successors_have_one_distribution() -> None:
    theirs, ours = ([each for instance in drawn for each in supports(instance)] for drawn in samples())
    assert homogeneous(map(len, theirs), map(len, ours))
    for size in (1, 2, 3):
        assert homogeneous((s for s in theirs if len(s) == size), (s for s in ours if len(s) == size))


def test_starts_have_one_distribution() -> None:
    theirs, ours = ([tuple(np.flatnonzero(instance[2])) for instance in drawn] for drawn in samples())
    assert {len(s) for s in theirs} == {len(s) for s in ours} == {SIZES["branch_factor"]}
    assert homogeneous((i for s in theirs for i in s), (i for s in ours for i in s))


def probabilities(instance: Any, size: int) -> list[float]:
    """Of all rows with so many successors, how likely the first of them is."""
    rows = instance[0].reshape(-1, SIZES["n_states"])
    return [float(row[row > 0][0]) for row in rows if (row > 0).sum() == size]


NUMBERS = {
    "of two successors": lambda i: probabilities(i, 2),
    "of three successors": lambda i: probabilities(i, 3),
    "of the start": lambda i: i[2][i[2] > 0],
    "seen": lambda i: i[3].ravel(),
    "in the reward": lambda i: i[4],
    "of rewards": lambda i: i[1],
}


@pytest.mark.parametrize("what", NUMBERS)
def test_numbers_have_one_distribution(what: str) -> None:
    theirs, ours = (np.concatenate([NUMBERS[what](i) for i in drawn]) for drawn in samples())
    assert stats.ks_2samp(theirs, ours).pvalue > ALPHA


def test_the_tables_of_seals_make_its_process(tmp_path: Path) -> None:
    """With the numbers of seals in place of its own, the spec is the environment of seals."""
    theirs = original("Random").unwrapped
    spec = yaml.safe_load((SUITE / "random_transition.yaml").read_text())
    shape = theirs.transition_matrix.shape
    spec["constants"] = {
        "features": theirs.observation_matrix.astype(float).tolist(),
        "rank": np.zeros(shape, dtype=int).tolist(),
        "successors": np.ones(shape[:2], dtype=int).tolist(),
        "weight": theirs.transition_matrix.astype(float).tolist(),
        "start_rank": [0] * shape[0],
        "start_weight": theirs.initial_state_dist.tolist(),
        "reward_weights": theirs.reward_weights.tolist(),
    }
    path = tmp_path / "random_transition.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in spec.items() if k not in ("claims", "accept", "errata")}))
    task = taskspec.load(path)
    assert_tables_agree(task, theirs, 1e-7)
    us = taskspec.make(task)
    us.reset(seed=0)
    for state, action in np.ndindex(theirs.state_dim, theirs.action_dim):
        assert fits([step(theirs, us, state, action) for _ in range(40)], theirs.transition_matrix[state, action])


@pytest.mark.parametrize("options", [{"obs_dim": 3}, {"obs_dim": 0}, {"random_obs": False, "obs_dim": 0}])
def test_observations_have_the_published_lengths(options: dict[str, Any]) -> None:
    published = options | {"obs_dim": options["obs_dim"] or None}
    theirs = original("Random", n_states=7, **published).unwrapped
    ours = gym.make("seals/RandomTransition-v0", n_states=7, **options)
    assert ours.observation_space == theirs.observation_space
    ours.reset(seed=0)
    if not options.get("random_obs", True):
        assert [put(ours, {"s": s}).tolist() for s in range(7)] == theirs.observation_matrix.tolist()


def test_a_length_of_one_hot_vectors_is_refused_by_both() -> None:
    with pytest.raises(ValueError, match="obs_dim must be None"):
        original("Random", random_obs=False)
    with pytest.raises(taskspec.SpecError, match="obs_dim must be 0 if random_obs is false"):
        gym.make("seals/RandomTransition-v0", random_obs=False)
