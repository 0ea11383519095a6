"""Policies as objects: experts with `predict`, and the value of whatever policy is handed in."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.exact.model.failure import misused, refuse
from taskspec.exact.model.model import Model
from taskspec.exact.planning import solve
from taskspec.exact.planning.plans import Plan, stationary, timed
from taskspec.exact.scoring.asking import ASKS, Asked
from taskspec.exact.scoring.returns import Given, Results, Return
from taskspec.exact.simulation.rollout import State
from taskspec.lang.ir import Read, Role
from taskspec.registry import load
from taskspec.task import spaces
from taskspec.task.task import Soft, Task, TaskLike

if TYPE_CHECKING:
    import gymnasium

Array = np.ndarray[Any, Any]
_SOFT = re.compile(r"soft\((.+)\)")
Asking = Literal["probabilities", "actions", "samples"]
"""What the value of a policy rests on: its probabilities of actions, its actions where they are always the same, or episodes."""


@dataclass(frozen=True, slots=True)
class Valued:
    """The expected return of a policy, and in which way the policy was asked."""

    value: Return
    asked: Asking


def policy_value(task: Task, policy: Any, deterministic: bool | None, episodes: int, seed: int) -> Valued:
    """The expected return of a policy: exact where the task has a model and the policy can be tabulated on it."""
    results = Results(task, episodes, seed)
    model = results.model
    if isinstance(policy, list | tuple) or hasattr(policy, "__array__"):
        return _tabulated(policy, results)
    if isinstance(policy, Expert) and not deterministic:
        return _as_expert(policy, results)
    if hasattr(policy, "predict"):
        return _predicted(Asked(task, policy, deterministic), results)
    if not callable(policy):
        misused(f"{type(policy).__name__} is no policy", "a table, a function, or an object with `predict`")
    if model is not None and model.task is task:
        try:
            return Valued(Return(solve.policy_return(model, plan_of_function(model, policy))), "actions")
        except _Varies:
            pass
    return Valued(results.simulated(lambda state, t, rng: policy(state, t)), "samples")


def _tabulated(table: Any, results: Results) -> Valued:
    model, array = results.model, np.asarray(table)
    if array.ndim == 1 and array.dtype.kind == "f":
        misused("a list of reals is no policy", "returns of episodes are given as `score(task, returns=[...])`")
    if model is None:
        refuse(f"a table of actions needs an exact model: {results.why_not}")
    plan = plan_of_table(model, array)
    return Valued(Return(solve.policy_return(model, plan)), "probabilities" if array.dtype.kind == "f" else "actions")


def _as_expert(expert: Expert, results: Results) -> Valued:
    """The expert knows its own return, and the probabilities behind its actions."""
    results = results if expert.given is None else expert.results
    value = results.expert
    if value is None:
        refuse(f"the expert of {expert.task.name} has no return: {results.why_not}")
    return Valued(value, "probabilities" if value.exact else "samples")


def plan_of_table(model: Model, table: Array) -> Plan:
    """Actions (S,) or (T, S), or probabilities (A, S) or (T, A, S).

    Raises:
        SpecError: E713 for another table.
    """
    a, n = model.n_actions, model.n_states
    if table.dtype.kind in "iu" and table.shape[-1:] == (n,) and table.ndim <= 2 and table.shape != (a, n):
        if not ((table >= 0) & (table < a)).all():
            misused(f"an action of the table is none of 0 to {a - 1}")
        hot = np.moveaxis(np.eye(a)[table], -1, -2)
        return stationary(hot) if table.ndim == 1 else timed(list(hot))
    if table.shape[-2:] != (a, n) or table.ndim > 3:
        misused(f"a table of probabilities has shape ({a}, {n}) or (T, {a}, {n}), not {table.shape}")
    table = table.astype(np.float64)
    if not np.allclose(table.sum(axis=-2), 1) or (table < 0).any():
        misused("the probabilities of the actions in a state are at least 0, and sum to 1")
    return stationary(table) if table.ndim == 2 else timed(list(table))


class _Varies(Exception):
    """A policy does not give the same actions each time it is asked about the same states."""


def plan_of_function(model: Model, policy: Callable[[State, int], Mapping[str, Any]]) -> Plan:
    """A function from states by component, (*shape, S), and the time to actions by component.

    Raises:
        _Varies: when its actions are not always the same.
    """

    def ask(t: int) -> Array:
        states = {name: v.copy() for (role, name), v in model.reads(t).items() if role is Role.STATE}
        chosen = policy(states, t)
        values = [np.asarray(chosen[c.name]) for c in model.actions.components]
        return one_hot(model, [np.broadcast_to(v, (*v.shape[:-1], model.n_states)) for v in values])

    def at(t: int) -> Array:
        first = ask(t)
        if any(not np.array_equal(first, ask(t)) for _ in range(ASKS - 1 if t == 0 else 1)):
            raise _Varies
        return first

    return at


def one_hot(model: Model, values: list[Array]) -> Array:
    """Actions by component (*shape, S) as probabilities (A, S)."""
    code, outside = model.actions.encode(values, model.n_states)
    if outside is not None and outside.any():
        state = model.state_name(int(np.flatnonzero(outside)[0]))
        raise SpecError([Diagnostic("E706", None, f"the policy chose an action outside the action space in {state}")])
    table = np.zeros((model.n_actions, model.n_states))
    table[code, np.arange(model.n_states)] = 1.0
    return table


# -- objects with `predict` -----------------------------------------------------------------------


def _predicted(asked: Asked, results: Results) -> Valued:
    """The value of an object with `predict`, asked about every state at once, or in episodes."""
    model = results.model
    if model is not None and model.task is asked.task and (asked.sees_state_alone or asked.sees_time):
        for way in _ANSWERS:
            plan = _plan(asked, model, _ANSWERS[way])
            if plan is not None:
                return Valued(Return(solve.policy_return(model, plan)), way)
    memory: list[Any] = [None]

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        actions, memory[0] = asked.actions(state, t, rng, None if t == 0 else memory[0], start=t == 0)
        return actions

    return Valued(results.simulated(choose), "samples")


def _plan(asked: Asked, model: Model, answer: Callable[[Asked, Model, int], Array | None]) -> Plan | None:
    """The policy's answers for all states as a plan; None where there is one of no such kind."""
    horizon = model.task.horizon
    if asked.sees_state_alone:
        table = answer(asked, model, 0)
        return None if table is None else stationary(table)
    if horizon is None:
        return None
    tables = [answer(asked, model, t) for t in range(horizon)]
    known = [table for table in tables if table is not None]
    return timed(known) if len(known) == len(tables) else None


