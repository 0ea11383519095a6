from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.vec_env import DummyVecEnv

from taskspec.exam import Case, learns_from

COMMON = {"policy": "MlpPolicy", "learning_rate": 3e-3, "device": "cpu"}


@learns_from("reward")
def ppo(case: Case) -> PPO:
    lanes = DummyVecEnv([case.env] * 8)
    return PPO(env=lanes, n_steps=25, batch_size=200, seed=case.seed, **COMMON).learn(case.steps // 200 * 200)


@learns_from("reward")
def dqn(case: Case) -> DQN:
    exploring = {"learning_starts": 100, "exploration_final_eps": 0.3, "target_update_interval": 100}
    return DQN(env=case.env(), seed=case.seed, **exploring, **COMMON).learn(case.steps)


@learns_from("reward")
def a2c(case: Case) -> A2C:
    return A2C(env=case.env(), n_steps=20, seed=case.seed, **COMMON).learn(case.steps)
