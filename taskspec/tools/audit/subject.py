"""The environment under audit: how it is made, and traces of actions that anyone can play again."""

from __future__ import annotations

import copy
import json
import math
import random
import re
import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from taskspec.base.diagnostics import spec_error
from taskspec.exact.policies.python_files import function_of, is_function
from taskspec.learn.jobs.work import Late, interrupted, late

MOST_STEPS = 1000
"""Steps after which a random episode is cut."""
PATIENCE = 20.0
"""Seconds that a step or a reset may take."""
_PART = re.compile(r"\s*([a-z]?)(\d*):(?=\[)")


@dataclass(frozen=True)
class TracePart:
    """Consecutive actions of one instance, which is reset first where there is a seed."""

    seed: int | None
    actions: tuple[Any, ...] = ()
    instance: str = ""


class Deadline:
    """The end of some seconds of this process, or of four times as many on the clock, for environments that wait."""

    def __init__(self, seconds: float) -> None:
        self._busy = time.process_time() + seconds
        self._clock = time.monotonic() + 4 * seconds

    @property
    def is_over(self) -> bool:
        return time.process_time() > self._busy or time.monotonic() > self._clock


Trace = tuple[TracePart, ...]
"""Parts in the order in which they are played; instances with different letters live side by side."""


@dataclass(frozen=True)
class EnvStep:
    """The result of a reset (its action is None) or a step; `seen` and `seen_info` are copies that can be compared."""

    action: Any
    observation: Any = None
    seen: Hashable = None
    reward: Any = 0.0
    terminated: Any = False
    truncated: Any = False
    info: Any = None
    seen_info: Hashable = None
    error: str | None = None

    @property
    def paid(self) -> float:
        """The reward as a number; nan where it is none."""
        try:
            return float(self.reward)
        except (TypeError, ValueError):
            return math.nan

    @property
    def is_last(self) -> bool:
        return bool(self.error or self.terminated or self.truncated)

    @property
    def outcome(self) -> tuple[Any, ...]:
        """All that a learner is given, for comparisons."""
        return self.seen, frozen(self.reward), bool(self.terminated), bool(self.truncated), self.error


@dataclass(frozen=True)
class EnvEpisode:
    """An episode of random actions, from its reset on."""

    seed: int
    steps: tuple[EnvStep, ...]

    @property
    def actions(self) -> tuple[Any, ...]:
        return tuple(step.action for step in self.steps[1:])

    def trace(self, length: int | None = None) -> Trace:
        """Return the first steps of the episode as a trace."""
        return (TracePart(self.seed, self.actions[:length]),)


class EnvInstance:
    """One instance of the environment; exceptions of the environment become steps with an error."""

    def __init__(self, env: Any) -> None:
        self.env = env

    def copy(self) -> EnvInstance:
        return EnvInstance(copy.deepcopy(self.env))

    def reset(self, seed: int) -> EnvStep:
        try:
            with interrupted(PATIENCE):
                observation, info = self.env.reset(seed=seed)
            return EnvStep(None, observation, frozen(observation), info=info, seen_info=frozen(info))
        except (Exception, Late) as error:
            return EnvStep(None, error=f"reset {_words(error)}")

    def step(self, action: Any) -> EnvStep:
        try:
            with interrupted(PATIENCE):
                observation, reward, terminated, truncated, info = self.env.step(action)
            return EnvStep(action, observation, frozen(observation), reward, terminated, truncated, info, frozen(info))
        except (Exception, Late) as error:
            return EnvStep(action, error=f"step {_words(error)}")

    def play(self, part: TracePart) -> list[EnvStep]:
        """Play a part of a trace, up to an error."""
        steps: list[EnvStep] = []
        if part.seed is not None:
            steps.append(self.reset(part.seed))
        for action in part.actions:
            if steps and steps[-1].error:
                break
            steps.append(self.step(action))
        return steps


def _words(error: BaseException) -> str:
    if isinstance(error, Late):
        return late(PATIENCE).replace("it took", "takes")
    text = " ".join(str(error).split())
    return f"raises {type(error).__name__}: {text[:200]}".rstrip(": ")


