"""Learners of Stable-Baselines3 and imitation, with the settings of the files beside this one."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import gymnasium
import numpy as np

from taskspec.exam import Case, learns_from
from taskspec.learn.learners import learner
from taskspec.learn.learners.paper_settings import Adversarial, Cloning, Ppo

SETTINGS = Path(__file__).parent / "settings"
T = TypeVar("T")
POINTS = 10
"""Of a learning curve."""


class Ending(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Nothing follows the end of an episode, whatever ended it: our learners take it so, theirs would ask the critic."""

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        seen, reward, terminated, truncated, info = self.env.step(action)
        return seen, reward, terminated or truncated, False, info


@learns_from("reward")
def ppo(case: Case) -> Any:
    config = _settings("ppo", Ppo)
    model = _ppo(config, case)
    each = config.experience.steps * config.experience.lanes
    shown = Shown(case, model.policy, case.steps // each)
    model.learn(case.steps // each * each, callback=shown.callback())
    return model.policy


@learns_from("demonstrations")
def bc(case: Case) -> Any:
    import torch
    from imitation.algorithms.bc import BC
    from stable_baselines3.common.policies import ActorCriticPolicy

    torch.set_num_threads(1)  # several processes train side by side
    torch.manual_seed(case.seed)
    config = _settings("bc", Cloning)
    policy = ActorCriticPolicy(
        case.observation_space, case.action_space, lambda _: config.learning_rate, net_arch=list(config.hidden)
    )
    found = BC(
        observation_space=case.observation_space, action_space=case.action_space, policy=policy,
        rng=np.random.default_rng(case.seed), demonstrations=case.demonstrations.imitation(), batch_size=config.batch,
        optimizer_kwargs={"lr": config.learning_rate}, ent_weight=0.0,
    )  # fmt: skip
    found.train(n_epochs=config.epochs, progress_bar=False, log_interval=10**9)
    return found.policy


@learns_from("demonstrations")
def gail(case: Case) -> Any:
    from imitation.algorithms.adversarial.gail import GAIL
    from imitation.rewards.reward_nets import BasicRewardNet

    config = _settings("gail", Adversarial)
    assert isinstance(config.policy, Ppo)
    model = _ppo(config.policy, case)
    each = config.policy.experience.steps * config.policy.experience.lanes
    found = GAIL(
        demonstrations=case.demonstrations.imitation(), demo_batch_size=config.batch, venv=model.get_env(), gen_algo=model,
        reward_net=BasicRewardNet(case.observation_space, case.action_space, hid_sizes=config.reward.hidden),
        n_disc_updates_per_round=config.updates, disc_opt_kwargs={"lr": config.reward.learning_rate},
        gen_replay_buffer_capacity=config.kept, gen_train_timesteps=each, log_dir=None, allow_variable_horizon=True,
    )  # fmt: skip
    shown = Shown(case, model.policy, case.steps // each)
    found.train(case.steps // each * each, callback=lambda round_: shown.after(round_ + 1))
    return model.policy


class Shown:
    """Shows a policy as often as our learners do: after each tenth of its rounds, but the last."""

    def __init__(self, case: Case, policy: Any, rounds: int) -> None:
        self.case = case
        self.policy = policy
        self.rounds = rounds
        self.untrained = copy.deepcopy(policy)

    def after(self, rounds: int) -> None:
        if rounds % max(1, self.rounds // POINTS) == 0 and 0 < rounds < self.rounds:
            shown = copy.deepcopy(self.untrained)  # one that has acted holds tensors that cannot be copied
            shown.load_state_dict(self.policy.state_dict())
            self.case.show(shown)

    def callback(self) -> Any:
        from stable_baselines3.common.callbacks import BaseCallback

        after = self.after

        class Each(BaseCallback):
            done = 0

            def _on_step(self) -> bool:
                return True

            def _on_rollout_start(self) -> None:
                after(self.done)
                self.done += 1

        return Each()


def _ppo(config: Ppo, case: Case) -> Any:
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv

    torch.set_num_threads(1)
    torch.manual_seed(case.seed)  # for what an algorithm around it draws before this is made with its seed
    lanes = config.experience.lanes
    steps = config.experience.steps
    make: Callable[[], Any] = lambda: Ending(case.env())  # noqa: E731
    return PPO(
        "MlpPolicy", DummyVecEnv([make] * lanes), learning_rate=config.learning_rate, n_steps=steps,
        batch_size=steps * lanes // config.minibatches, n_epochs=config.epochs, gamma=config.discount,
        gae_lambda=config.gae_lambda, clip_range=config.clip, clip_range_vf=config.value_clip, ent_coef=config.entropy,
        vf_coef=config.value_weight / 2, max_grad_norm=config.gradient_norm,
        policy_kwargs={"net_arch": list(config.hidden)}, seed=case.seed, device="cpu",
    )  # fmt: skip


def _settings(name: str, kind: type[T]) -> T:
    found = learner(SETTINGS / f"{name}.yaml").settings
    assert isinstance(found, kind)
    return found
