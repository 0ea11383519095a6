"""DQN of skrl 1.4 and of skrl 2, on a table of Q-values."""

import skrl
import torch
from skrl.agents.torch.dqn import DQN
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, Model
from skrl.trainers.torch import SequentialTrainer

from taskspec.exam import Case, Learned, learns_from

NEW = skrl.__version__ >= "2"
GAMMA = 0.8


class Table(DeterministicMixin, Model):
    def __init__(self, observations, actions):
        if NEW:
            Model.__init__(self, observation_space=observations, action_space=actions, device="cpu")
            DeterministicMixin.__init__(self)
        else:
            Model.__init__(self, observations, actions, "cpu")
            DeterministicMixin.__init__(self)
        self.values = torch.nn.Parameter(torch.zeros(observations.n, actions.n))

    def compute(self, inputs, role=""):
        obs = inputs["observations" if NEW else "states"]
        return self.values[obs.long().reshape(-1)], {}


@learns_from("reward")
def train(case: Case) -> Learned:
    torch.manual_seed(case.seed)
    env = wrap_env(case.env(), wrapper="gymnasium", verbose=False)
    net = Table(case.observation_space, case.action_space)
    target = Table(case.observation_space, case.action_space)
    memory = RandomMemory(memory_size=2000, device="cpu")
    common = {"discount_factor": GAMMA, "learning_rate": 2e-2, "batch_size": 64, "learning_starts": 100}
    if NEW:
        from skrl.agents.torch.dqn import DQN_CFG

        cfg = DQN_CFG(**common, polyak=0.1)
        cfg.experiment.write_interval = 0
        cfg.experiment.checkpoint_interval = 0
        cfg.exploration_scheduler = lambda timestep, timesteps: 0.5
        agent = DQN(
            models={"q_network": net, "target_q_network": target},
            memory=memory,
            cfg=cfg,
            observation_space=case.observation_space,
            action_space=case.action_space,
            device="cpu",
        )
    else:
        from skrl.agents.torch.dqn import DQN_DEFAULT_CONFIG

        cfg = {
            **DQN_DEFAULT_CONFIG,
            **common,
            "polyak": 0.1,
            "exploration": {"initial_epsilon": 0.5, "final_epsilon": 0.5, "timesteps": 1},
            "experiment": {
                "write_interval": 0,
                "checkpoint_interval": 0,
                "directory": "",
                "experiment_name": "",
                "wandb": False,
            },
        }
        agent = DQN(
            models={"q_network": net, "target_q_network": target},
            memory=memory,
            cfg=cfg,
            observation_space=case.observation_space,
            action_space=case.action_space,
            device="cpu",
        )
    SequentialTrainer(
        env=env, agents=agent, cfg={"timesteps": case.steps, "headless": True, "disable_progressbar": True}
    ).train()
    return Learned(net.values.detach().numpy(), discount=GAMMA)
