from imitation.algorithms.adversarial.airl import AIRL
from imitation.algorithms.adversarial.gail import GAIL
from imitation.rewards.reward_nets import BasicRewardNet
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

from taskspec.exam import Case, examine


def train(case: Case, algorithm: type = GAIL) -> PPO:
    lanes, reward = DummyVecEnv([case.env] * 4), BasicRewardNet(case.observation_space, case.action_space)
    policy = PPO("MlpPolicy", lanes, n_steps=128, batch_size=128, learning_rate=1e-3, seed=case.seed, device="cpu")
    shown = {"demonstrations": case.demonstrations.imitation(), "demo_batch_size": 128, "n_disc_updates_per_round": 8}
    learner = algorithm(venv=lanes, gen_algo=policy, reward_net=reward, allow_variable_horizon=True, **shown)
    learner.train(case.steps // 512 * 512)
    return policy


if __name__ == "__main__":
    for name, learner in {"GAIL": train, "AIRL": lambda case: train(case, AIRL)}.items():
        given = {"steps": 20_000, "transitions": 2000, "learns_from": ["demonstrations"]}
        found = examine(learner, tasks=["RiskyPath"], seeds=1, twins=0, **given)
        print(name, found["scores"][0]["deterministic"])
