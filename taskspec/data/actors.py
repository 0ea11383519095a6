"""Policies as they act in many episodes at once, and policies from Python files."""

from __future__ import annotations

import importlib.util
import inspect
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from taskspec import draws
from taskspec.backends.buffers import Values
from taskspec.backends.numpy.engine import write
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.policies.named import Named, named, unknown
from taskspec.rollout.rollout import State
from taskspec.scores.returns import Return
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task

# ---------- functions
# Policies from files of Python: `model.py:fn`, a function from the observation to the action, or an object with `predict`.


def is_function(name: str) -> bool:
    """Whether a policy's name means a function of a file."""
    return ".py:" in name


def place_of(name: str) -> tuple[Path, str]:
    """The file of `model.py:fn`, and the name of the function; nothing is run.

    Raises:
        SpecError: E710 when there is no such file.
    """
    place, _, attribute = name.rpartition(":")
    if not Path(place).is_file():
        raise SpecError([Diagnostic("E710", None, f"there is no file '{place}'")])
    return Path(place), attribute


def function_of(name: str, form: str = "(observation)") -> Any:
    """The function, or the object with `predict`, that a name `model.py:fn` means. The file is run.

    Args:
        form: what a hint says about its arguments.

    Raises:
        SpecError: E710, E711 when there is no such file, or it fails; E713 when it has nothing of that name that acts.
    """
    path, attribute = place_of(name)
    found = getattr(_module(path), attribute, None)
    if not (callable(found) or hasattr(found, "predict")):
        message = f"'{path}' has no function '{attribute}', nor an object of that name with `predict`"
        raise SpecError([Diagnostic("E713", None, message, f"def {attribute or 'act'}{form}: ...")])
    return found


def _module(path: Path) -> Any:
    """The module that a file makes, run anew; what lies beside it can be imported, as by a script."""
    name = f"{path.stem}_{zlib.crc32(str(path.resolve()).encode()):08x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses look for the module of a class
    sys.path.insert(0, str(path.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        message = f"'{path}' cannot be run: {type(error).__name__}: {error}"
        raise SpecError([Diagnostic("E711", None, message)]) from error
    finally:
        sys.path.pop(0)
    return module


# ---------- actors
# Policies as they act in many episodes at once: those with a name, functions of the observation, objects with `predict`.


@dataclass(frozen=True, slots=True)
class Now:
    """What N episodes are at, all of them after as many steps.

    `seeds` uint64 (N,); `running` bool (N,), those that have not ended; `seen` the observations, lanes first; `state` by
    component, (*shape, N).
    """

    t: int
    seeds: Array
    running: Array
    seen: Any
    state: State


class Actor(Protocol):
    """A policy in many episodes; what it draws is a function of an episode's seed and of the step."""

    name: str
    task: Task
    """What is acted in; its state may have the memory of an expert in it."""

    def act(self, now: Now) -> Any:
        """Actions (N, *shape), as the environment takes them."""

    @property
    def value(self) -> Return | None:
        """The expected return where it is known exactly."""


def actor_of(task: Task, policy: Any) -> Actor:
    """The actor of a policy's name, of `model.py:fn`, of a function, or of an object with `predict`.

    Raises:
        SpecError: E713 for what is no policy; see `exact.scoring.named.named` and `data.functions.function_of`.
    """
    if isinstance(policy, str) and not is_function(policy):
        return _Knowing(named(task, policy))
    name = policy if isinstance(policy, str) else getattr(policy, "__name__", type(policy).__name__)
    found = function_of(policy) if isinstance(policy, str) else policy
    if hasattr(found, "predict"):
        return _Predicting(task, name, found)
    if callable(found):
        return _Reacting(task, name, found)
    unknown(name, ("a function of the observation", "an object with `predict`"))


class _Knowing:
    """A named policy, which knows the state."""

    def __init__(self, policy: Named) -> None:
        self.task, self.policy, self.name, self.layout = policy.task, policy, policy.name, policy.task.action_layout

    def act(self, now: Now) -> Any:
        words = draws.lanes_block(now.seeds, draws.POLICY, now.t, self.policy.words)
        return packed(self.layout, self.task, self.policy.act(now.state, now.t, words), len(now.seeds))

    @property
    def value(self) -> Return | None:
        return self.policy.value


def packed(layout: SpaceLayout, task: Task, chosen: Any, lanes: int) -> Array:
    """Actions by component, (*shape, lanes), as the environment takes them: (lanes, *shape)."""
    held = Values.empty(layout, lanes)
    write(layout, held.segments(), [np.asarray(chosen[c.name]) for c in task.action], np.arange(lanes))
    return np.array(held.view())


class _Reacting:
    """A function from one observation to one action; where it has a parameter `rng`, it is given a generator."""

    value = None

    def __init__(self, task: Task, name: str, function: Any) -> None:
        self.task, self.name, self.function = task, name, function
        self.draws = "rng" in inspect.signature(function).parameters

    def act(self, now: Now) -> Any:
        running = np.flatnonzero(now.running)
        chosen = np.array([self._one(now, int(i)) for i in running])
        actions = np.repeat(
            chosen[:1], len(now.seeds), axis=0
        )  # what is done in episodes that are over does not matter
        actions[running] = chosen
        return actions

    def _one(self, now: Now, lane: int) -> Any:
        seen = one_of(now.seen, lane)
        if not self.draws:
            return self.function(seen)
        return self.function(seen, rng=np.random.Generator(np.random.Philox(key=[int(now.seeds[lane]), now.t])))


class _Predicting:
    """An object with `predict(observations)`, as models of Stable-Baselines3 are; it is asked for its most likely actions."""

    value = None

    def __init__(self, task: Task, name: str, policy: Any) -> None:
        self.task, self.name, self.policy, self.memory = task, name, policy, None
        self.takes = frozenset(inspect.signature(policy.predict).parameters)

    def act(self, now: Now) -> Any:
        options: dict[str, Any] = {}
        if "deterministic" in self.takes:
            options["deterministic"] = True
        if "state" in self.takes and now.t:
            options["state"] = self.memory
        if "episode_start" in self.takes:
            options["episode_start"] = np.full(len(now.seeds), now.t == 0)
        answer = self.policy.predict(now.seen, **options)
        actions, self.memory = answer if isinstance(answer, tuple) else (answer, None)
        return actions


def one_of(seen: Any, lane: int) -> Any:
    """The observation of one lane, as the scalar environment gives it."""
    if isinstance(seen, dict):
        return {name: one_of(part, lane) for name, part in seen.items()}
    return seen[lane].copy() if seen.ndim > 1 else seen[lane].item()
