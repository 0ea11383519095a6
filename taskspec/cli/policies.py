"""Policies that `taskspec run` can roll out: those with a name, a script of actions, a function of a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.batch import DTYPES
from taskspec.policies.adapters import ObservationPolicy, policy_of
from taskspec.policies.files import ScriptedPolicy, is_function, is_script
from taskspec.policies.named import is_name, unknown
from taskspec.policies.policy import EpisodeBatch, SharedDraws, TaskPolicy, observation_of
from taskspec.task.observe import recall
from taskspec.task.spaces import pack, unpack
from taskspec.task.task import Component, Task

if TYPE_CHECKING:
    from taskspec.envs import Environment

Act = Callable[[Any], Any]
"""From the observation just made to an action; raises ScriptEnd where there is none."""
Flat = tuple[Any, ...]


def policy_for(name: str, env: Environment, seed: int) -> Act:
    """Return a policy that acts in an environment, one episode after the other.

    Raises:
        SpecError: for a policy that does not exist, or that this task does not have.
    """
    if name == "random":
        env.action_space.seed(seed % 2**32)
        return lambda observation: env.action_space.sample()
    task = env.task
    if is_script(name):
        policy: TaskPolicy = ScriptedPolicy(Path(name), task, _action_words(task))
    elif is_function(name) or is_name(name):
        policy = policy_of(task, name)
    else:
        unknown(name, ("a .json or .csv file of actions", "FILE.py:FUNCTION"))
    draws = SharedDraws(np.random.default_rng(seed), 1)
    running = np.ones(1, np.bool_)
    if isinstance(policy, ObservationPolicy):

        def act(observation: Any) -> Any:
            batch = EpisodeBatch(env.time, {}, _one(observation), draws, running)
            return observation_of(np.asarray(policy.act(batch)), 0)

        return act
    memory = task.memory if policy.task.remembers else None
    kept: list[Flat] = []
    last: list[Flat] = []

    def act_by_state(observation: Any) -> Any:
        states = {c.name: _state_array(c, env.state[c.name]) for c in task.state}
        if memory is not None:
            kept[:] = recall(task, memory, unpack(task.observation_layout, observation), kept, last, env.time)
            states |= {c.name: _array(c, flat) for c, flat in zip(memory.components, kept, strict=True)}
        chosen = policy.choose(EpisodeBatch(env.time, states, None, draws, running))
        last[:] = [tuple(np.asarray(chosen[c.name]).reshape(-1).tolist()) for c in task.action]
        return pack(policy.actions, last)

    return act_by_state


def _state_array(c: Component, value: Any) -> Array:
    """Return a state component of an environment as a batch of one, (*shape, 1)."""
    if c.domain is not None and not c.type.shape:
        return _array(c, (c.domain.index(value),))
    return _array(c, tuple(np.asarray(value).ravel().tolist()))


def _array(c: Component, flat: Flat) -> Array:
    """Return a flat value of a component as a batch of one."""
    return np.array(flat, DTYPES[c.type.kind]).reshape(*c.type.shape, 1)


def _one(observation: Any) -> Any:
    """Return an observation as a batch of one."""
    if isinstance(observation, dict):
        return {name: np.asarray(part)[None] for name, part in observation.items()}
    return np.asarray(observation)[None]


def _action_words(task: Task) -> str:
    from taskspec.task.record import domain_words, space_words

    listed = ", ".join(f"{c.name}: {domain_words(c)}" for c in task.action)
    return f"{listed} ({space_words(task.action_layout)})"
