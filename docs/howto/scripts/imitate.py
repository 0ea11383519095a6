from tempfile import mkdtemp

import numpy as np
from imitation.algorithms.bc import BC
from imitation.algorithms.dagger import SimpleDAggerTrainer
from imitation.data import rollout
from imitation.data.wrappers import RolloutInfoWrapper
from imitation.util.util import make_vec_env

from taskspec.envs.sb3 import Sb3Expert
from taskspec.exact import score

rng, expert = np.random.default_rng(0), Sb3Expert("RiskyPath")
venv = make_vec_env("derail/RiskyPath-v0", rng=rng, post_wrappers=[lambda env, _: RolloutInfoWrapper(env)])
shown = rollout.rollout(expert, venv, rollout.make_min_episodes(50), rng=rng)
learner = BC(observation_space=venv.observation_space, action_space=venv.action_space, rng=rng, demonstrations=shown)
learner.train(n_batches=300, progress_bar=False)
print("cloned", score("RiskyPath", learner.policy).normalised)
trainer = SimpleDAggerTrainer(venv=venv, scratch_dir=mkdtemp(), expert_policy=expert, bc_trainer=learner, rng=rng)
trainer.train(60, rollout_round_min_timesteps=60, bc_train_kwargs={"n_batches": 100, "progress_bar": False})
print("DAgger", score("RiskyPath", learner.policy).normalised)
