"""Demonstrations: episodes of a policy where the spec says that the expert acts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

import taskspec
from taskspec.data.actors import Actor, actor_of
from taskspec.data.episodes import recorded
from taskspec.data.transitions import Transitions, columns
from taskspec.envs.options import positive, seed_of
from taskspec.exact.model.failure import misused
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike


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
    task: TaskLike,
    policy: Any = "expert",
    *,
    episodes: int | None = None,
    transitions: int | None = None,
    seed: int = 0,
    jobs: int = 1,
) -> Demonstrations:
    """Episodes of a policy, in the variant in which the spec's `roles` have the expert act.

    Episode i is the first one of the scalar environment after `reset(seed=seed + i)`, whatever the number of jobs.

    Args:
        policy: "random", "expert", "optimal", "soft(1)", "epsilon(0.1)" with any numbers; "model.py:fn"; a function from an
            observation to an action, which may take a generator as `rng`; or an object with `predict(observations)`.
        episodes: how many; 100 unless `transitions` are given.
        transitions: as many whole episodes as make at least so many.
        jobs: processes. With more than one, functions and objects have to be those of modules that can be imported.

    Raises:
        SpecError: E706 for actions that are none, E712 where an exact model is needed and there is none, E713 for a policy that
            the task does not have, or for another option.
    """
    found = role(load(task), "expert")
    if episodes is not None and transitions is not None:
        misused("`episodes` and `transitions` cannot be combined")
    if transitions is None:
        episodes = positive("episodes", 100 if episodes is None else episodes)
    else:
        transitions = positive("transitions", transitions)
    actor, seed = actor_of(found, policy), seed_of(seed)
    data = recorded(found, policy, episodes, transitions, seed, positive("jobs", jobs))
    told = described(found, "demonstrations", actor, seed) | {"episodes": len(data.starts), "transitions": len(data)}
    return Demonstrations(**columns(data), metadata=told, task=found)


def role(task: Task, who: Literal["expert", "learner"]) -> Task:
    """The task in the variant in which somebody acts; the task itself where its spec tells no roles apart."""
    key = task.roles.get(who)
    if key is None or key == task.variant:
        return task
    return load(task, key, **{p.name: p.value for p in task.parameters if p.value != p.default})


def described(task: Task, kind: str, actor: Actor, seed: int) -> dict[str, Any]:
    """What data is of, as plain data."""
    value = actor.value
    told = None if value is None else {"value": value.value, "bound": value.bound, "status": value.status}
    return {
        "kind": kind, "id": task.id, "instance": task.instance_id, "variant": task.variant, "parameters": dict(task.values),
        "modifiers": [str(m) for m in task.modifiers], "horizon": task.horizon, "discount": task.discount,
        "content_hash": task.content_hash, "policy": actor.name, "seed": seed, "return": told,
        "versions": {"taskspec": taskspec.__version__, "numpy": np.__version__},
    }  # fmt: skip
