from collections.abc import Iterable

import numpy as np
from imitation.algorithms import preference_comparisons as comparisons
from imitation.rewards.reward_nets import BasicRewardNet
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

from taskspec.exam import Case, examine, learns_from


@learns_from("preferences")
def train(case: Case) -> PPO:
    def teacher(pairs: Iterable[tuple[object, object]]) -> np.ndarray:
        return np.array([case.prefer(first, second) for first, second in pairs], np.float32)

    rng, lanes = np.random.default_rng(case.seed), DummyVecEnv([case.env] * 4)
    policy = PPO("MlpPolicy", lanes, n_steps=64, batch_size=64, learning_rate=3e-3, seed=case.seed, device="cpu")
    reward = BasicRewardNet(case.observation_space, case.action_space)
    loss, model = comparisons.CrossEntropyRewardLoss(), comparisons.PreferenceModel(reward)
    actor = comparisons.AgentTrainer(policy, reward, lanes, rng)
    learner = comparisons.PreferenceComparisons(
        actor, reward, num_iterations=5, fragment_length=2, initial_epoch_multiplier=5, allow_variable_horizon=True, rng=rng,
        reward_trainer=comparisons.BasicRewardTrainer(model, loss, rng, epochs=10), preference_gatherer=teacher,
    )  # fmt: skip
    learner.train(case.steps // 2, 200)  # what is compared are steps of the environment as well
    return policy


if __name__ == "__main__":
    found = examine(train, tasks=["RiskyPath"], seeds=1, steps=12_000, twins=0)
    print("compared", found["scores"][0]["deterministic"])
