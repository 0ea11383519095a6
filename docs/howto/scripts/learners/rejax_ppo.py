import jax
import numpy as np
from rejax import PPO

from taskspec.exam import Case, learns_from
from taskspec.programs.jax import Functional
from taskspec.programs.jax.functions import Gymnax


class OneDone(Gymnax):  # rejax 0.1.3 reads the steps of older gymnax, with one `done`
    def step(self, *given: object) -> tuple[object, ...]:
        obs, state, reward, terminated, truncated, info = super().step(*given)
        return obs, state, reward, terminated | truncated, info


@learns_from("reward")
def train(case: Case) -> np.ndarray:
    steps = case.steps // 256 * 256
    settings = {"num_envs": 8, "num_steps": 32, "num_minibatches": 4, "learning_rate": 3e-3, "eval_freq": steps}
    ppo = PPO.create(env=OneDone(Functional(case.task)), total_timesteps=steps, **settings)
    learned, _ = ppo.train(jax.random.key(case.seed))
    case.count(int(learned.global_step))
    every = np.arange(case.observation_space.n)[:, None]
    return np.asarray(ppo.actor.apply(learned.actor_ts.params, every, method="_action_dist").probs)
