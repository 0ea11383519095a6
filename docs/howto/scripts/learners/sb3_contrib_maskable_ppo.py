from sb3_contrib import MaskablePPO

from taskspec.exam import Case, learns_from


@learns_from("reward")
def train(case: Case) -> MaskablePPO:
    settings = {"n_steps": 500, "batch_size": 100, "gamma": 0.95, "seed": case.seed, "device": "cpu"}
    return MaskablePPO("MlpPolicy", case.env(), **settings).learn(case.steps)
