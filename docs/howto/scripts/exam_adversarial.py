from imitation.algorithms.adversarial.airl import AIRL
from imitation.algorithms.adversarial.gail import GAIL
from imitation.rewards.reward_nets import BasicRewardNet
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

from taskspec.exam import Case, examine


def train(case: Case, algorithm: type = GAIL) -> PPO:
    lanes, reward = DummyVecEnv([case.env] * 4), BasicRewardNet(case.observation_space, case.action_space)
    policy = PPO("MlpPolicy", lanes, n_steps=128, batch_size=128, learning_rate=1e-3, seed=case.seed, device="cpu")
    learner = algorithm(
        demonstrations=case.demonstrations.imitation(), demo_batch_size=128, venv=lanes, gen_algo=policy,
        reward_net=reward, n_disc_updates_per_round=8, allow_variable_horizon=True,
    )  # fmt: skip
    learner.train(case.steps // 512 * 512)
    return policy


if __name__ == "__main__":
    for name, learner in {"GAIL": train, "AIRL": lambda case: train(case, AIRL)}.items():
        found = examine(learner, tasks=["RiskyPath"], seeds=1, steps=20_000, learns_from=["demonstrations"], twins=0)
        print(name, found["scores"][0]["deterministic"])
