"""Transitions and trajectories of episodes, how they are recorded, and demonstrations."""

from __future__ import annotations

import math
import multiprocessing
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import count, islice
from typing import Any, TypeAlias

import numpy as np

from taskspec.base import __version__
from taskspec.base.arrays import Array, end_to_end, map_parts, part_at, parts_of
from taskspec.base.diagnostics import spec_error
from taskspec.base.extras import need
from taskspec.base.limits import tell
from taskspec.envs.options import positive, seed_of
from taskspec.exact.model.model import misused
from taskspec.exact.policies.adapters import asked, policy_of
from taskspec.exact.policies.policy import EpisodeBatch, SeededDraws, TaskPolicy
from taskspec.language import draws
from taskspec.language.registry import load, role
from taskspec.language.task.parts import by_name
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs.numpy import NumpyEngine
from taskspec.programs.vector_program import BadActionError, Options

Seen: TypeAlias = Any
"""Observations, or actions: an array, or a dict of arrays, with as many rows; the space of the task says which."""
EXTRA = "imitation"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An episode, or a segment of one, of T steps.

    Attributes:
        obs: T + 1 observations, the first and the last included.
        acts: T actions.
        rews: float64 (T,).
        terminated, truncated: whether the last step came to a terminal state, or to the horizon.
    """

    obs: Seen
    acts: Array
    rews: Array
    terminated: bool
    truncated: bool

    def __len__(self) -> int:
        return len(self.rews)


@dataclass(frozen=True, eq=False)
class Transitions:
    """N transitions, episode after episode, in order of time.

    Attributes:
        obs, next_obs: observations before and after each step, (N, *shape) of int64 or float32, or a dict of such arrays.
        acts: (N, *shape), int64 or float32, as the environment takes them.
        rews: float64 (N,).
        terminated, truncated: bool (N,), as the environment gives them.
        episode: int64 (N,), the number of the episode; steps of one are neighbours.
        time: int64 (N,), the steps that were taken in the episode before.
    """

    obs: Seen
    acts: Array
    rews: Array
    next_obs: Seen
    terminated: Array
    truncated: Array
    episode: Array
    time: Array

    def __len__(self) -> int:
        return len(self.rews)

    @property
    def dones(self) -> Array:
        """bool (N,): whether the episode ended with this step, in a terminal state or at the horizon."""
        return np.asarray(self.terminated | self.truncated)

    @cached_property
    def starts(self) -> Array:
        """int64 (E,): the first transition of each episode."""
        return np.flatnonzero(np.diff(self.episode, prepend=-1))

    @cached_property
    def lengths(self) -> Array:
        """int64 (E,): the steps of each episode."""
        return np.diff(self.starts, append=len(self))

    @cached_property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """The episodes one by one."""
        parts = []
        for first, length in zip(self.starts.tolist(), self.lengths.tolist(), strict=True):
            end = first + length
            obs = end_to_end([part_at(self.obs, slice(first, end)), part_at(self.next_obs, slice(end - 1, end))])
            over = (bool(self.terminated[end - 1]), bool(self.truncated[end - 1]))
            parts.append(Trajectory(obs, self.acts[first:end], self.rews[first:end], *over))
        return tuple(parts)

    def returns(self, discount: float = 1.0) -> Array:
        """Sum the rewards of each episode.

        Args:
            discount: of rewards, from the first step of the episode.

        Returns:
            float64 (E,).
        """
        first = np.repeat(self.time[self.starts], self.lengths)
        weights = discount ** (self.time - first).astype(np.float64)
        return np.add.reduceat(weights * self.rews, self.starts)

    def rows(self, indices: Array) -> Transitions:
        """Select transitions.

        Args:
            indices: int64 (n,), or a mask, bool (N,).

        Returns:
            the transitions in that order.
        """
        return Transitions(**{name: part_at(value, indices) for name, value in columns(self).items()})

    def imitation(self) -> list[Any]:
        """Convert to imitation.

        Returns:
            a `TrajectoryWithRew` for each episode.

        Raises:
            SpecError: E705 where imitation is not installed.
        """
        types = need("imitation.data.types", EXTRA, "this")
        copies = []
        for t in self.trajectories:
            obs = t.obs
            if isinstance(obs, dict):
                obs = types.DictObs(obs)
            ended = t.terminated or t.truncated
            copies.append(types.TrajectoryWithRew(obs=obs, acts=t.acts, rews=t.rews, infos=None, terminal=ended))
        return copies


COLUMNS = ("obs", "acts", "rews", "next_obs", "terminated", "truncated", "episode", "time")


def columns(data: Transitions) -> dict[str, Any]:
    """Return the arrays of transitions by name."""
    return {name: getattr(data, name) for name in COLUMNS}


def concatenated(parts: Iterable[Transitions]) -> Transitions:
    """Join transitions one after the other; at least one part."""
    by_part = [columns(part) for part in parts]
    joined = {}
    for name in COLUMNS:
        joined[name] = end_to_end([arrays[name] for arrays in by_part])
    return Transitions(**joined)


# Episodes of a policy, recorded: many at once, in several processes, and the same whatever their number.
#
# Episode i is the first one of the scalar environment after `reset(seed=seed + i)`. What a policy draws in it comes from words
# of the same seed, of a phase of their own (`draws.POLICY`).

Part = tuple[int, int]  # the first episode and how many
LANES = 256  # episodes that are stepped together, at most
NUMBERS = 2**23  # numbers that are kept of these at once, about
LONGEST = 20_000  # steps after which an episode without a horizon is taken never to end


def recorded(
    task: Task, policy: Any, episodes: int | None, transitions: int | None, seed: int, jobs: int
) -> Transitions:
    """Whole episodes: so many, or as many as make at least so many transitions."""
    numbers = sum(max(1, math.prod(part.shape)) for part in task.observation_layout.parts) + 8
    size = max(1, min(LANES, NUMBERS // (numbers * (task.horizon or 1000))))  # a function of the task alone
    _check_sent(policy, jobs)
    with _mapping(jobs) as run:
        if episodes is not None:
            whole = [(first, min(size, episodes - first)) for first in range(0, episodes, size)]
            return concatenated(run(partial(_record, task, policy, seed), iter(whole)))
        assert transitions is not None
        endless = ((first, size) for first in count(0, size))
        parts = []
        total = 0
        while total < transitions:
            parts += list(run(partial(_record, task, policy, seed), islice(endless, jobs)))
            total = sum(map(len, parts))
    data = concatenated(parts)
    enough = int(np.searchsorted(np.cumsum(data.lengths), transitions)) + 1
    return data.rows(np.arange(int(data.lengths[:enough].sum())))


def _check_sent(policy: Any, jobs: int) -> None:
    """Refuse (E713) a policy that cannot be sent to other processes, where there are to be some."""
    try:
        if jobs > 1:
            pickle.dumps(policy)
    except Exception as error:
        message = f"the policy cannot be sent to other processes: {error}"
        raise spec_error("E713", message, "jobs=1, or a function of a module") from error


Run = Callable[[Callable[[Part], Transitions], Iterator[Part]], Iterable[Transitions]]


@contextmanager
def _mapping(jobs: int) -> Iterator[Run]:
    """Yield a way to record many parts, in order: here or in other processes."""
    if jobs == 1:
        yield map
        return
    context = multiprocessing.get_context("spawn")  # a process forked from threads may wait for ever
    with ProcessPoolExecutor(jobs, context) as pool:
        yield pool.map


def _record(task: Task, policy: Any, seed: int, part: Part) -> Transitions:
    first, lanes = part
    acting = policy_of(task, policy)
    seeds = draws.lane_seeds(seed, lanes, first)
    task = acting.task
    engine = NumpyEngine(task, lanes, Options("same_step"))
    engine.seed(seeds)
    engine.reset()
    b = engine.buffers
    rows = []  # of the steps: observations, actions, rewards, observations after, two kinds of ends, the lanes that run
    running = np.ones(lanes, np.bool_)
    for t in count():
        if t >= LONGEST and task.horizon is None:
            who = f"episodes of {acting.name} on {task.id}"
            misused(f"{who} are still running after {LONGEST:,} steps", "give the task a horizon")
        tell(f"episodes {first + 1:,} to {first + lanes:,}, step {t + 1:,}")
        seen = b.seen.view(copy=True)
        state = by_name(task.state, b.state)
        actions = asked(acting, EpisodeBatch(t, state, seen, SeededDraws(seeds, t), running), policy)
        _step(engine, actions, task, acting)
        after = _after(b.seen.view(copy=True), b.final.view(), b.ended)
        rows.append((seen, actions, b.reward.copy(), after, b.terminated.copy(), b.truncated.copy(), running))
        running = running & ~b.ended
        if not running.any():
            return _transitions(rows, first)
    raise AssertionError


def _step(engine: NumpyEngine, actions: Any, task: Task, acting: TaskPolicy) -> None:
    try:
        engine.step(actions)
    except BadActionError:
        shown = np.array2string(np.asarray(actions)[:3], separator=", ", threshold=12).replace("\n", "")
        message = f"the policy {acting.name} gave a value that is not an action of {task.id}, among {shown}"
        raise spec_error("E706", message, f"an action is one of {task.action_space}") from None


def _after(seen: Any, final: Any, ended: Array) -> Any:
    """Observations that a step leads to: where an episode has ended, its last one."""
    for part, last in zip(parts_of(seen), parts_of(final), strict=True):
        part[ended] = last[ended]
    return seen


def _transitions(rows: Sequence[tuple[Any, ...]], first: int) -> Transitions:
    """Order steps of many lanes by lane; the lanes' episodes are numbered from `first`."""
    by_lane = [map_parts(_side_by_side, *steps) for steps in zip(*rows, strict=True)]
    running = by_lane.pop()
    seen, actions, rewards, after, terminated, truncated = (part_at(each, running) for each in by_lane)
    lane, time = np.nonzero(running)
    return Transitions(seen, actions, rewards, after, terminated, truncated, lane + first, time)


