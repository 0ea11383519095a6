"""Experts as policies for other libraries: those of specs, and those planned on an exact model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from taskspec.base.arrays import Array, part_at
from taskspec.base.named import all_names
from taskspec.exact.model.model import misused, refuse
from taskspec.exact.policies.policy import Actions, decoded, planned, probabilities_of
from taskspec.exact.rollout.rollout import State, by_expert
from taskspec.exact.scores.returns import Given, Results
from taskspec.language.expressions.types import Kind
from taskspec.language.registry import load
from taskspec.language.task import spaces
from taskspec.language.task.parts import ExpertMemory
from taskspec.language.task.questions import component, components_read
from taskspec.language.task.task import Task, TaskLike, recall

if TYPE_CHECKING:
    import gymnasium


class Expert:
    """The task's expert as a policy: with `predict` for Stable-Baselines3, with spaces and callable for imitation.

    The recurrent state that `predict` returns has the number of steps in each environment, the expert's memory and its last
    actions. `gap` is how far its return is below the optimum.

    Args:
        task: the task, its id or its path.
        policy: another expert than the spec's: "optimal", or "soft(b)", Boltzmann-rational at inverse temperature b.
        seed: of its draws.

    Raises:
        SpecError: E712, where the spec gives no expert, or it looks at what is not observed; E713 for another policy.
    """

    def __init__(self, task: TaskLike, policy: str | None = None, *, seed: int = 0) -> None:
        task = load(task)
        self.given: Given = None
        if policy is not None:
            self.given = planned(str(policy))
        if policy is not None and self.given is None:
            misused(f"{policy!r} is not an expert", '"optimal", or "soft(1)" with a number')
        if task.annotations.expert is None and self.given is None:
            refuse(f"{task.name} gives no expert")
        self.task: Task = task
        self.results: Results = Results(task, expert=self.given)
        self.rng: np.random.Generator = np.random.default_rng(seed)
        self.observation: spaces.SpaceLayout = task.observation_layout
        self.action: spaces.SpaceLayout = task.action_layout
        self.memory: ExpertMemory | None = None
        if self.given is None:
            self.memory = task.annotations.memory
        self.is_expressed: bool = isinstance(task.annotations.expert, tuple) and self.given is None
        needed = set(all_names(task.state))
        if isinstance(task.annotations.expert, tuple) and self.is_expressed:
            needed &= components_read(task.annotations.expert)
        self.shown_by: dict[str, int] = _shown_by(task, needed)

    @property
    def gap(self) -> float | None:
        """The optimal return minus the expert's; None where there is no exact model."""
        best = self.results.optimal
        own = self.results.expert
        if best is None or own is None:
            return None
        return best.value - own.value

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Choose actions, as policies of Stable-Baselines3 do.

        Args:
            observation: one of the environment's, or a batch of them.
            state: the recurrent state that the last call returned, or None.
            episode_start: bool (N,), whether an episode begins with this observation.
            deterministic: take the most likely action instead of drawing one.

        Returns:
            the action, or N of them along the first axis, and the recurrent state: steps taken int64 (N,), memory, actions.
        """
        single, batch = self._split(observation)
        if state is None:
            steps = np.zeros(len(batch), np.int64)
        else:
            steps = np.asarray(state[0]).copy()
        if episode_start is not None:
            steps[np.asarray(episode_start, np.bool_).reshape(-1)] = 0
        memories = self._remembered(batch, steps, state)
        actions = []
        for seen, t, memory in zip(batch, steps, memories, strict=True):
            actions.append(self._choose(seen, int(t), memory, deterministic))
        packed = [spaces.pack(self.action, action) for action in actions]
        kept: list[Array] = []
        if self.memory is not None:
            kept += [np.array(rows) for rows in zip(*memories, strict=True)]
            kept += [np.array(rows) for rows in zip(*actions, strict=True)]
        state = (steps + 1, *kept)
        if single:
            return packed[0], state
        return np.stack(packed), state

    def __call__(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[Any, Any]:
        """Return what `predict` returns; imitation's rollouts call policies like this."""
        return self.predict(observation, state, episode_start)

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        return self.task.observation_space

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        return self.task.action_space

    def _split(self, observation: Any) -> tuple[bool, list[Any]]:
        first = observation
        shape = self.observation.shape
        if isinstance(observation, dict):
            first = observation[self.observation.components[0].name]
            shape = self.observation.components[0].type.shape
        if np.ndim(first) == len(shape):
            return True, [observation]
        return False, [part_at(observation, i) for i in range(len(first))]

    def _remembered(self, batch: list[Any], steps: Array, state: Any) -> list[list[tuple[Any, ...]]]:
        if self.memory is None:
            return [[] for _ in batch]
        memories = []
        size = len(self.memory.components)
        for i, (observation, t) in enumerate(zip(batch, steps, strict=True)):
            before = []
            if t != 0:
                before = [tuple(part[i].tolist()) for part in state[1:]]
            seen = spaces.unpack(self.observation, observation)
            memories.append(recall(self.task, self.memory, seen, before[:size], before[size:], int(t)))
        return memories

    def _choose(
        self, observation: Any, t: int, memory: list[tuple[Any, ...]], deterministic: bool
    ) -> list[tuple[Any, ...]]:
        states = self._states(observation)
        if self.memory is not None:
            for c, flat in zip(self.memory.components, memory, strict=True):
                states[c.name] = np.array(flat).reshape(*c.type.shape, 1)
        if self.is_expressed:
            chosen = by_expert(self.task)(states, t, self.rng)
        else:
            chosen = self._plan(states, t, deterministic)
        return [tuple(np.asarray(chosen[c.name]).reshape(-1).tolist()) for c in self.task.action]

    def _plan(self, states: State, t: int, deterministic: bool) -> Actions:
        plan = self.results.expert_plan
        if self.results.model is None or plan is None:
            refuse(f"the expert of {self.task.name} needs an exact model: {self.results.why_not}")
        pi = probabilities_of(self.results, plan, states, t)[:, 0]
        if deterministic:
            action = int(pi.argmax())
        else:
            action = int(self.rng.choice(len(pi), p=pi / pi.sum()))
        return decoded(self.results, np.array([action]))

    def _states(self, observation: Any) -> dict[str, Array]:
        flats = spaces.unpack(self.observation, observation)
        states = {}
        for c in (c for c in self.task.state if c.name in self.shown_by):
            value = np.array(flats[self.shown_by[c.name]]).reshape(*c.type.shape, 1)
            if c.type.kind is Kind.REAL:
                states[c.name] = value
            else:
                states[c.name] = np.rint(value).astype(np.int64)
        return states


def _shown_by(task: Task, wanted: set[str]) -> dict[str, int]:
    shown: dict[str, int] = {}
    for i, node in enumerate(task.observation.nodes):
        name = component(node)
        if name is not None:
            shown.setdefault(name, i)
    missing = [c.name for c in task.state if c.name in wanted and c.name not in shown]
    if missing:
        refuse(f"the expert of {task.name} looks at {', '.join(missing)}, which the observation does not show")
    return shown
