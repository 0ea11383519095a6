"""Frames of vector environments."""

from functools import partial

import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

import taskspec
from taskspec.envs import NotRunningError
from taskspec.envs.vector import VectorEnvironment

LANES = 3


def test_frames_and_attributes_are_those_of_the_scalar_environments() -> None:
    pytest.importorskip("matplotlib")
    make = partial(taskspec.make, "RiskyPath", render_mode="rgb_array")
    ours = VectorEnvironment("RiskyPath", LANES, backend="numpy", render_mode="rgb_array")
    theirs = SyncVectorEnv([make] * LANES)
    for each in (ours, theirs):
        each.reset(seed=2)
        each.step(np.array([0, 1, 1]))
    assert all(np.array_equal(a, b) for a, b in zip(ours.render(), theirs.render(), strict=True))
    for name in ("state", "time", "task", "render_mode", "observation_space", "action_space"):
        assert ours.get_attr(name) == theirs.get_attr(name)
    assert ours.call("get_keys_to_action") == theirs.call("get_keys_to_action")
    texts = VectorEnvironment("RiskyPath", 2, backend="numpy", render_mode="ansi")
    with pytest.raises(NotRunningError, match="E707"):
        texts.render()
    texts.reset(seed=0)
    assert all("s = start" in text for text in texts.render())
    assert VectorEnvironment("RiskyPath", 2, backend="numpy").render() is None
