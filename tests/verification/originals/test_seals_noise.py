"""What the `seals` variants draw, against what seals 0.2.1 is known to draw from."""

from __future__ import annotations

import numpy as np

import taskspec
from tests.shared.seals import ALPHA, stats


def test_bounds_of_the_proc_goal_start() -> None:
    ours = taskspec.make(taskspec.load("derail/ProcGoalSeals", B=2, D=1))
    ours.reset(seed=0)
    seen = {tuple(int(v) for v in ours.reset()[0]) for _ in range(1500)}
    assert {(x, y) for x, y, *_ in seen} == {(x, y) for x in range(-2, 2) for y in range(-2, 2)}
    assert {(u - x, v - y) for x, y, u, v in seen} == {(0, 1), (0, -1)}


def test_noise_is_fresh_and_standard_normal() -> None:
    ours = taskspec.make(taskspec.load("derail/NoisyObsSeals"))
    noise = [ours.reset(seed=0)[0][2:]]
    for _ in range(400):
        noise.extend(ours.step(4)[0][2:] for _ in range(5))
        noise.append(ours.reset()[0][2:])
    values = np.array(noise, dtype=np.float64)
    assert len(np.unique(values[:, 0])) == len(values)
    assert stats.kstest(values.ravel(), "norm").pvalue > ALPHA
    assert abs(np.corrcoef(values.T) - np.eye(20)).max() < 0.12
    assert abs(np.corrcoef(values[1:, 0], values[:-1, 0])[0, 1]) < 0.1
