from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

from taskspec.exam import Case, examine, learns_from


@learns_from("reward")
def train(case: Case) -> PPO:
    lanes = DummyVecEnv([case.env] * 8)
    model = PPO("MlpPolicy", lanes, n_steps=25, batch_size=200, learning_rate=3e-3, seed=case.seed, device="cpu")
    return model.learn(case.steps // 200 * 200)


if __name__ == "__main__":
    found = examine(train, tasks=["EarlyTermNeg"], seeds=1, steps=3000, twins=1)
    print("PPO", min(score["deterministic"] or 0.0 for score in found["scores"]))