class Subject:
    """An environment by its Gymnasium id, or by a function of a Python file that makes it.

    `longest` is how many seconds an episode may take.

    Raises:
        SpecError: E713 where it cannot be made.
    """

    def __init__(self, name: str, kwargs: Mapping[str, Any]) -> None:
        self.name = name
        self.kwargs = dict(kwargs)
        self.longest = math.inf
        self._function = None
        if is_function(name):
            self._function = function_of(name, "(**kwargs)")
        env = self.make().env
        self.observation_space = env.observation_space
        self.action_space = copy.deepcopy(env.action_space)
        self.limit: int | None = None
        if env.spec is not None:
            self.limit = env.spec.max_episode_steps

    def make(self) -> EnvInstance:
        try:
            if self._function is None:
                return EnvInstance(gymnasium.make(self.name, disable_env_checker=True, **self.kwargs))
            return EnvInstance(self._function(**self.kwargs))
        except Exception as error:
            raise spec_error("E713", f"'{self.name}' cannot be made; it {_words(error)}") from error

    def play(self, trace: Trace, world: int = 0) -> list[EnvStep]:
        """Play a trace in new instances; `world` seeds the global generators, on which nothing should depend."""
        random.seed(world)
        np.random.seed(world)  # noqa: NPY002
        instances: dict[str, EnvInstance] = {}
        steps = []
        for part in trace:
            if part.instance not in instances:
                instances[part.instance] = self.make()
            steps += instances[part.instance].play(part)
        return steps

    def episode(self, seed: int, instance: EnvInstance | None = None, repeat: Any = None) -> EnvEpisode:
        """Return an episode of random actions, or of one action again and again; it is cut where it takes too long."""
        end = Deadline(self.longest)
        instance = instance or self.make()
        self.action_space.seed(seed)
        steps = [instance.reset(seed)]
        while not steps[-1].is_last and len(steps) <= MOST_STEPS and not end.is_over:
            action = self.action_space.sample() if repeat is None else repeat
            steps.append(instance.step(action))
        return EnvEpisode(seed, tuple(steps))

    def actions(self, most: int = 64) -> list[Any] | None:
        """Return all actions; None where there are too many, or infinitely many."""
        spaces = gymnasium.spaces
        match self.action_space:
            case spaces.Discrete() as space if space.n <= most:
                return [space.start + i for i in range(space.n)]
            case spaces.MultiDiscrete(nvec=nvec) | spaces.MultiBinary(shape=nvec) if np.size(nvec) <= 6:
                counts = nvec
                if not isinstance(self.action_space, spaces.MultiDiscrete):
                    counts = (2,) * int(np.prod(nvec))
                if int(np.prod(counts)) <= most:
                    return [np.array(each, self.action_space.dtype) for each in np.ndindex(*np.ravel(counts))]
        return None

    def text(self, trace: Trace) -> str:
        """Return a trace as text: `3:[0,1]` is a reset with seed 3 and two actions."""
        parts = []
        for part in trace:
            actions = json.dumps(self.action_space.to_jsonable(list(part.actions)), separators=(",", ":"))
            seed = str(part.seed) if part.seed is not None else ""
            parts.append(f"{part.instance}{seed}:{actions}")
        return " ".join(parts)

    def read(self, text: str) -> Trace:
        """Return the trace of a text (see `text`).

        Raises:
            SpecError: E713 for a text that is no trace.
        """
        parts = []
        at = 0
        try:
            while text[at:].strip():
                head = _PART.match(text, at)
                if head is None:
                    raise ValueError("a part is missing")
                actions, at = json.JSONDecoder().raw_decode(text, head.end())
                seed = int(head[2]) if head[2] else None
                parts.append(TracePart(seed, tuple(self.action_space.from_jsonable(actions)), head[1]))
        except (ValueError, TypeError) as error:
            hint = "a seed and actions, such as 3:[0,1]; letters name instances: a3:[0] b4:[1] a:[0]"
            raise spec_error("E713", f"'{text}' is not a trace: {error}", hint) from None
        return tuple(parts)

    def script(self, trace: Trace) -> str:
        """Return Python code that plays a trace without this package."""
        given = [f"{name}={value!r}" for name, value in self.kwargs.items()]
        if self._function is None:
            lines = ["import gymnasium as gym"]
            made = f"gym.make({', '.join([repr(self.name), *given])})"
        else:
            place, _, function = self.name.rpartition(":")
            lines = ["import runpy"]
            made = f"runpy.run_path({place!r})[{function!r}]({', '.join(given)})"
        known: set[str] = set()
        for part in trace:
            name = f"env_{part.instance}".rstrip("_")
            if name not in known:
                lines.append(f"{name} = {made}")
            known.add(name)
            if part.seed is not None:
                lines.append(f"print({name}.reset(seed={part.seed}))")
            if part.actions:
                actions = self.action_space.to_jsonable(list(part.actions))
                lines += [f"for action in {actions}:", f"    print({name}.step(action))"]
        return "\n".join(lines)


def frozen(value: Any) -> Hashable:
    """Return an observation or another value in a form that can be compared and hashed."""
    match value:
        case dict():
            names = sorted(value, key=str)
            return tuple(zip(map(str, names), [frozen(value[name]) for name in names], strict=True))
        case tuple() | list():
            return tuple(map(frozen, value))
        case str() | bytes() | None:
            return value
    array = np.asarray(value)
    if array.dtype.kind in "biuf":
        return (array.shape, (array.astype(np.float64) + 0.0).tobytes())
    return repr(value)


def shown(value: Any, most: int = 60) -> str:
    """Return an observation or a reward in a few words."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {shown(inner, most)}' for key, inner in value.items())}}}"
    if isinstance(value, np.ndarray) and value.size > most // 4:
        return f"an array {value.shape}"
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    text = " ".join(repr(value).split())
    if len(text) <= most:
        return text
    return f"{text[: most - 4]} ..."


def first_difference(one: Sequence[EnvStep], other: Sequence[EnvStep]) -> int | None:
    """Return the number of the first step that differs; None where there is none."""
    for i, (a, b) in enumerate(zip(one, other, strict=False)):
        if a.outcome != b.outcome:
            return i
    if len(one) == len(other):
        return None
    return min(len(one), len(other))
