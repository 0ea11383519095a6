import numpy as np
from imitation.algorithms.mce_irl import MCEIRL
from imitation.rewards.reward_nets import BasicRewardNet

import taskspec
from taskspec.data import demonstrations
from taskspec.exact import score

found = taskspec.data.tabular(taskspec.load("RiskyPath"))
shown = demonstrations("RiskyPath", "soft(1)", episodes=500)
seen = found.index(np.concatenate([t.obs for t in shown.trajectories]))
visits = np.bincount(seen, minlength=found.n_states) / 500
env = found.imitation()
net = BasicRewardNet(env.observation_space, env.action_space, use_action=False, hid_sizes=[])
learner = MCEIRL(visits, env, net, np.random.default_rng(0), optimizer_kwargs={"lr": 0.1})
learner.train(max_iter=300)
print("learnt", score("RiskyPath", learner.policy.pi.transpose(0, 2, 1)).normalised)
