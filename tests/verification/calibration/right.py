"""Right learners over tables, as textbooks have them: an exam may not accuse any of them.

Each returns what it learned with its discount. Values are those of Sutton and Barto (2018); the sections are named.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from

Array = np.ndarray[Any, Any]
Step = tuple[int, int, float]
"""Observation, action and reward."""


def begin(case: Case) -> tuple[Any, np.random.Generator, Array]:
    """Return the environment, a generator, and a table of zeros (O, A)."""
    env = case.env()
    q = np.zeros((case.observation_space.n, case.action_space.n))
    return env, np.random.default_rng(case.seed), q


def greedy(values: Array, epsilon: float, rng: np.random.Generator) -> int:
    """Return a best action, or a random one with probability epsilon."""
    if rng.random() < epsilon:
        return int(rng.integers(len(values)))
    return int((values + 1e-9 * rng.random(len(values))).argmax())


def softmax(logits: Array) -> Array:
    """Return probabilities of actions (..., A)."""
    powers = np.exp(logits - logits.max(axis=-1, keepdims=True))
    pi: Array = powers / powers.sum(axis=-1, keepdims=True)
    return pi


# -- one step ---------------------------------------------------------------------------------------------------------


@learns_from("reward")
def q_learning(case: Case) -> Learned:
    """Section 6.5."""
    gamma = 0.95
    env, rng, q = begin(case)
    s, _ = env.reset()
    for _ in range(case.steps):
        a = greedy(q[s], 0.2, rng)
        s_next, r, terminated, truncated, _ = env.step(a)
        target = r + gamma * (1 - terminated) * q[s_next].max()
        q[s, a] += 0.1 * (target - q[s, a])
        s = s_next
        if terminated or truncated:
            s, _ = env.reset()
    return Learned(q, discount=gamma)


@learns_from("reward")
def sarsa(case: Case) -> Learned:
    """Section 6.4."""
    gamma = 0.9
    env, rng, q = begin(case)
    s, _ = env.reset()
    a = greedy(q[s], 0.2, rng)
    for step in range(case.steps):
        rate = max(0.05, 0.5 * (1 - step / case.steps))
        s_next, r, terminated, truncated, _ = env.step(a)
        a_next = greedy(q[s_next], 0.2, rng)
        target = r + gamma * (1 - terminated) * q[s_next, a_next]
        q[s, a] += rate * (target - q[s, a])
        s = s_next
        a = a_next
        if terminated or truncated:
            s, _ = env.reset()
            a = greedy(q[s], 0.2, rng)
    return Learned(q, discount=gamma)


@learns_from("reward")
def expected_sarsa(case: Case) -> Learned:
    """Section 6.6."""
    gamma = 0.95
    epsilon = 0.3
    env, rng, q = begin(case)
    s, _ = env.reset()
    for _ in range(case.steps):
        a = greedy(q[s], epsilon, rng)
        s_next, r, terminated, truncated, _ = env.step(a)
        v_next = (1 - epsilon) * q[s_next].max() + epsilon * q[s_next].mean()
        q[s, a] += 0.2 * (r + gamma * (1 - terminated) * v_next - q[s, a])
        s = s_next
        if terminated or truncated:
            s, _ = env.reset()
    return Learned(q, discount=gamma)


@learns_from("reward")
def double_q(case: Case) -> Learned:
    """Section 6.7."""
    gamma = 0.9
    env, rng, q = begin(case)
    both = [q, np.zeros_like(q)]
    s, _ = env.reset()
    for _ in range(case.steps):
        a = greedy(both[0][s] + both[1][s], 0.2, rng)
        s_next, r, terminated, truncated, _ = env.step(a)
        own = int(rng.integers(2))
        best = greedy(both[own][s_next], 0.0, rng)
        target = r + gamma * (1 - terminated) * both[1 - own][s_next, best]
        both[own][s, a] += 0.1 * (target - both[own][s, a])
        s = s_next
        if terminated or truncated:
            s, _ = env.reset()
    return Learned((both[0] + both[1]) / 2, discount=gamma)


@learns_from("reward")
def dyna_q(case: Case) -> Learned:
    """Section 8.2, with transitions that are remembered as they were."""
    gamma = 0.95
    env, rng, q = begin(case)
    memory: list[tuple[int, int, float, int, bool]] = []
    s, _ = env.reset()
    for _ in range(case.steps):
        a = greedy(q[s], 0.2, rng)
        s_next, r, terminated, truncated, _ = env.step(a)
        memory.append((s, a, r, s_next, terminated))
        replayed = [memory[-1], *(memory[int(i)] for i in rng.integers(len(memory), size=3))]
        for s_old, a_old, r_old, s_after, is_end in replayed:
            target = r_old + gamma * (1 - is_end) * q[s_after].max()
            q[s_old, a_old] += 0.1 * (target - q[s_old, a_old])
        s = s_next
        if terminated or truncated:
            s, _ = env.reset()
    return Learned(q, discount=gamma)


# -- several steps ----------------------------------------------------------------------------------------------------


@learns_from("reward")
def monte_carlo(case: Case) -> Learned:
    """Section 5.4, every visit; a return ends where its episode is cut off."""
    gamma = 0.95
    env, rng, q = begin(case)
    visits = np.zeros_like(q)
    episode: list[Step] = []
    s, _ = env.reset()
    for _ in range(case.steps):
        a = greedy(q[s], 0.2, rng)
        s_next, r, terminated, truncated, _ = env.step(a)
        episode.append((s, a, r))
        s = s_next
        if terminated or truncated:
            g = 0.0
            for s_old, a_old, r_old in reversed(episode):
                g = r_old + gamma * g
                visits[s_old, a_old] += 1
                q[s_old, a_old] += (g - q[s_old, a_old]) / visits[s_old, a_old] ** 0.7
            episode = []
            s, _ = env.reset()
    return Learned(q, discount=gamma)


@learns_from("reward")
def n_step(case: Case) -> Learned:
    """Section 7.2: n-step SARSA, n = 3."""
    gamma = 0.9
    n = 3
    env, rng, q = begin(case)
    steps: list[Step] = []
    s, _ = env.reset()
    a = greedy(q[s], 0.2, rng)
    for _ in range(case.steps):
        s_next, r, terminated, truncated, _ = env.step(a)
        steps.append((s, a, r))
        a_next = greedy(q[s_next], 0.2, rng)
        is_over = terminated or truncated
        ahead = (1 - terminated) * q[s_next, a_next]
        while steps and (len(steps) == n or is_over):
            target = ahead
            for _, _, r_later in reversed(steps):
                target = r_later + gamma * target
            s_old, a_old, _ = steps.pop(0)
            q[s_old, a_old] += 0.1 * (target - q[s_old, a_old])
        s = s_next
        a = a_next
        if is_over:
            s, _ = env.reset()
            a = greedy(q[s], 0.2, rng)
    return Learned(q, discount=gamma)


@learns_from("reward")
def q_lambda(case: Case) -> Learned:
    """Section 12.10: Watkins's Q(lambda), with replacing traces."""
    gamma = 0.95
    decay = 0.7
    env, rng, q = begin(case)
    trace = np.zeros_like(q)
    s, _ = env.reset()
    a = greedy(q[s], 0.2, rng)
    for _ in range(case.steps):
        s_next, r, terminated, truncated, _ = env.step(a)
        a_next = greedy(q[s_next], 0.2, rng)
        best = q[s_next].max()
        error = r + gamma * (1 - terminated) * best - q[s, a]
        trace[s] = 0.0
        trace[s, a] = 1.0
        is_greedy = q[s_next, a_next] == best
        q += 0.1 * error * trace
        trace *= gamma * decay * is_greedy
        s = s_next
        a = a_next
        if terminated or truncated:
            trace[:] = 0.0
            s, _ = env.reset()
            a = greedy(q[s], 0.2, rng)
    return Learned(q, discount=gamma)


