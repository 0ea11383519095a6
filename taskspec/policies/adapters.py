"""What a policy does in a batch of states: its probabilities of actions where it has them, else the actions that it gives.

A policy is an object with `predict`, as Stable-Baselines3 and imitation have them. Observations are normalised as they were
in training where the policy remembers how (`VecNormalize`), and what a recurrent policy remembers is handed back to it.
"""

from __future__ import annotations

import inspect
from functools import reduce
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Role, draws, reads
from taskspec.lang.variates.sample import WordLayout, batch_sampler
from taskspec.model.model import misused
from taskspec.rollout.rollout import State, reads_of
from taskspec.task import spaces
from taskspec.task.task import Task

ASKS = 16
"""How often a policy is asked about the same states before its actions are taken to be always the same."""


class Asked:
    """A policy object and how it is asked.

    Args:
        task: whose states it is asked about.
        policy: an object with `predict`, maybe with `action_probabilities`, or a policy of Stable-Baselines3.
        deterministic: hand this flag to `predict`; None leaves it to the policy.
    """

    def __init__(self, task: Task, policy: Any, deterministic: bool | None = None) -> None:
        self.task, self.policy, self.deterministic = task, policy, deterministic
        self.seen, self.done = task.observation_layout, task.action_layout
        self._words = WordLayout.of(task.observation.nodes)
        self._takes = _parameters(policy.predict)
        self._normalise = _normaliser(policy)

    @property
    def sees_state_alone(self) -> bool:
        """Whether an observation is a function of the state, so that there is one for each state."""
        nodes = self.task.observation.nodes
        return not draws(nodes) and all(role is not Role.TIME for role, _ in reads(nodes))

    @property
    def sees_time(self) -> bool:
        """Whether an observation is a function of the state and the time."""
        nodes = self.task.observation.nodes
        return not draws(nodes) and any(role is Role.TIME for role, _ in reads(nodes))

    # -- observations ---------------------------------------------------------------------------------------------

    def observations(self, state: State, t: int, rng: np.random.Generator) -> Any:
        """Observations (N, *shape) of states by component, (*shape, N); a dict of them for a dict space."""
        lanes = next(iter(state.values())).shape[-1]
        words = rng.integers(0, 2**32, (self._words.count, lanes), dtype=np.uint32)
        values = evaluate(self.task.observation.nodes, reads_of(state, {}, t), batch_sampler(self._words, words))
        flat = [np.broadcast_to(v, (*v.shape[:-1], lanes)).reshape(-1, lanes).T for v in values]
        return self._normalise(spaces.pack_many(self.seen, flat))

    # -- answers --------------------------------------------------------------------------------------------------

    def probabilities(self, state: State, t: int) -> Array | None:
        """Probabilities (A, N) of the actions of the exact model, first component slowest; None where it tells none."""
        if self.deterministic:
            return None
        seen = self.observations(state, t, np.random.default_rng(0))
        if hasattr(self.policy, "action_probabilities"):
            return np.asarray(self.policy.action_probabilities(seen), np.float64).T
        return distribution(self.policy, seen)

    def actions(
        self, state: State, t: int, rng: np.random.Generator, memory: Any = None, start: bool = True
    ) -> tuple[dict[str, Array], Any]:
        """Actions by component, (*shape, N), and what the policy wants to remember.

        Args:
            memory: what it wanted to remember at the last step.
            start: whether episodes begin with these states.
        """
        lanes = next(iter(state.values())).shape[-1]
        options: dict[str, Any] = {}
        if self.deterministic is not None and "deterministic" in self._takes:
            options["deterministic"] = self.deterministic
        if "state" in self._takes and memory is not None:
            options["state"] = memory
        if "episode_start" in self._takes:
            options["episode_start"] = np.full(lanes, start)
        answer = self.policy.predict(self.observations(state, t, rng), **options)
        actions, remembered = answer if isinstance(answer, tuple) else (answer, None)
        rows = [spaces.unpack(self.done, action) for action in np.asarray(actions)]
        if len(rows) != lanes:
            misused(f"`predict` gave {len(rows)} actions for a batch of {lanes} observations")
        columns = [np.array([row[i] for row in rows]).T for i in range(len(self.task.action))]
        found = {c.name: v.reshape(*c.type.shape, lanes) for c, v in zip(self.task.action, columns, strict=True)}
        return found, remembered

    def constant_actions(self, state: State, t: int) -> dict[str, Array] | None:
        """Actions by component, (*shape, N), where the policy gives the same ones each time and remembers nothing; else None.

        A policy that could have been asked to be deterministic, and was not, may explore now and then: it is not tabulated.
        """
        if "deterministic" in self._takes and not self.deterministic:
            return None
        first, memory = self.actions(state, t, np.random.default_rng(0))
        if memory is not None:
            return None
        for _ in range(ASKS - 1):
            again, _ = self.actions(state, t, np.random.default_rng(0))
            if not all(np.array_equal(first[name], again[name]) for name in first):
                return None
        return first


def _parameters(function: Any) -> frozenset[str]:
    try:
        return frozenset(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        return frozenset()


def _normaliser(policy: Any) -> Any:
    """How a model of Stable-Baselines3 that was trained behind `VecNormalize` wants observations; else as they are."""
    wrapper = policy.get_vec_normalize_env() if hasattr(policy, "get_vec_normalize_env") else None
    return (lambda seen: seen) if wrapper is None else wrapper.normalize_obs


def distribution(policy: Any, seen: Any) -> Array | None:
    """Probabilities (A, N) from a policy of Stable-Baselines3 with categorical actions; None for any other."""
    actor = getattr(policy, "policy", policy)
    if not (hasattr(actor, "get_distribution") and hasattr(actor, "obs_to_tensor")):
        return None
    actor.set_training_mode(False)
    found = actor.get_distribution(actor.obs_to_tensor(seen)[0]).distribution
    parts = found if isinstance(found, list) else [found]
    if any(type(part).__name__ != "Categorical" for part in parts):
        return None
    rows = [part.probs.detach().cpu().numpy().astype(np.float64) for part in parts]
    joint = reduce(lambda a, b: (a[:, :, None] * b[:, None, :]).reshape(len(a), -1), rows)
    table: Array = (joint / joint.sum(axis=1, keepdims=True)).T
    return table
