import gymnasium as gym
import minari

from taskspec.exact import Expert

env = minari.DataCollector(gym.make("derail/Branching-v0"))
expert = Expert("derail/Branching-v0")
for seed in range(20):
    (seen, _), memory, over = env.reset(seed=seed), None, False
    while not over:
        action, memory = expert.predict(seen, memory)
        seen, _, terminated, truncated, _ = env.step(action)
        over = terminated or truncated
dataset = env.create_dataset("branching/expert-v0", algorithm_name="the expert of the spec")
print("returns", {float(sum(episode.rewards)) for episode in dataset.iterate_episodes()}, dataset.total_steps)