def _chances(asked: Asked, model: Model, t: int) -> Array | None:
    found = asked.probabilities(_states(model), t)
    if found is None:
        return None
    wanted = (model.n_actions, model.n_states)
    if found.shape != wanted or not np.allclose(found.sum(axis=0), 1) or (found < 0).any():
        misused(
            f"`action_probabilities` gives rows of {wanted[0]} probabilities that sum to 1, one for each observation"
        )
    return found


def _constant(asked: Asked, model: Model, t: int) -> Array | None:
    chosen = asked.constant_actions(_states(model), t)
    return None if chosen is None else one_hot(model, [chosen[c.name] for c in model.actions.components])


_ANSWERS: dict[Asking, Callable[[Asked, Model, int], Array | None]] = {"probabilities": _chances, "actions": _constant}


def _states(model: Model) -> State:
    return {name: v for (role, name), v in model.reads().items() if role is Role.STATE}


class Expert:
    """The task's expert as a policy: with `predict` for Stable-Baselines3, with spaces and callable for imitation.

    The recurrent state that `predict` hands back counts the steps of each environment, so that
    experts may depend on the time. `gap` certifies how far it is below the optimum.

    Args:
        task: the task, its id or its path.
        policy: another expert than the spec's: "optimal", or "soft(b)", Boltzmann-rational at inverse temperature b.
        seed: of its draws.

    Raises:
        SpecError: E712, where the spec gives no expert, or it looks at what is not observed; E713 for another policy.
    """

    def __init__(self, task: TaskLike, policy: str | None = None, *, seed: int = 0) -> None:
        task = load(task)
        self.given = _given(policy)
        if task.expert is None and self.given is None:
            refuse(f"{task.name} gives no expert")
        self.task, self.results = task, Results(task, expert=self.given)
        self.rng = np.random.default_rng(seed)
        self.observation, self.action = spaces.observation_layout(task), spaces.action_layout(task)
        self.where = _where_states_are(task)

    @property
    def gap(self) -> float | None:
        """The optimal return minus the expert's; None where there is no exact model."""
        best, own = self.results.optimal, self.results.expert
        return None if best is None or own is None else best.value - own.value

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Actions for one observation or a batch of them, and the steps taken so far in each.

        Args:
            state: what the last call handed back, or None.
            episode_start: (N,) whether an episode begins with this observation.
            deterministic: take the most likely action instead of drawing one.
        """
        single, batch = self._split(observation)
        steps = np.zeros(len(batch), np.int64) if state is None else np.asarray(state[0]).copy()
        if episode_start is not None:
            steps[np.asarray(episode_start, np.bool_).reshape(-1)] = 0
        actions = [self._choose(one, int(t), deterministic) for one, t in zip(batch, steps, strict=True)]
        packed = [spaces.pack(self.action, action) for action in actions]
        return (packed[0] if single else np.stack(packed)), (steps + 1,)

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

    def _choose(self, observation: Any, t: int, deterministic: bool) -> list[tuple[Any, ...]]:
        state = self._state(observation)
        if isinstance(self.task.expert, tuple) and self.given is None:
            from taskspec.exact.simulation.rollout import by_expert

            chosen = by_expert(self.task)(state, t, self.rng)
            return [tuple(np.asarray(chosen[c.name]).reshape(-1).tolist()) for c in self.task.action]
        return self._planned(state, t, deterministic)

    def _planned(self, state: State, t: int, deterministic: bool) -> list[tuple[Any, ...]]:
        model, plan = self.results.model, self.results.expert_plan
        if model is None or plan is None:
            refuse(f"the expert of {self.task.name} needs an exact model: {self.results.why_not}")
        found = self.results.abstraction
        mapped = state if found is None else found.map(state)
        code, _ = model.states.encode([mapped[c.name] for c in model.states.components], 1)
        row = plan(t)[:, int(np.searchsorted(model.codes, code[0]))]
        action = int(row.argmax()) if deterministic else int(self.rng.choice(len(row), p=row / row.sum()))
        values = model.actions.decode(np.array([action]))
        return [tuple(values[Role.ACTION, c.name].reshape(-1).tolist()) for c in model.actions.components]

    def _state(self, observation: Any) -> dict[str, Array]:
        flats = spaces.unpack(self.observation, observation)
        state = {}
        for c in self.task.state:
            value = np.array(flats[self.where[c.name]]).reshape(*c.type.shape, 1)
            state[c.name] = value if c.type.kind == 2 else np.rint(value).astype(np.int64)
        return state


def _given(policy: str | None) -> Given:
    """The expert of a name; None for that of the spec."""
    if policy is None:
        return None
    if policy == "optimal":
        return "optimal"
    found = _SOFT.fullmatch(str(policy))
    try:
        beta = float(found[1]) if found else math.nan
    except ValueError:
        beta = math.nan
    if not math.isfinite(beta):
        misused(f"{policy!r} is no expert", '"optimal", or "soft(1)" with a number')
    return Soft(beta)


def _where_states_are(task: Task) -> dict[str, int]:
    """For every state component the number of the observed one that shows it as it is."""
    found: dict[str, int] = {}
    for i, node in enumerate(task.observation.nodes):
        if isinstance(node, Read) and node.role is Role.STATE:
            found.setdefault(node.name, i)
    missing = [c.name for c in task.state if c.name not in found]
    if missing:
        refuse(f"the expert of {task.name} looks at {', '.join(missing)}, which the observation does not show")
    return found
