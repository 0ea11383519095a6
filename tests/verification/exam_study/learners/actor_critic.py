"""Advantage actor-critic over tables, in the form of CleanRL: synchronous environments, rollouts of a few steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from

Array = np.ndarray[Any, Any]
NUM_ENVS, NUM_STEPS = 32, 8
GAMMA, GAE_LAMBDA = 0.9, 0.9
ENT_COEF = 0.01
LR, CRITIC_LR = 1.0, 0.2


@learns_from("reward")
def train(case: Case) -> Learned:
    """Return probabilities of actions (O, A) and values (O,)."""
    envs = case.make_vec(NUM_ENVS, backend="numpy", autoreset_mode="SameStep")
    rng = np.random.default_rng(case.seed)
    logits = np.zeros((case.observation_space.n, case.action_space.n))
    v = np.zeros(case.observation_space.n)
    obs = np.zeros((NUM_STEPS, NUM_ENVS), int)
    actions = np.zeros((NUM_STEPS, NUM_ENVS), int)
    rewards = np.zeros((NUM_STEPS, NUM_ENVS))
    next_values = np.zeros((NUM_STEPS, NUM_ENVS))
    dones = np.zeros((NUM_STEPS, NUM_ENVS))
    next_obs, _ = envs.reset()
    for _ in range(case.steps // (NUM_ENVS * NUM_STEPS)):
        pi = softmax(logits)
        for step in range(NUM_STEPS):
            obs[step] = next_obs
            actions[step] = sample(pi[next_obs], rng)
            next_obs, rewards[step], terminations, truncations, infos = envs.step(actions[step])
            reached = np.array(next_obs)
            ended = np.logical_or(terminations, truncations)
            if ended.any():
                reached[ended] = np.array(list(infos["final_obs"][ended]), int)
            next_values[step] = np.where(terminations, 0.0, v[reached])
            dones[step] = ended
        advantages = np.zeros_like(rewards)
        lastgaelam = np.zeros(NUM_ENVS)
        for t in reversed(range(NUM_STEPS)):
            delta = rewards[t] + GAMMA * next_values[t] - v[obs[t]]
            advantages[t] = lastgaelam = delta + GAMMA * GAE_LAMBDA * (1.0 - dones[t]) * lastgaelam
        returns = advantages + v[obs]
        b_obs = obs.reshape(-1)
        b_actions = actions.reshape(-1)
        b_advantages = advantages.reshape(-1)
        b_returns = returns.reshape(-1)
        b_advantages = b_advantages / (b_advantages.std() + 1e-8)
        logits += LR * policy_gradient(pi, b_obs, b_actions, b_advantages)
        number = np.bincount(b_obs, minlength=len(v))
        mean_return = np.bincount(b_obs, b_returns, len(v)) / np.maximum(number, 1)
        v += CRITIC_LR * np.where(number > 0, mean_return - v, 0.0)
    return Learned(softmax(logits), values=v, discount=GAMMA)


def policy_gradient(pi: Array, obs: Array, actions: Array, advantages: Array) -> Array:
    """Return the gradient (O, A) of the mean of log pi times advantage, and of the entropy."""
    gradient = np.zeros_like(pi)
    number = np.maximum(1, np.bincount(obs, minlength=len(pi)))
    np.add.at(gradient, (obs, actions), advantages)
    gradient -= np.bincount(obs, advantages, len(pi))[:, None] * pi
    gradient /= number[:, None] + 16
    log_pi = np.log(pi + 1e-12)
    entropy = -(pi * log_pi).sum(axis=1, keepdims=True)
    gradient += ENT_COEF * -pi * (log_pi + entropy)
    return gradient


def softmax(logits: Array) -> Array:
    """Return probabilities of actions."""
    powers = np.exp(logits - logits.max(axis=1, keepdims=True))
    return powers / powers.sum(axis=1, keepdims=True)


def sample(pi: Array, rng: np.random.Generator) -> Array:
    """Return an action of each row of probabilities."""
    return (pi.cumsum(axis=1) < rng.random((len(pi), 1))).sum(axis=1)
