"""Cliff worlds and random decision processes against the package that they reproduce, seals 0.2.1.

These are specs of the tests, and their observations have the bounds of their values where seals declares none.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import taskspec
from tests.shared.seals import fits, original, put

SPECS = Path(__file__).parent / "specs"


CLIFFS = [(7, 4, 9, False), (7, 4, 9, True), (15, 6, 18, True)]


@pytest.mark.parametrize(("width", "height", "steps", "xy"), CLIFFS)
def test_cliff_world(width: int, height: int, steps: int, xy: bool) -> None:
    theirs = original(f"CliffWorld{width}x{height}{'XY' if xy else ''}").unwrapped
    sizes = {"width": width, "height": height, "steps": steps}
    ours = taskspec.load(str(SPECS / "cliff_world.yaml"), "xy" if xy else None, **sizes).make()
    assert ours.action_space == theirs.action_space
    assert ours.observation_space.shape == theirs.observation_space.shape
    assert ours.observation_space.dtype == theirs.observation_space.dtype
    ours.reset(seed=0)
    for state, action in np.ndindex(theirs.state_dim, theirs.action_dim):
        reached = [_step_on_cliff(theirs, ours, width, state, action) for _ in range(100)]
        assert fits(reached, theirs.transition_matrix[state, action]), (state, action)


def _step_on_cliff(theirs: Any, ours: Any, width: int, state: int, action: int) -> int:
    seen = put(ours, {"row": state // width, "col": state % width})
    np.testing.assert_allclose(seen, theirs.observation_matrix[state], rtol=1e-6)
    obs, reward, terminated, truncated, _ = ours.step(action)
    assert reward == theirs.reward_matrix[state]
    assert not terminated
    assert not truncated
    reached = int(ours.state["row"]) * width + int(ours.state["col"])
    np.testing.assert_allclose(obs, theirs.observation_matrix[reached], rtol=1e-6)
    return reached


def test_cliff_world_terminates_at_its_last_step() -> None:
    ours = taskspec.load(str(SPECS / "cliff_world.yaml")).make()
    ours.reset(seed=0)
    assert [ours.step(3)[2] for _ in range(9)] == [False] * 8 + [True]


def test_random_mdp_with_the_numbers_that_seals_draws(tmp_path: Path) -> None:
    """With the numbers of seals in place of its own, the spec is the environment of seals."""
    theirs = original("Random").unwrapped
    spec = yaml.safe_load((SPECS / "random_mdp.yaml").read_text())
    shape = theirs.transition_matrix.shape
    spec["constants"] = {
        "features": theirs.observation_matrix.astype(float).tolist(),
        "rank": np.zeros(shape, dtype=int).tolist(),
        "successors": np.ones(shape[:2], dtype=int).tolist(),
        "weight": theirs.transition_matrix.astype(float).tolist(),
        "start_rank": [0] * shape[0],
        "start_weight": theirs.initial_state_dist.tolist(),
        "coefficients": theirs.reward_weights.tolist(),
    }
    del spec["parameters"]["instance_seed"]
    path = tmp_path / "random_mdp.yaml"
    path.write_text(yaml.safe_dump(spec))
    _compare_random_mdp(theirs, taskspec.load(str(path)).make())


def _compare_random_mdp(theirs: Any, ours: Any) -> None:
    ours.reset(seed=0)
    starts = []
    for _ in range(2000):
        ours.reset()
        starts.append(int(ours.state["s"]))
    assert fits(starts, theirs.initial_state_dist)
    for state, action in np.ndindex(theirs.state_dim, theirs.action_dim):
        reached = []
        for _ in range(300):
            obs = put(ours, {"s": state})
            np.testing.assert_allclose(obs, theirs.observation_matrix[state], rtol=1e-6)
            reward = ours.step(action)[1]
            assert reward == pytest.approx(theirs.reward_matrix[state], rel=1e-5)
            reached.append(int(ours.state["s"]))
        assert fits(reached, theirs.transition_matrix[state, action]), (state, action)


@pytest.mark.parametrize("instance_seed", [0, 1, 42])
def test_random_mdp_has_the_declared_number_of_successors(instance_seed: int) -> None:
    sizes = {"S": 6, "A": 2, "K": 3, "instance_seed": instance_seed}
    ours = taskspec.load(str(SPECS / "random_mdp.yaml"), **sizes).make()
    ours.reset(seed=0)
    for state, action in np.ndindex(6, 2):
        reached = set()
        for _ in range(200):
            put(ours, {"s": state})
            ours.step(action)
            reached.add(int(ours.state["s"]))
        assert 1 <= len(reached) <= 3