def _side_by_side(*steps: Array) -> Array:
    return np.stack(steps, axis=1)


# Demonstrations: episodes of a policy where the spec says that the expert acts.


@dataclass(frozen=True, eq=False)
class Demonstrations(Transitions):
    """Transitions of whole episodes, and what they are of.

    Attributes:
        metadata: plain data: `kind`, `id`, `instance`, `variant`, `parameters`, `modifiers`, `content_hash`, `policy`, `seed`,
            `episodes`, `transitions`, `return` (the policy's expected return, where an exact model tells it), and `versions`.
        task: what was acted in; None for data read from a file.
    """

    metadata: Mapping[str, Any] = field(default_factory=dict)
    task: Task | None = None


def demonstrations(
    task: TaskLike, policy: Any = "expert", *, episodes: int | None = None, transitions: int | None = None, seed: int = 0,
    jobs: int = 1,
) -> Demonstrations:  # fmt: skip
    """Record episodes of a policy, in the variant in which the spec's `roles` have the expert act.

    Episode i is the first one of the scalar environment after `reset(seed=seed + i)`, for any number of jobs.

    Args:
        task: the task, its id or its path.
        policy: "random", "expert", "optimal", "soft(1)", "epsilon(0.1)" with any numbers; "model.py:fn"; a function from an
            observation to an action, which may take a generator as `rng`; or an object with `predict(observations)`.
        episodes: how many; 100 unless `transitions` are given.
        transitions: as many whole episodes as make at least so many.
        seed: of the first episode.
        jobs: processes. With more than one, functions and objects have to be those of modules that can be imported.

    Returns:
        N transitions of all episodes, one after the other: observations and actions in the types of their spaces, rewards
        float64 (N,).

    Raises:
        SpecError: E706 for actions that are none, E712 where an exact model is needed and there is none, E713 for a policy that
            the task does not have, or for another option.
    """
    demonstrated = role(load(task), "expert")
    if episodes is not None and transitions is not None:
        misused("`episodes` and `transitions` cannot be combined")
    if transitions is None:
        episodes = positive("episodes", 100 if episodes is None else episodes)
    else:
        transitions = positive("transitions", transitions)
    acting = policy_of(demonstrated, policy)
    seed = seed_of(seed)
    data = recorded(demonstrated, policy, episodes, transitions, seed, positive("jobs", jobs))
    told = described(demonstrated, "demonstrations", acting, seed)
    told |= {"episodes": len(data.starts), "transitions": len(data)}
    return Demonstrations(**columns(data), metadata=told, task=demonstrated)


def described(task: Task, kind: str, acting: TaskPolicy, seed: int) -> dict[str, Any]:
    """Return what data is of, as plain data."""
    value = acting.value
    told = None
    if value is not None:
        told = {"value": value.value, "bound": value.bound, "status": value.status}
    return {
        "kind": kind, "id": task.id, "instance": task.instance_id,
        "variant": task.source.variant, "parameters": dict(task.values),
        "modifiers": list(map(str, task.modifiers)), "horizon": task.horizon, "discount": task.discount,
        "content_hash": task.content_hash, "policy": acting.name, "seed": seed, "return": told,
        "versions": {"taskspec": __version__, "numpy": np.__version__},
    }  # fmt: skip
