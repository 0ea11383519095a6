import torch

import taskspec
from taskspec.exact import score

torch.manual_seed(0)
envs = taskspec.make_vec("RiskyPath", num_envs=32, backend="numpy", autoreset_mode="SameStep")
logits = torch.zeros(4, 2, requires_grad=True)
optimizer = torch.optim.Adam([logits], lr=0.05)
seen = envs.reset(seed=0)[0]
for _ in range(300):
    log_probs, rewards = [], []
    for _ in range(5):
        policy = torch.distributions.Categorical(logits=logits[torch.as_tensor(seen)])
        actions = policy.sample()
        seen, reward = envs.step(actions.numpy())[:2]
        log_probs.append(policy.log_prob(actions))
        rewards.append(torch.as_tensor(reward))
    to_go = torch.stack(rewards).flip(0).cumsum(0).flip(0)
    loss = -(torch.stack(log_probs) * (to_go - to_go.mean(1, keepdim=True)) / 10).mean()
    optimizer.zero_grad(), loss.backward(), optimizer.step()
print("REINFORCE", score("RiskyPath", logits.softmax(1).T.detach()).normalised)
