import numpy as np
import torch
from gymnasium.wrappers import DtypeObservation, FlattenObservation
from tensordict.nn import TensorDictSequential
from torchrl.collectors import Collector
from torchrl.data import ReplayBuffer
from torchrl.envs import GymWrapper
from torchrl.modules import MLP, EGreedyModule, QValueActor
from torchrl.objectives import DQNLoss

from taskspec.exam import Case, Learned, learns_from


@learns_from("reward")
def train(case: Case) -> Learned:
    env = GymWrapper(DtypeObservation(FlattenObservation(case.env()), np.float32))
    net = MLP(case.observation_space.n, case.action_space.n, num_cells=[64])
    actor = QValueActor(net, in_keys=["observation"], spec=env.action_spec)
    explorer = TensorDictSequential(actor, EGreedyModule(env.action_spec, eps_init=0.3, eps_end=0.3))
    loss = DQNLoss(actor, action_space="one-hot")
    loss.make_value_estimator(gamma=0.9)
    adam, buffer = torch.optim.Adam(net.parameters(), 3e-3), ReplayBuffer(batch_size=64)
    for steps in Collector(env, explorer, frames_per_batch=10, total_frames=case.steps // 10 * 10):
        buffer.extend(steps)
        adam.zero_grad(), loss(buffer.sample())["loss"].backward(), adam.step()
    return Learned(net(torch.eye(case.observation_space.n)).detach().numpy(), discount=0.9)
