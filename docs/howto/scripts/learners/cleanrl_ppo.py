"""PPO in one file, in the form of CleanRL: for finite actions, and finite or boxed observations."""

import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

from taskspec.exam import Case, Learned, learns_from

LANES, STEPS, EPOCHS, BATCH = 8, 32, 4, 64
GAMMA, LAMBDA, CLIP, ENTROPY = 0.99, 0.95, 0.2, 0.01


@learns_from("reward")
def train(case: Case) -> Learned:
    torch.manual_seed(case.seed)
    envs = case.make_vec(LANES, autoreset_mode="SameStep")
    space, actions = case.observation_space, case.action_space.n

    def encoded(obs: object) -> torch.Tensor:
        rows = torch.as_tensor(np.asarray(obs))
        return nn.functional.one_hot(rows, space.n).float() if hasattr(space, "n") else rows.float().flatten(1)

    width = encoded(envs.reset()[0]).shape[1]
    actor = nn.Sequential(nn.Linear(width, 64), nn.Tanh(), nn.Linear(64, actions))
    critic = nn.Sequential(nn.Linear(width, 64), nn.Tanh(), nn.Linear(64, 1), nn.Flatten(0))
    optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters()], lr=3e-3)
    x = encoded(envs.reset()[0])
    for _ in range(case.steps // (LANES * STEPS)):
        rows = []
        for _ in range(STEPS):
            with torch.no_grad():
                policy = Categorical(logits=actor(x))
                action = policy.sample()
                obs, reward, ended, cut, infos = envs.step(action.numpy())
                after = np.array(obs)
                for lane in np.flatnonzero(ended | cut):  # the next episode has begun: this one's last observation
                    after[lane] = infos["final_obs"][lane]
                v, v_after = critic(x), critic(encoded(after))
            rows.append((x, action, policy.log_prob(action), torch.as_tensor(reward).float(), ended, cut, v, v_after))
            x = encoded(obs)
        xs, acts, logs, rewards, ends, cuts, values, nexts = (
            torch.stack([torch.as_tensor(cell) for cell in column]) for column in zip(*rows, strict=True)
        )
        deltas = rewards + GAMMA * nexts * ~ends - values
        advantages, last = torch.zeros_like(deltas), torch.zeros(LANES)
        for t in reversed(range(STEPS)):
            advantages[t] = last = deltas[t] + GAMMA * LAMBDA * ~(ends[t] | cuts[t]) * last
        xs, acts, logs, advantages, values = (part.flatten(0, 1) for part in (xs, acts, logs, advantages, values))
        returns = advantages + values
        for _ in range(EPOCHS):
            for batch in torch.randperm(len(xs)).split(BATCH):
                policy, A = Categorical(logits=actor(xs[batch])), advantages[batch]
                A = (A - A.mean()) / (A.std() + 1e-8)
                ratio = (policy.log_prob(acts[batch]) - logs[batch]).exp()
                gain = (
                    torch.min(ratio * A, ratio.clamp(1 - CLIP, 1 + CLIP) * A).mean() + ENTROPY * policy.entropy().mean()
                )
                loss = 0.25 * ((critic(xs[batch]) - returns[batch]) ** 2).mean() - gain
                optimizer.zero_grad(), loss.backward(), optimizer.step()

    class Policy:
        def probabilities(self, obs: np.ndarray) -> np.ndarray:
            with torch.no_grad():
                return actor(encoded(obs)).softmax(1).numpy()

    return Learned(Policy(), values=lambda obs: critic(encoded(obs)).detach().numpy(), discount=GAMMA)
