"""Right learners from demonstrations and preferences: an exam may not accuse any of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from

Array = np.ndarray[Any, Any]


def softmax(logits: Array) -> Array:
    """Return probabilities of actions (..., A)."""
    powers = np.exp(logits - logits.max(axis=-1, keepdims=True))
    pi: Array = powers / powers.sum(axis=-1, keepdims=True)
    return pi


def sigmoid(x: Array) -> Array:
    """Return 1 / (1 + exp(-x))."""
    y: Array = 1 / (1 + np.exp(-x))
    return y


class Player:
    """An environment that goes on from batch to batch."""

    def __init__(self, case: Case) -> None:
        self.env = case.env()
        self.rng = np.random.default_rng((case.seed, 3))
        self.seen, _ = self.env.reset()

    def play(self, pi: Array, length: int) -> list[tuple[int, int, int, bool, bool]]:
        """Return observation, action, next observation, end and truncation of each step."""
        batch = []
        for _ in range(length):
            a = int(self.rng.choice(pi.shape[1], p=pi[self.seen]))
            s_next, _, terminated, truncated, _ = self.env.step(a)
            batch.append((self.seen, a, s_next, terminated, truncated))
            self.seen = s_next
            if terminated or truncated:
                self.seen, _ = self.env.reset()
        return batch


@learns_from("demonstrations")
def bc(case: Case) -> Array:
    """Cloning: cross-entropy of demonstrated actions, by minibatches."""
    shown = case.demonstrations
    rng = np.random.default_rng(case.seed)
    logits = np.zeros((case.observation_space.n, case.action_space.n))
    obs = np.asarray(shown.obs).reshape(-1)
    acts = np.asarray(shown.acts).reshape(-1)
    for _ in range(500):
        picked = rng.integers(len(obs), size=64)
        s = obs[picked]
        slope = -softmax(logits[s])
        slope[np.arange(len(s)), acts[picked]] += 1.0
        np.add.at(logits, s, 0.05 * slope)
    return softmax(logits)


@learns_from("demonstrations")
def gail(case: Case) -> Array:
    """Ho and Ermon (2016), with an actor-critic, and -log(1 - D) + log D, which is of either sign."""
    gamma = 0.95
    shown = case.demonstrations
    expert_obs = np.asarray(shown.obs).reshape(-1)
    expert_acts = np.asarray(shown.acts).reshape(-1)
    player = Player(case)
    theta = np.zeros((case.observation_space.n, case.action_space.n))
    v = np.zeros(len(theta))
    logits = np.zeros_like(theta)
    for _ in range(case.steps // 100):
        pi = softmax(theta)
        batch = player.play(pi, 100)
        obs = np.array([step[0] for step in batch])
        acts = np.array([step[1] for step in batch])
        for _ in range(5):
            picked = player.rng.integers(len(expert_obs), size=100)
            real = 1 - sigmoid(logits[expert_obs[picked], expert_acts[picked]])
            fake = sigmoid(logits[obs, acts])
            np.add.at(logits, (expert_obs[picked], expert_acts[picked]), 0.02 * real)
            np.add.at(logits, (obs, acts), -0.02 * fake)
            logits *= 0.999
        paid = logits[obs, acts]
        later = 0.0
        for t in reversed(range(len(batch))):
            s, a, s_next, terminated, truncated = batch[t]
            error = paid[t] + gamma * (1 - terminated) * v[s_next] - v[s]
            later = error + gamma * 0.9 * (1 - (terminated or truncated)) * later
            v[s] += 0.05 * later
            theta[s] -= 0.05 * later * pi[s]
            theta[s, a] += 0.05 * later
    return softmax(theta)


@learns_from("demonstrations")
def airl(case: Case) -> Learned:
    """Fu et al. (2018): f = g(s, a) + gamma h(s') - h(s), D = exp f / (exp f + pi), and f - log pi is paid."""
    gamma = 0.95
    shown = case.demonstrations
    expert_obs = np.asarray(shown.obs).reshape(-1)
    expert_acts = np.asarray(shown.acts).reshape(-1)
    expert_next = np.asarray(shown.next_obs).reshape(-1)
    expert_ends = np.asarray(shown.dones).reshape(-1).astype(float)
    player = Player(case)
    theta = np.zeros((case.observation_space.n, case.action_space.n))
    v = np.zeros(len(theta))
    g = np.zeros_like(theta)
    h = np.zeros(len(theta))
    for _ in range(case.steps // 100):
        pi = softmax(theta)
        batch = player.play(pi, 100)
        obs = np.array([step[0] for step in batch])
        acts = np.array([step[1] for step in batch])
        after = np.array([step[2] for step in batch])
        ends = np.array([float(step[3]) for step in batch])
        for _ in range(5):
            picked = player.rng.integers(len(expert_obs), size=100)
            both_obs = np.concatenate([expert_obs[picked], obs])
            both_acts = np.concatenate([expert_acts[picked], acts])
            both_after = np.concatenate([expert_next[picked], after])
            both_ends = np.concatenate([expert_ends[picked], ends])
            is_expert = np.repeat([1.0, 0.0], [len(picked), len(obs)])
            f = g[both_obs, both_acts] + gamma * (1 - both_ends) * h[both_after] - h[both_obs]
            chance = sigmoid(f - np.log(pi[both_obs, both_acts] + 1e-8))
            slope = 0.02 * (is_expert - chance)
            np.add.at(g, (both_obs, both_acts), slope)
            np.add.at(h, both_after, gamma * (1 - both_ends) * slope)
            np.add.at(h, both_obs, -slope)
        f = g[obs, acts] + gamma * (1 - ends) * h[after] - h[obs]
        paid = f - np.log(pi[obs, acts] + 1e-8)
        later = 0.0
        for t in reversed(range(len(batch))):
            s, a, s_next, terminated, truncated = batch[t]
            error = paid[t] + gamma * (1 - terminated) * v[s_next] - v[s]
            later = error + gamma * 0.9 * (1 - (terminated or truncated)) * later
            v[s] += 0.05 * later
            theta[s] -= 0.05 * later * pi[s]
            theta[s, a] += 0.05 * later
    return Learned(softmax(theta), lambda obs, acts, after: g[obs, acts])


@learns_from("demonstrations")
def maxent_irl(case: Case) -> Learned:
    """Ziebart (2010): visits of the soft best policy are brought to those of the expert, in a model of own random steps."""
    horizon = case.task.horizon
    shown = case.demonstrations
    states = case.observation_space.n
    actions = case.action_space.n
    player = Player(case)
    counts = np.zeros((states, actions, states + 1))
    for s, a, s_next, terminated, _ in player.play(np.full((states, actions), 1 / actions), case.steps):
        counts[s, a, states if terminated else s_next] += 1
    model = counts / np.maximum(counts.sum(axis=-1, keepdims=True), 1)
    episodes = [np.asarray(each.obs).reshape(-1) for each in shown.trajectories]
    choices = [np.asarray(each.acts).reshape(-1) for each in shown.trajectories]
    p0 = np.zeros(states)
    expert = np.zeros((states, actions))
    for obs, acts in zip(episodes, choices, strict=True):
        p0[obs[0]] += 1 / len(episodes)
        np.add.at(expert, (obs[: len(acts)], acts), 1 / len(episodes))
    w = np.zeros((states, actions))
    for step in range(200):
        v = np.zeros(states + 1)
        policies = []
        for _ in range(horizon):
            q = w + model @ v
            v = np.append(np.log(np.exp(q - q.max()).sum(axis=-1)) + q.max(), 0.0)
            policies.append(softmax(q))
        policies.reverse()
        d = p0
        visits = np.zeros((states, actions))
        for pi in policies:
            taken = d[:, None] * pi
            visits += taken
            d = np.einsum("sa,sat->t", taken, model)[:states]
        w += 0.5 / (1 + step) ** 0.5 * (expert - visits)
    return Learned(np.array(policies), lambda obs, acts, after: w[obs, acts])


@learns_from("preferences")
def preference_learner(case: Case) -> Learned:
    """Christiano et al. (2017): a reward by the Bradley-Terry model of pairs of episodes, then Q-learning on it."""
    gamma = 0.95
    rng = np.random.default_rng((case.seed, 5))
    states = case.observation_space.n
    actions = case.action_space.n
    env = case.env()
    steps = []
    episodes = []
    for _ in range(case.steps // (10 * case.task.horizon)):
        obs = [env.reset()[0]]
        acts = []
        is_over = False
        while not is_over:
            a = int(rng.integers(actions))
            s_next, _, terminated, truncated, _ = env.step(a)
            steps.append((obs[-1], a, s_next, terminated))
            obs.append(s_next)
            acts.append(a)
            is_over = terminated or truncated
        episodes.append(SimpleNamespace(obs=np.array(obs), acts=np.array(acts)))
    features = np.zeros((len(episodes), states, actions))
    for counts, episode in zip(features, episodes, strict=True):
        np.add.at(counts, (episode.obs[:-1], episode.acts), 1.0)
    pairs = rng.integers(len(episodes), size=(300, 2))
    labels = np.array([case.prefer(episodes[one], episodes[other]) for one, other in pairs])
    r = np.zeros((states, actions))
    for _ in range(1000):
        returns = (features * r).sum(axis=(1, 2))
        chance = sigmoid(returns[pairs[:, 0]] - returns[pairs[:, 1]])
        error = labels - chance
        slope = np.einsum("n,nsa->sa", error, features[pairs[:, 0]] - features[pairs[:, 1]])
        r += 0.02 * slope / len(pairs) ** 0.5 - 0.0002 * r
    q = np.zeros((states, actions))
    for _ in range(30_000):
        s, a, s_next, terminated = steps[int(rng.integers(len(steps)))]
        target = r[s, a] + gamma * (1 - terminated) * q[s_next].max()
        q[s, a] += 0.1 * (target - q[s, a])
    return Learned(q, lambda obs, acts, after: r[obs, acts])


IMITATORS = {each.__name__: each for each in (bc, gail, airl, maxent_irl, preference_learner)}
"""The learners by name."""
