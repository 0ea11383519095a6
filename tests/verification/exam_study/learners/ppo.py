"""Proximal policy optimisation over tables: a softmax policy, a critic, generalised advantages, clipped ratios."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from

Array = np.ndarray[Any, Any]
LANES, LENGTH = 64, 20
EPOCHS, PARTS = 2, 4
DISCOUNT, TRACE, CLIP, ENTROPY = 0.95, 0.95, 0.2, 0.01
POLICY_RATE, LARGEST, CRITIC_RATE = 0.5, 0.05, 0.2


@learns_from("reward")
def train(case: Case) -> Learned:
    """The probabilities of actions, (S, A), and the values of states."""
    player, learner = Player(case), Learner(case)
    for _ in range(case.steps // (LANES * LENGTH)):
        steps = player.play(learner.probabilities())
        learner.improve(steps, steps.rewards)
    return Learned(learner.probabilities(), values=learner.values, discount=DISCOUNT)


@dataclass(frozen=True)
class Steps:
    """What happened in a round, (LENGTH, LANES) each.

    `next_obs` is what a step led to, before anything begins anew; `time` counts the steps before it in its episode.
    """

    obs: Array
    acts: Array
    next_obs: Array
    rewards: Array
    terminated: Array
    ended: Array
    time: Array


class Player:
    """Environments that go on from round to round."""

    def __init__(self, case: Case) -> None:
        self.env = case.make_vec(LANES, backend="numpy", autoreset_mode="SameStep")
        self.rng = np.random.default_rng((case.seed, 1))
        self.seen, _ = self.env.reset()
        self.time = np.zeros(LANES, int)

    def play(self, probabilities: Array) -> Steps:
        """A round of steps of a policy (S, A)."""
        rows = []
        for _ in range(LENGTH):
            obs = np.array(self.seen)
            acts = draw(probabilities[obs], self.rng)
            self.seen, rewards, terminated, truncated, told = self.env.step(acts)
            ended = terminated | truncated
            after = np.array(self.seen)
            for lane in np.flatnonzero(ended):
                after[lane] = told["final_obs"][lane]
            rows.append((obs, acts, after, np.array(rewards), np.array(terminated), ended, self.time))
            self.time = np.where(ended, 0, self.time + 1)
        return Steps(*(np.stack(column) for column in zip(*rows, strict=True)))


class Learner:
    """A policy and a critic, both tables."""

    def __init__(self, case: Case) -> None:
        states, actions = case.observation_space.n, case.action_space.n
        self.logits, self.values = np.zeros((states, actions)), np.zeros(states)
        self.rng = np.random.default_rng((case.seed, 2))

    def probabilities(self) -> Array:
        """Of the actions, (S, A)."""
        powers = np.exp(self.logits - self.logits.max(axis=1, keepdims=True))
        return powers / powers.sum(axis=1, keepdims=True)

    def improve(self, steps: Steps, rewards: Array) -> None:
        """Learn from a round that paid `rewards`."""
        gains = self.advantages(steps, rewards)
        targets = gains + self.values[steps.obs]
        gains = (gains - gains.mean()) / (gains.std() + 1e-8)
        obs, acts, gains, targets = (x.reshape(-1) for x in (steps.obs, steps.acts, gains, targets))
        before = self.probabilities()[obs, acts]
        for _ in range(EPOCHS):
            for part in np.array_split(self.rng.permutation(len(obs)), PARTS):
                self.step(obs[part], acts[part], gains[part], before[part])
                self.fit(obs[part], targets[part])

    def advantages(self, steps: Steps, rewards: Array) -> Array:
        """Generalised advantages, (LENGTH, LANES)."""
        ahead = np.where(steps.terminated, 0.0, self.values[steps.next_obs])
        errors = rewards + DISCOUNT * ahead - self.values[steps.obs]
        found, later = np.zeros_like(errors), np.zeros(errors.shape[1])
        for t in reversed(range(len(errors))):
            later = errors[t] + DISCOUNT * TRACE * np.where(steps.ended[t], 0.0, later)
            found[t] = later
        return found

    def step(self, obs: Array, acts: Array, gains: Array, before: Array) -> None:
        """Ascend the clipped objective and the entropy, of samples (N,)."""
        probabilities = self.probabilities()
        ratio = probabilities[obs, acts] / before
        is_clipped = np.where(gains > 0, ratio > 1 + CLIP, ratio < 1 - CLIP)
        pull = np.where(is_clipped, 0.0, ratio * gains)
        slope = np.zeros_like(self.logits)
        np.add.at(slope, (obs, acts), pull)
        slope -= np.bincount(obs, pull, len(slope))[:, None] * probabilities
        logs = np.log(probabilities + 1e-12)
        spread = -probabilities * (logs - (probabilities * logs).sum(axis=1, keepdims=True))
        visits = np.bincount(obs, minlength=len(slope))[:, None]
        slope = slope / np.maximum(visits, 1) + ENTROPY * spread * (visits > 0)
        self.logits += np.clip(POLICY_RATE * slope, -LARGEST, LARGEST)

    def fit(self, obs: Array, targets: Array) -> None:
        """Move the values of states towards the mean of their targets (N,)."""
        visits = np.bincount(obs, minlength=len(self.values))
        means = np.bincount(obs, targets, len(self.values)) / np.maximum(visits, 1)
        self.values += CRITIC_RATE * np.where(visits > 0, means - self.values, 0.0)


def draw(probabilities: Array, rng: np.random.Generator) -> Array:
    """An action for each row of probabilities (N, A)."""
    return (probabilities.cumsum(axis=1) < rng.random((len(probabilities), 1))).sum(axis=1)
