"""Right learners with networks of PyTorch, as CleanRL writes them: an exam may not accuse any of them.

Each learns in lanes that begin anew by themselves, from one-hot observations, and returns tables of all observations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from taskspec.exam import Case, Learned, learns_from

torch.set_num_threads(1)


def network(case: Case, outputs: int, hidden: int = 32) -> nn.Sequential:
    """Return a network of one-hot observations (N, O) that returns (N, outputs)."""
    return nn.Sequential(nn.Linear(case.observation_space.n, hidden), nn.Tanh(), nn.Linear(hidden, outputs))


def play(env: Any, actions: Any) -> tuple[Any, ...]:
    """Return what a step of all lanes leads to, its rewards, ends and truncations, and the observations to go on from."""
    obs, rewards, terminated, truncated, told = env.step(actions)
    reached = np.array(obs)
    over = terminated | truncated
    if over.any():
        reached[over] = np.array([told["final_obs"][lane] for lane in np.flatnonzero(over)])
    return reached, np.array(rewards), np.array(terminated), np.array(truncated), np.array(obs)


@learns_from("reward")
def ppo(case: Case) -> Learned:
    """Schulman et al. (2017): clipped ratios, generalised advantages, several epochs of minibatches."""
    lanes = 16
    length = 32
    gamma = 0.95
    decay = 0.95
    torch.manual_seed(case.seed)
    rng = np.random.default_rng(case.seed)
    one_hot = torch.eye(case.observation_space.n)
    actor = network(case, case.action_space.n)
    critic = network(case, 1)
    optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters()], lr=0.01)
    env = case.make_vec(lanes, backend="numpy", autoreset_mode="SameStep")
    seen = np.array(env.reset()[0])
    for _ in range(case.steps // (lanes * length)):
        obs = torch.zeros(length, lanes, dtype=torch.long)
        acts = torch.zeros(length, lanes, dtype=torch.long)
        logprobs = torch.zeros(length, lanes)
        rewards = torch.zeros(length, lanes)
        terminated = torch.zeros(length, lanes)
        over = torch.zeros(length, lanes)
        reached = torch.zeros(length, lanes, dtype=torch.long)
        for t in range(length):
            obs[t] = torch.as_tensor(seen)
            with torch.no_grad():
                choice = torch.distributions.Categorical(logits=actor(one_hot[obs[t]]))
                acts[t] = choice.sample()
                logprobs[t] = choice.log_prob(acts[t])
            next_obs, paid, ends, cuts, seen = play(env, acts[t].numpy())
            reached[t] = torch.as_tensor(next_obs)
            rewards[t] = torch.as_tensor(paid)
            terminated[t] = torch.as_tensor(ends)
            over[t] = torch.as_tensor(ends | cuts)
        with torch.no_grad():
            values = critic(one_hot[obs]).squeeze(-1)
            next_values = critic(one_hot[reached]).squeeze(-1)
            advantages = torch.zeros(length, lanes)
            later = torch.zeros(lanes)
            for t in reversed(range(length)):
                delta = rewards[t] + gamma * next_values[t] * (1 - terminated[t]) - values[t]
                later = delta + gamma * decay * (1 - over[t]) * later
                advantages[t] = later
            returns = advantages + values
        b_obs = obs.reshape(-1)
        b_acts = acts.reshape(-1)
        b_logprobs = logprobs.reshape(-1)
        b_advantages = advantages.reshape(-1)
        b_returns = returns.reshape(-1)
        for _ in range(4):
            order = torch.as_tensor(rng.permutation(lanes * length))
            for part in order.chunk(4):
                choice = torch.distributions.Categorical(logits=actor(one_hot[b_obs[part]]))
                ratio = (choice.log_prob(b_acts[part]) - b_logprobs[part]).exp()
                gains = b_advantages[part]
                gains = (gains - gains.mean()) / (gains.std() + 1e-8)
                policy_loss = torch.max(-gains * ratio, -gains * ratio.clamp(0.8, 1.2)).mean()
                new_values = critic(one_hot[b_obs[part]]).squeeze(-1)
                value_loss = 0.5 * ((new_values - b_returns[part]) ** 2).mean()
                loss = policy_loss - 0.01 * choice.entropy().mean() + 0.5 * value_loss
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters()], 5.0)
                optimizer.step()
    with torch.no_grad():
        pi = actor(one_hot).softmax(-1).numpy()
        v = critic(one_hot).squeeze(-1).numpy()
    return Learned(pi, values=v, discount=gamma)


@learns_from("reward")
def dqn(case: Case) -> Learned:
    """Mnih et al. (2015): a buffer of all steps, and a target network that follows slowly."""
    lanes = 8
    gamma = 0.95
    torch.manual_seed(case.seed)
    rng = np.random.default_rng(case.seed)
    one_hot = torch.eye(case.observation_space.n)
    q_network = network(case, case.action_space.n)
    target_network = network(case, case.action_space.n)
    target_network.load_state_dict(q_network.state_dict())
    optimizer = torch.optim.Adam(q_network.parameters(), lr=0.005)
    env = case.make_vec(lanes, backend="numpy", autoreset_mode="SameStep")
    size = case.steps // lanes * lanes
    b_obs = np.zeros(size, int)
    b_acts = np.zeros(size, int)
    b_rewards = np.zeros(size, np.float32)
    b_next = np.zeros(size, int)
    b_done = np.zeros(size, np.float32)
    obs = np.array(env.reset()[0])
    for step in range(case.steps // lanes):
        epsilon = max(0.1, 1 - 2 * step * lanes / case.steps)
        with torch.no_grad():
            actions = q_network(one_hot[obs]).argmax(-1).numpy()
        explores = rng.random(lanes) < epsilon
        actions[explores] = rng.integers(case.action_space.n, size=explores.sum())
        next_obs, rewards, terminated, truncated, following = play(env, actions)  # noqa: RUF059
        rows = slice(step * lanes, (step + 1) * lanes)
        b_obs[rows] = obs
        b_acts[rows] = actions
        b_rewards[rows] = rewards
        b_next[rows] = next_obs
        b_done[rows] = terminated
        obs = following
        picked = rng.integers((step + 1) * lanes, size=64)
        with torch.no_grad():
            best = target_network(one_hot[b_next[picked]]).max(-1).values
            target = torch.as_tensor(b_rewards[picked]) + gamma * best * (1 - torch.as_tensor(b_done[picked]))
        taken = q_network(one_hot[b_obs[picked]])[torch.arange(64), torch.as_tensor(b_acts[picked])]
        loss = functional.mse_loss(taken, target)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if step % 20 == 0:
            for old, new in zip(target_network.parameters(), q_network.parameters(), strict=True):
                old.data.copy_(new.data)
    with torch.no_grad():
        q = q_network(one_hot).numpy()
    return Learned(q, discount=gamma)


@learns_from("reward")
def a2c(case: Case) -> Learned:
    """Mnih et al. (2016): n-step returns, one update of actor and critic for each batch, on one trunk."""
    lanes = 8
    length = 5
    gamma = 0.95
    torch.manual_seed(case.seed)
    one_hot = torch.eye(case.observation_space.n)
    trunk = nn.Sequential(nn.Linear(case.observation_space.n, 32), nn.Tanh())
    actor = nn.Linear(32, case.action_space.n)
    critic = nn.Linear(32, 1)
    parameters = [*trunk.parameters(), *actor.parameters(), *critic.parameters()]
    optimizer = torch.optim.RMSprop(parameters, lr=0.005, eps=1e-5)
    env = case.make_vec(lanes, backend="numpy", autoreset_mode="SameStep")
    obs = np.array(env.reset()[0])
    for _ in range(case.steps // (lanes * length)):
        batch = []
        for _ in range(length):
            logits = actor(trunk(one_hot[obs])).detach()
            actions = torch.distributions.Categorical(logits=logits).sample().numpy()
            next_obs, rewards, terminated, truncated, following = play(env, actions)
            batch.append((obs, actions, rewards, terminated, truncated, next_obs))
            obs = following
        with torch.no_grad():
            later = critic(trunk(one_hot[batch[-1][5]])).squeeze(-1).numpy()
            returns = []
            for _, _, rewards, terminated, truncated, next_obs in reversed(batch):
                v_next = critic(trunk(one_hot[next_obs])).squeeze(-1).numpy()
                later = np.where(truncated, v_next, later)
                later = rewards + gamma * (1 - terminated) * later
                returns.append(later)
        targets = torch.as_tensor(np.concatenate(returns[::-1]), dtype=torch.float32)
        seen = one_hot[np.concatenate([step[0] for step in batch])]
        taken = torch.as_tensor(np.concatenate([step[1] for step in batch]))
        features = trunk(seen)
        values = critic(features).squeeze(-1)
        choice = torch.distributions.Categorical(logits=actor(features))
        advantages = (targets - values).detach()
        policy_loss = -(advantages * choice.log_prob(taken)).mean()
        value_loss = ((targets - values) ** 2).mean()
        loss = policy_loss + 0.5 * value_loss - 0.01 * choice.entropy().mean()
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(parameters, 5.0)
        optimizer.step()
    with torch.no_grad():
        pi = actor(trunk(one_hot)).softmax(-1).numpy()
        v = critic(trunk(one_hot)).squeeze(-1).numpy()
    return Learned(pi, values=v, discount=gamma)


DEEP = {f"torch_{each.__name__}": each for each in (ppo, dqn, a2c)}
"""The learners by name."""
