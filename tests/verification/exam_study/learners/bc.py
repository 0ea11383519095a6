"""Behavioural cloning: a linear softmax policy, by stochastic gradients of the log-likelihood."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, learns_from

Array = np.ndarray[Any, Any]
UPDATES, BATCH, RATE = 400, 64, 1.0


@learns_from("demonstrations")
def train(case: Case) -> Cloned:
    """A policy that does what was demonstrated."""
    shown, rng = case.demonstrations, np.random.default_rng(case.seed)
    policy = Cloned(case.observation_space, case.action_space.n)
    inputs, labels = policy.features(shown.obs), shown.acts
    for _ in range(UPDATES):
        chosen = rng.integers(len(labels), size=BATCH)
        error = np.eye(case.action_space.n)[labels[chosen]] - softmax(inputs[chosen] @ policy.weights)
        policy.weights += RATE * inputs[chosen].T @ error / BATCH
    return policy


class Cloned:
    """Probabilities of actions as a softmax of what is linear in the observation."""

    def __init__(self, space: Any, actions: int) -> None:
        self.space = space
        self.weights = np.zeros((self.size, actions))

    @property
    def size(self) -> int:
        return int(self.space.n) if hasattr(self.space, "n") else int(np.prod(self.space.shape)) + 1

    def features(self, observations: Array) -> Array:
        """Of N observations, (N, size): one-hot codes, or numbers around 0 and a constant."""
        if hasattr(self.space, "n"):
            return np.eye(self.size)[observations]
        middle = (self.space.low + self.space.high) / 2
        return np.c_[(observations - middle).reshape(len(observations), -1), np.ones(len(observations))]

    def probabilities(self, observations: Array) -> Array:
        """Of the actions, (N, A)."""
        return softmax(self.features(observations) @ self.weights)


def softmax(logits: Array) -> Array:
    """Probabilities (..., A)."""
    powers = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return powers / powers.sum(axis=-1, keepdims=True)
