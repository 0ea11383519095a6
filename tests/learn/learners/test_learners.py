"""Learners of others, as users run them: on policy through the vector adapter, by imitation from files, and from the exact model.

The scripts of the how-to pages have more of them (`test_howto_scripts.py`).
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exact import score
from tests.shared.commands import Done

pytestmark = pytest.mark.slow


def ppo(task: str, steps: int, episode: int) -> Any:
    sb3 = pytest.importorskip("stable_baselines3")
    torch = pytest.importorskip("torch")
    from taskspec.envs.sb3 import Sb3VecEnv

    torch.set_num_threads(1)  # nets this small are slower on several
    lanes = Sb3VecEnv(task, 32, seed=0, backend="numpy")
    model = sb3.PPO(
        "MlpPolicy", lanes, n_steps=2 * episode, batch_size=8 * episode, learning_rate=3e-3, seed=0, device="cpu"
    )
    return model.learn(steps)


def test_ppo_learns_the_safe_path() -> None:
    model = ppo("RiskyPath", 10_000, 5)
    found = score("RiskyPath", model, deterministic=True)
    assert found.asked == "actions" and found.value.value == 4
    assert model.predict(np.array([0]), deterministic=True)[0].tolist() == [0]


@pytest.mark.parametrize(("task", "episode"), [("NoisyObs?L=5", 15), ("Sort", 8)])
def test_ppo_beats_random_actions(task: str, episode: int) -> None:
    low, _ = score(task, ppo(task, 20_000, episode), deterministic=True, episodes=500).interval(0.999)
    assert low > 0.3


@pytest.mark.filterwarnings("ignore")  # of imitation, which leaves its logs open
def test_a_clone_of_the_experts_demonstrations_does_as_the_expert(tmp_path: Path) -> None:
    bc = pytest.importorskip("imitation.algorithms.bc")
    serialize = pytest.importorskip("imitation.data.serialize")
    task = taskspec.load("NoisyObs", L=5)
    made = Done("demos", "NoisyObs?L=5", "-n", 300, "--seed", 1, "-o", tmp_path / "shown", "--format", "imitation")
    assert made.status == 0, made.err
    learner = bc.BC(
        observation_space=task.observation_space, action_space=task.action_space, rng=np.random.default_rng(0),
        demonstrations=serialize.load(tmp_path / "shown"), batch_size=64, optimizer_kwargs={"lr": 1e-2},
    )  # fmt: skip
    learner.train(n_epochs=6, progress_bar=False)
    low, _ = score(task, learner.policy, deterministic=True, episodes=500).interval(0.999)
    assert low > 0.95


def test_preferences_are_a_dataset_of_imitation() -> None:
    pytest.importorskip("imitation")
    from taskspec.data import preferences

    found = preferences("RiskyPath", 20, length=3)
    dataset = found.imitation()
    (first, second), labels = dataset[:]
    assert labels.tolist() == found.preferences.tolist()
    for one, other, pair in zip(first, second, found.pairs, strict=True):
        assert one.rews.tolist() == pair[0].rews.tolist()
        assert other.rews.tolist() == pair[1].rews.tolist()


def test_a_dataset_of_minari_holds_the_episodes_and_their_environment(tmp_path: Path) -> None:
    minari = pytest.importorskip("minari")
    pytest.importorskip("h5py")
    done = Done("demos", "Branching?L=4", "-n", 5, "-o", tmp_path / "branching-v0", "--format", "minari")
    assert done.status == 0, done.err
    dataset = minari.MinariDataset(tmp_path / "branching-v0" / "data")
    assert (dataset.total_episodes, dataset.total_steps) == (5, 20)
    env = dataset.recover_environment()
    for episode in dataset.iterate_episodes():
        seen, _ = env.reset(seed=int(episode.id))
        assert seen == episode.observations[0]
        seen, rewards, _, truncated, _ = zip(*map(env.step, episode.actions), strict=True)
        assert np.array_equal(seen, episode.observations[1:])
        assert np.array_equal(rewards, episode.rewards) and truncated[-1] == episode.truncations[-1]