# -- policies ---------------------------------------------------------------------------------------------------------


def reinforce(case: Case, baseline_rate: float) -> tuple[Array, Array]:
    """Return probabilities (O, A) and the baseline (O,): sections 13.3 and 13.4, without a discount of later states."""
    gamma = 0.95
    env, rng, theta = begin(case)
    v = np.zeros(len(theta))
    episode: list[Step] = []
    s, _ = env.reset()
    for _ in range(case.steps):
        a = int(rng.choice(theta.shape[1], p=softmax(theta[s])))
        s_next, r, terminated, truncated, _ = env.step(a)
        episode.append((s, a, r))
        s = s_next
        if terminated or truncated:
            g = 0.0
            for s_old, a_old, r_old in reversed(episode):
                g = r_old + gamma * g
                advantage = g - v[s_old]
                v[s_old] += baseline_rate * advantage
                pi = softmax(theta[s_old])
                theta[s_old] -= 0.1 * advantage * pi
                theta[s_old, a_old] += 0.1 * advantage
            episode = []
            s, _ = env.reset()
    return softmax(theta), v


@learns_from("reward")
def reinforce_alone(case: Case) -> Array:
    """Section 13.3."""
    pi, _ = reinforce(case, 0.0)
    return pi


@learns_from("reward")
def reinforce_baseline(case: Case) -> Learned:
    """Section 13.4."""
    pi, v = reinforce(case, 0.1)
    return Learned(pi, values=v, discount=0.95)


