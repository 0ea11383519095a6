"""Environments as text, as pixels and in a window."""

from __future__ import annotations

import numpy as np

import taskspec
from taskspec.show.figures import render_frame


def test_pixels_are_those_of_the_frame() -> None:
    env = taskspec.make("RiskyPath", render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    env.step(0)
    title = "RiskyPath, step 1 of 5"
    assert np.array_equal(env.render(), render_frame(env.task, env.state, title))
    assert not np.array_equal(env.render(), first)
