import numpy as np
from imitation.algorithms.bc import BC

from taskspec.exam import Case, examine


def train(case: Case) -> object:
    learner = BC(
        observation_space=case.observation_space,
        action_space=case.action_space,
        rng=np.random.default_rng(case.seed),
        demonstrations=case.demonstrations.imitation(),
        optimizer_kwargs={"lr": 1e-2},
    )
    learner.train(n_epochs=2, progress_bar=False)
    return learner.policy


if __name__ == "__main__":
    found = examine(train, tasks=["EarlyTermPos"], seeds=1, transitions=2000, learns_from=["demonstrations"])
    print("cloned", np.mean([score["deterministic"] for score in found["scores"]]))