def actor_critic(case: Case, decay: float, critic_rate: float, gamma: float = 0.95) -> Learned:
    """Advantage actor-critic on batches of 64 steps, with generalised advantages (Schulman et al., 2016)."""
    env, rng, theta = begin(case)
    v = np.zeros(len(theta))
    s, _ = env.reset()
    for _ in range(case.steps // 64):
        pi = softmax(theta)
        batch = []
        for _ in range(64):
            a = int(rng.choice(len(pi[s]), p=pi[s]))
            s_next, r, terminated, truncated, _ = env.step(a)
            batch.append((s, a, r, s_next, terminated, truncated))
            s = s_next
            if terminated or truncated:
                s, _ = env.reset()
        advantages = np.zeros(len(batch))
        later = 0.0
        for t in reversed(range(len(batch))):
            s_old, a, r, s_next, terminated, truncated = batch[t]
            goes_on = 1 - (terminated or truncated)
            error = r + gamma * (1 - terminated) * v[s_next] - v[s_old]
            later = error + gamma * decay * goes_on * later
            advantages[t] = later
        seen = np.array([step[0] for step in batch])
        targets = advantages + v[seen]
        gradient = np.zeros_like(theta)
        for t, (s_old, a, *_) in enumerate(batch):
            gradient[s_old] -= advantages[t] * pi[s_old]
            gradient[s_old, a] += advantages[t]
        theta += 0.03 * gradient
        for s_old in np.unique(seen):
            v[s_old] += critic_rate * (targets[seen == s_old].mean() - v[s_old])
    return Learned(softmax(theta), values=v, discount=gamma)


@learns_from("reward")
def a2c_gae(case: Case) -> Learned:
    """Lambda 0.95."""
    return actor_critic(case, 0.95, 0.2)


@learns_from("reward")
def a2c_slow(case: Case) -> Learned:
    """Lambda 0.95, and a critic that is slow: its values are not finished."""
    return actor_critic(case, 0.95, 0.02, gamma=0.99)


def critic_of(decay: float, critic_rate: float) -> Callable[[Case], Learned]:
    """Return an actor-critic whose critic learns so fast."""

    @learns_from("reward")
    def train(case: Case) -> Learned:
        return actor_critic(case, decay, critic_rate)

    return train


TABLES: dict[str, Callable[[Case], Any]] = {
    each.__name__: each
    for each in (
        q_learning, sarsa, expected_sarsa, double_q, dyna_q, monte_carlo, n_step, q_lambda, reinforce_alone,
        reinforce_baseline, a2c_gae, a2c_slow,
    )
}  # fmt: skip
"""The learners by name."""

for decay, critic_rate in itertools.product((0.0, 0.95, 1.0), (0.05, 0.2, 0.5)):
    TABLES[f"a2c_{decay:g}_{critic_rate:g}"] = critic_of(decay, critic_rate)
