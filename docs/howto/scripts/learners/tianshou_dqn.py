import numpy as np
from gymnasium.wrappers import FlattenObservation
from tianshou.algorithm import DQN
from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.trainer import OffPolicyTrainerParams
from tianshou.utils.net.common import Net

from taskspec.exam import Case, Learned, learns_from


@learns_from("reward")
def train(case: Case) -> Learned:
    env = FlattenObservation(case.env())
    net = Net(state_shape=env.observation_space.shape, action_shape=env.action_space.n, hidden_sizes=[64])
    policy = DiscreteQLearningPolicy(model=net, action_space=env.action_space, eps_training=0.3)
    dqn = DQN(policy=policy, optim=AdamOptimizerFactory(lr=3e-3), gamma=0.9, target_update_freq=50)
    collector = Collector(dqn, DummyVectorEnv([lambda: env]), VectorReplayBuffer(case.steps, 1))
    collector.reset()
    lengths = {"max_epochs": 1, "epoch_num_steps": case.steps, "collection_step_num_env_steps": 10}
    quiet = {"verbose": False, "show_progress": False}
    dqn.run_training(OffPolicyTrainerParams(training_collector=collector, **lengths, **quiet))
    return Learned(net(np.eye(case.observation_space.n))[0].detach().numpy(), discount=0.9)
