"""Generative adversarial imitation over tables: steps that end early go on in a state that absorbs, for the expert as well."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, learns_from
from tests.verification.exam_study.learners.ppo import DISCOUNT, LANES, LENGTH, Learner, Player, Steps

Array = np.ndarray[Any, Any]
UPDATES, RATE, KEPT = 10, 0.2, 0.8


@learns_from("demonstrations")
def train(case: Case) -> Array:
    """The probabilities of actions, (S, A)."""
    player, learner, judge = Player(case), Learner(case), Discriminator(case)
    for _ in range(case.steps // (LANES * LENGTH)):
        steps = player.play(learner.probabilities())
        judge.improve(steps)
        learner.improve(steps, judge.pay(steps))
    return learner.probabilities()


class Discriminator:
    """Log-odds that a state (the last one is that which absorbs) and an action are of the expert: (S + 1, A)."""

    def __init__(self, case: Case) -> None:
        self.horizon, shown = case.task.horizon or 1, case.demonstrations
        self.states, self.actions = case.observation_space.n, case.action_space.n
        self.logits = np.zeros((self.states + 1, self.actions))
        lengths = np.diff([*shown.starts, len(shown.acts)])
        missing = (self.horizon - lengths).sum()
        self.expert = self.shares(shown.obs, shown.acts, missing)
        self.learner = np.zeros_like(self.expert)

    def shares(self, obs: Array, acts: Array, absorbed: float) -> Array:
        """How often states and actions come, (S + 1, A), of all steps."""
        counts = np.zeros_like(self.logits)
        np.add.at(counts, (obs.reshape(-1), acts.reshape(-1)), 1.0)
        counts[-1] = absorbed / self.actions
        return counts / counts.sum()

    def improve(self, steps: Steps) -> None:
        """Learn to tell a round of steps, and those before, from the expert's."""
        missing = (self.horizon - 1 - steps.time)[steps.ended].sum()
        self.learner = KEPT * self.learner + (1 - KEPT) * self.shares(steps.obs, steps.acts, missing)
        for _ in range(UPDATES):
            chance = 1 / (1 + np.exp(-self.logits))
            slope = self.expert * (1 - chance) - self.learner * chance
            self.logits += RATE * slope / (self.expert + self.learner + 1e-4)

    def pay(self, steps: Steps) -> Array:
        """-log(1 - D) for each step; for the last one that of the steps that are missing as well."""
        paid = np.log1p(np.exp(self.logits))
        missing = np.where(steps.ended, self.horizon - 1 - steps.time, 0)
        rest = DISCOUNT * (1 - DISCOUNT**missing) / (1 - DISCOUNT) * paid[-1].mean()
        return paid[steps.obs, steps.acts] + rest
