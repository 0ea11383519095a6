import numpy as np
from imitation.algorithms.bc import BC
from imitation.data import serialize

import taskspec
from taskspec.data import demonstrations, write
from taskspec.exact import score

task = taskspec.load("NoisyObs?L=5")
write(demonstrations(task, episodes=300, seed=1), "shown", "imitation")
learner = BC(
    observation_space=task.observation_space,
    action_space=task.action_space,
    rng=np.random.default_rng(0),
    demonstrations=serialize.load("shown"),
    batch_size=64,
    optimizer_kwargs={"lr": 1e-2},
)
learner.train(n_epochs=6, progress_bar=False)
print("cloned", score(task, learner.policy, deterministic=True).normalised)
