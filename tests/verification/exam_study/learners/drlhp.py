"""Deep reinforcement learning from human preferences, over tables: whole episodes are compared, and PPO is paid."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from
from tests.verification.exam_study.learners.ppo import LANES, LENGTH, Learner, Player, Steps

Array = np.ndarray[Any, Any]
PAIRS, UPDATES, RATE, DECAY = 12, 20, 1.0, 0.01


@learns_from("preferences")
def train(case: Case) -> Learned:
    """The probabilities of actions, (S, A), and the learned reward."""
    player, learner, model = Player(case), Learner(case), Reward(case)
    for _ in range(case.steps // (LANES * LENGTH)):
        steps = player.play(learner.probabilities())
        model.ask(case, episodes(steps))
        model.fit()
        learner.improve(steps, model.table[steps.obs, steps.acts])
    return Learned(learner.probabilities(), reward=lambda obs, acts, _: model.table[obs, acts])


class Reward:
    """The reward of states and actions (S, A), from comparisons of episodes."""

    def __init__(self, case: Case) -> None:
        self.table = np.zeros((case.observation_space.n, case.action_space.n))
        self.differences: list[Array] = []
        self.answers: list[float] = []
        self.rng = np.random.default_rng((case.seed, 3))

    def ask(self, case: Case, shown: list[SimpleNamespace]) -> None:
        """Have pairs of episodes compared."""
        for _ in range(PAIRS):
            first, second = (shown[i] for i in self.rng.choice(len(shown), size=2, replace=False))
            self.differences.append(self.counts(first) - self.counts(second))
            self.answers.append(case.prefer(first, second))

    def counts(self, episode: SimpleNamespace) -> Array:
        """How often an episode takes each action in each state, (S, A)."""
        found = np.zeros_like(self.table)
        np.add.at(found, (episode.obs[:-1], episode.acts), 1.0)
        return found

    def fit(self) -> None:
        """Ascend the likelihood of all answers (Bradley-Terry)."""
        inputs, answers = np.stack(self.differences), np.array(self.answers)
        for _ in range(UPDATES):
            chance = 1 / (1 + np.exp(-(inputs * self.table).sum(axis=(1, 2))))
            slope = np.tensordot(answers - chance, inputs, 1) / len(answers)
            self.table += RATE * (slope - DECAY * self.table)


def episodes(steps: Steps) -> list[SimpleNamespace]:
    """The whole episodes of a round."""
    found = []
    for lane in range(steps.obs.shape[1]):
        for end in np.flatnonzero(steps.ended[:, lane]):
            first = end - steps.time[end, lane]
            if first >= 0:
                part = slice(first, end + 1)
                obs = np.append(steps.obs[part, lane], steps.next_obs[end, lane])
                found.append(SimpleNamespace(obs=obs, acts=steps.acts[part, lane]))
    return found
