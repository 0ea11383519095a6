from stable_baselines3 import PPO

from taskspec.envs.sb3 import Sb3VecEnv
from taskspec.exact import score

lanes = Sb3VecEnv("RiskyPath", 16, seed=0, backend="numpy")
model = PPO("MlpPolicy", lanes, n_steps=20, batch_size=80, learning_rate=3e-3, seed=0).learn(10_000)
print("PPO", score("RiskyPath", model, deterministic=True).normalised)
