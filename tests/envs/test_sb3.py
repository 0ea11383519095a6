"""The adapter for Stable-Baselines3: its VecEnv contract, and the trajectories of the scalar environment."""

import numpy as np
import pytest

import taskspec

pytest.importorskip("stable_baselines3")

from taskspec.envs.sb3 import Sb3VecEnv


@pytest.mark.parametrize("name", ["derail/EarlyTermPos-v0", "derail/Sort-v0"])
def test_ends_are_described_as_sb3_expects(name: str) -> None:
    task = taskspec.load(name)
    env = Sb3VecEnv(task, 3, seed=5, backend="numpy")
    scalars = [taskspec.make(task) for _ in range(3)]
    seen = env.reset()
    for i, scalar in enumerate(scalars):
        assert np.array_equal(seen[i], scalar.reset(seed=5 + i)[0])
    env.action_space.seed(0)
    for _ in range(30):
        actions = np.array([env.action_space.sample() for _ in range(3)])
        seen, rewards, dones, infos = env.step(actions)
        for i, scalar in enumerate(scalars):
            expected, reward, terminated, truncated, _ = scalar.step(actions[i])
            assert rewards[i] == np.float32(reward)
            assert dones[i] == (terminated or truncated)
            if dones[i]:
                assert np.array_equal(infos[i]["terminal_observation"], expected)
                assert infos[i]["TimeLimit.truncated"] == (truncated and not terminated)
                expected, _ = scalar.reset()
            assert np.array_equal(seen[i], expected)


@pytest.mark.slow
def test_an_algorithm_learns_with_it() -> None:
    from stable_baselines3 import PPO

    env = Sb3VecEnv(taskspec.load("derail/EarlyTermNeg-v0"), 16, backend="numpy")
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=256, seed=0).learn(16 * 64 * 10)
    seen = env.reset()
    actions, _ = model.predict(seen, deterministic=True)
    assert env.step(actions)[0].shape == seen.shape
