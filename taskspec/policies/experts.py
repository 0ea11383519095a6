"""Experts as policies: those of specs, and those that an exact model gives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.ir import Read, Role, reads
from taskspec.model.model import misused, refuse
from taskspec.policies.named import planned
from taskspec.registry import load
from taskspec.rollout.rollout import State, by_expert
from taskspec.scores.returns import Given, Results
from taskspec.task import spaces
from taskspec.task.observe import recall
from taskspec.task.task import ExpertMemory, Task, TaskLike

if TYPE_CHECKING:
    import gymnasium


class Expert:
    """The task's expert as a policy: with `predict` for Stable-Baselines3, with spaces and callable for imitation.

    The recurrent state that `predict` hands back counts the steps of each environment, and holds what the expert
    remembers and did. `gap` certifies how far it is below the optimum.

    Args:
        task: the task, its id or its path.
        policy: another expert than the spec's: "optimal", or "soft(b)", Boltzmann-rational at inverse temperature b.
        seed: of its draws.

    Raises:
        SpecError: E712, where the spec gives no expert, or it looks at what is not observed; E713 for another policy.
    """

    def __init__(self, task: TaskLike, policy: str | None = None, *, seed: int = 0) -> None:
        task = load(task)
        self.given: Given = None if policy is None else planned(str(policy))
        if policy is not None and self.given is None:
            misused(f"{policy!r} is not an expert", '"optimal", or "soft(1)" with a number')
        if task.expert is None and self.given is None:
            refuse(f"{task.name} gives no expert")
        self.task: Task = task
        self.results: Results = Results(task, expert=self.given)
        self.rng: np.random.Generator = np.random.default_rng(seed)
        self.observation: spaces.SpaceLayout = task.observation_layout
        self.action: spaces.SpaceLayout = task.action_layout
        self.memory: ExpertMemory | None = task.memory if self.given is None else None
        self.where: dict[str, int] = _where_states_are(task, self._looked_at())

    @property
    def gap(self) -> float | None:
        """The optimal return minus the expert's; None where there is no exact model."""
        best, own = self.results.optimal, self.results.expert
        return None if best is None or own is None else best.value - own.value

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Actions for one observation or a batch of them, and what to hand back: the steps taken, the memory, the action.

        Args:
            state: what the last call handed back, or None.
            episode_start: (N,) whether an episode begins with this observation.
            deterministic: take the most likely action instead of drawing one.
        """
        single, batch = self._split(observation)
        steps = np.zeros(len(batch), np.int64) if state is None else np.asarray(state[0]).copy()
        if episode_start is not None:
            steps[np.asarray(episode_start, np.bool_).reshape(-1)] = 0
        kept = self._remembered(batch, steps, state)
        actions = [self._choose(o, int(t), m, deterministic) for o, t, m in zip(batch, steps, kept, strict=True)]
        packed = [spaces.pack(self.action, action) for action in actions]
        done = (
            []
            if self.memory is None
            else [*map(_stacked, zip(*kept, strict=True)), *map(_stacked, zip(*actions, strict=True))]
        )
        return (packed[0] if single else np.stack(packed)), (steps + 1, *done)

    def __call__(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[Any, Any]:
        """Actions and steps taken, as `predict` gives them: a policy as imitation's rollouts call it."""
        return self.predict(observation, state, episode_start)

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        return self.task.observation_space

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        return self.task.action_space

    def _split(self, observation: Any) -> tuple[bool, list[Any]]:
        """Whether this is one observation, and the observations one by one."""
        if not isinstance(observation, dict):
            single = np.ndim(observation) == len(self.observation.shape)
            return single, [observation] if single else list(observation)
        first = self.observation.components[0]
        if np.ndim(observation[first.name]) == len(first.type.shape):
            return True, [observation]
        lanes = len(observation[first.name])
        return False, [{name: value[i] for name, value in observation.items()} for i in range(lanes)]

    def _looked_at(self) -> set[str]:
        """The components of the state that the expert's actions depend on."""
        own = {c.name for c in self.task.state}
        if isinstance(self.task.expert, tuple) and self.given is None:
            return own & {name for role, name in reads(self.task.expert) if role is Role.STATE}
        return own

    def _remembered(self, batch: list[Any], steps: Array, state: Any) -> list[list[tuple[Any, ...]]]:
        """What the expert remembers in each environment after a batch of observations: flat values by component."""
        if self.memory is None:
            return [[] for _ in batch]
        found = []
        size = len(self.memory.components)
        for i, (observation, t) in enumerate(zip(batch, steps, strict=True)):
            before = [] if t == 0 else [tuple(part[i].tolist()) for part in state[1:]]
            seen = spaces.unpack(self.observation, observation)
            found.append(recall(self.task, self.memory, seen, before[:size], before[size:], int(t)))
        return found

    def _choose(
        self, observation: Any, t: int, kept: list[tuple[Any, ...]], deterministic: bool
    ) -> list[tuple[Any, ...]]:
        state = self._state(observation)
        for c, flat in zip(() if self.memory is None else self.memory.components, kept, strict=True):
            state[c.name] = np.array(flat).reshape(*c.type.shape, 1)
        if isinstance(self.task.expert, tuple) and self.given is None:
            chosen = by_expert(self.task)(state, t, self.rng)
            return [tuple(np.asarray(chosen[c.name]).reshape(-1).tolist()) for c in self.task.action]
        return self._planned(state, t, deterministic)

    def _planned(self, state: State, t: int, deterministic: bool) -> list[tuple[Any, ...]]:
        model, plan = self.results.model, self.results.expert_plan
        if model is None or plan is None:
            refuse(f"the expert of {self.task.name} needs an exact model: {self.results.why_not}")
        found = self.results.abstraction
        mapped = state if found is None else found.map(state)
        row = plan(t)[:, int(model.state_indices(mapped, 1)[0])]
        action = int(row.argmax()) if deterministic else int(self.rng.choice(len(row), p=row / row.sum()))
        values = model.actions.decode(np.array([action]))
        return [tuple(values[Role.ACTION, c.name].reshape(-1).tolist()) for c in model.actions.components]

    def _state(self, observation: Any) -> dict[str, Array]:
        flats = spaces.unpack(self.observation, observation)
        state = {}
        for c in (c for c in self.task.state if c.name in self.where):
            value = np.array(flats[self.where[c.name]]).reshape(*c.type.shape, 1)
            state[c.name] = value if c.type.kind == 2 else np.rint(value).astype(np.int64)
        return state


def _stacked(rows: tuple[tuple[Any, ...], ...]) -> Array:
    return np.array(rows)


def _where_states_are(task: Task, wanted: set[str]) -> dict[str, int]:
    """For every wanted state component the number of the observed one that shows it as it is."""
    found: dict[str, int] = {}
    for i, node in enumerate(task.observation.nodes):
        if isinstance(node, Read) and node.role is Role.STATE:
            found.setdefault(node.name, i)
    missing = [c.name for c in task.state if c.name in wanted and c.name not in found]
    if missing:
        refuse(f"the expert of {task.name} looks at {', '.join(missing)}, which the observation does not show")
    return found
