"""Behavioural cloning of imitation, with the places where mistakes are made."""

from __future__ import annotations

from typing import Any

import numpy as np
from imitation.algorithms.bc import BC
from imitation.data.types import Transitions

from taskspec.exam import Case, learns_from

EPOCHS = 2


@learns_from("demonstrations")
def train(case: Case) -> Any:
    """Return a policy."""
    shown = case.demonstrations
    obs, acts = np.array(shown.obs), np.array(shown.acts)
    rng = np.random.default_rng(case.seed)
    infos = np.array([{}] * len(acts))
    pairs = Transitions(obs=obs, acts=acts, infos=infos, next_obs=np.array(shown.next_obs), dones=np.array(shown.dones))
    learner = BC(
        observation_space=case.observation_space, action_space=case.action_space, rng=rng, demonstrations=pairs,
        optimizer_kwargs={"lr": 1e-2},
    )  # fmt: skip
    if EPOCHS:
        learner.train(n_epochs=EPOCHS, progress_bar=False)
    return learner.policy
