"""Learners of other libraries: the files of the page are short, and each learns where its package is installed."""

from pathlib import Path

import pytest

from taskspec.exam import Running, examine
from tests.docs.test_snippets import DOCS

LEARNERS = DOCS / "howto" / "scripts" / "learners"
SHORT = (
    "sb3", "sb3_contrib_trpo", "sb3_contrib_maskable_ppo", "cleanrl_style", "d3rlpy_bc", "tianshou_dqn", "torchrl_dqn",
    "rllib_ppo", "rejax_ppo",
)  # fmt: skip
"""Short examples; the others are for releases of a library before and after a repair."""
CASES = [
    ("sb3.py:ppo", "stable_baselines3", "RiskyPath", 3000), ("sb3.py:dqn", "stable_baselines3", "RiskyPath", 3000),
    ("sb3.py:a2c", "stable_baselines3", "RiskyPath", 6000), ("sb3_contrib_trpo.py:train", "sb3_contrib", "RiskyPath", 3000),
    ("sb3_contrib_maskable_ppo.py:train", "sb3_contrib", "Hanoi", 20_000), ("cleanrl_style.py:train", "torch", "RiskyPath", 3000),
    ("cleanrl_ppo.py:train", "torch", "ValueLeft", 10_000),
    ("d3rlpy_bc.py:train", "d3rlpy", "RiskyPath", 1), ("skrl_dqn.py:train", "skrl", "RiskyPath", 4000),
    ("tianshou_dqn.py:train", "tianshou", "RiskyPath", 3000), ("torchrl_dqn.py:train", "torchrl", "RiskyPath", 3000),
    ("rllib_ppo.py:train", "ray.rllib", "RiskyPath", 3000), ("rejax_ppo.py:train", "rejax", "RiskyPath", 16_000),
]  # fmt: skip


@pytest.mark.parametrize("name", SHORT)
def test_examples_are_short(name: str) -> None:
    lines = (LEARNERS / f"{name}.py").read_text(encoding="utf-8").splitlines()
    body = [line for line in lines if line.strip() and not line.startswith(("import", "from", "@learns_from"))]
    assert len(body) <= 12


@pytest.mark.slow
@pytest.mark.parametrize(("learner", "package", "task", "steps"), CASES)
def test_examples_learn(learner: str, package: str, task: str, steps: int, tmp_path: Path) -> None:
    pytest.importorskip(package)
    found = examine(
        str(LEARNERS / learner), tasks=[task], seeds=1, steps=steps, transitions=500, twins=0, peeks=False,
        out=tmp_path, running=Running(1),
    )  # fmt: skip
    (score,) = found["scores"]
    assert score["error"] is None and (score["deterministic"] or 0.0) > 0.95
