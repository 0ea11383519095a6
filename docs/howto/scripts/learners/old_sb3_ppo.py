"""PPO of Stable-Baselines3 1.3 to 1.8, which know Gym and not Gymnasium: `gym` becomes another name of it."""

import sys
from types import ModuleType

import gymnasium

recorder = ModuleType("gym.wrappers.monitoring")
recorder.video_recorder = None
gymnasium.GoalEnv = gymnasium.Env
gymnasium.Wrapper.seed = lambda self, seed=None: [seed]
for name, module in list(sys.modules.items()):
    if name.partition(".")[0] == "gymnasium":
        sys.modules[name.replace("gymnasium", "gym", 1)] = module
sys.modules["gym.wrappers.monitoring"] = recorder

from stable_baselines3 import PPO  # noqa: E402

from taskspec.exam import Case, learns_from  # noqa: E402


class Old(gymnasium.Wrapper):
    """Steps as Gym 0.21 has them."""

    def reset(self):
        return self.env.reset()[0]

    def step(self, action):
        obs, reward, terminated, truncated, info = self.env.step(action)
        return obs, reward, terminated or truncated, info | {"TimeLimit.truncated": truncated and not terminated}


@learns_from("reward")
def train(case: Case) -> PPO:
    model = PPO(
        "MlpPolicy",
        Old(case.env()),
        gamma=0.9,
        learning_rate=3e-3,
        n_steps=500,
        batch_size=100,
        seed=case.seed,
        ent_coef=0.05,
        policy_kwargs={"net_arch": [{"pi": [32], "vf": [32]}]},
        device="cpu",
    )
    return model.learn(case.steps)
