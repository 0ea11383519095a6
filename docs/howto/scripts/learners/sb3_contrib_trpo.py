from sb3_contrib import TRPO

from taskspec.exam import Case, learns_from


@learns_from("reward")
def train(case: Case) -> TRPO:
    return TRPO("MlpPolicy", case.env(), n_steps=200, batch_size=100, seed=case.seed, device="cpu").learn(case.steps)
