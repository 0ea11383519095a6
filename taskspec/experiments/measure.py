"""Measure one instance in a worker, which builds the task itself."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base import __version__
from taskspec.base.limits import also, tell
from taskspec.exact import Results, Return
from taskspec.modifiers import modify
from taskspec.scores.difficulty import difficulty
from taskspec.source import Document, Packed, unpacked
from taskspec.task.build import build
from taskspec.task.task import Task

# Tasks that another process or machine is to build, so that they need not be built here first.


@dataclass(frozen=True)
class Sent:
    """A task, as its text and the values of its parameters."""

    text: Packed
    suite: str
    variant: str | None
    parameters: Mapping[str, Any]
    modifiers: tuple[str, ...]

    def task(self) -> Task:
        """Return the task.

        Raises:
            SpecError: with every mistake found.
        """
        return modify(build(_document(self.text), self.variant, self.parameters, self.suite), *self.modifiers)


@lru_cache(maxsize=16)
def _document(text: Packed) -> Document:
    return unpacked(text)


# What is worked out of one instance: what a sweep hands to a worker, and gets back as plain data.

RETURNS = ("optimal", "expert", "random", "worst")
COLUMNS = (
    "states",
    "actions",
    "horizon",
    "discount",
    *(f"{n}{end}" for n in RETURNS for end in ("", "_half", "_status")),
)
"""What every result has, besides the measures and policies that were asked for."""


@dataclass(frozen=True)
class Questions:
    """What is asked of every instance: measures of difficulty (None: all), roll-outs, steps per second.

    `code` are hashes of the policies that are functions of files, and `limits` those that hold, as `limits.also` takes them.
    """

    measures: tuple[str, ...] | None = None
    policies: tuple[str, ...] = ()
    seeds: int = 1
    episodes: int = 1000
    speed: bool = False
    code: tuple[str, ...] = ()
    limits: str = ""


@dataclass(frozen=True)
class Order:
    """A task, and what is asked of it."""

    about: Sent
    wanted: Questions


def key(content_hash: str, modifiers: tuple[str, ...], wanted: Questions) -> str:
    """Return what a result is kept under: a hash of the task, of the modifiers, of what is asked, and of the version."""
    content = [content_hash, modifiers, sorted(vars(wanted).items()), __version__]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def measure(order: Order) -> dict[str, Any]:
    """Return sizes, returns, measures of difficulty and roll-outs of an instance, as JSON data.

    Raises:
        SpecError: where there is no such task, or something that is asked of it cannot be told of any task.
    """
    wanted = order.wanted
    with also(wanted.limits):
        task = order.about.task()
        tell("the exact model")
        results = Results(task, wanted.episodes)
        hard = difficulty(results, wanted.measures)
        why_not = {**({"returns": results.why_not} if results.why_not else {}), **hard.why_not}
        found = {**_sizes(task, results), **_returns(results), **hard, "why_not": why_not}
        found["policies"] = {name: _rolled_out(task, name, wanted) for name in wanted.policies}
        return {**found, **_speed(task)} if wanted.speed else found


def _rolled_out(task: Task, policy: str, wanted: Questions) -> dict[str, Any]:
    """Return the mean return of a policy in all episodes of all seeds, half its 95 % confidence interval, and their mean
    length.
    """
    from taskspec.data.episodes import recorded

    parts = [recorded(task, policy, wanted.episodes, None, seed * wanted.episodes, 1) for seed in range(wanted.seeds)]
    means = [Return.estimated(part.returns(task.discount)) for part in parts]
    mean = Return.estimated(np.concatenate([part.returns(task.discount) for part in parts]))
    return {
        "mean": mean.value, "half": mean.half, "length": float(np.mean(np.concatenate([part.lengths for part in parts]))),
        "episodes": mean.episodes, "seeds": [each.value for each in means],
    }  # fmt: skip


SPEEDS = ("steps_per_second", "steps_per_second_vectorized")
LANES = 64
SECONDS = 0.2
"""How many environments are stepped together for the speed of many, and how long each is timed."""


def _speed(task: Task) -> dict[str, Any]:
    """Return steps per second of one environment and of many on NumPy, in time of the processor."""
    from taskspec.envs.speed import steps_per_second

    return dict(zip(SPEEDS, steps_per_second(task, LANES, SECONDS), strict=True))


def _sizes(task: Task, results: Results) -> dict[str, Any]:
    model = results.model
    return {
        "states": None if model is None else int(model.entered.sum()),
        "actions": None if model is None else model.n_actions,
        "horizon": task.horizon,
        "discount": task.discount,
    }


def _returns(results: Results) -> dict[str, Any]:
    """Return returns by name, each with half of its 95 % confidence interval (0 where it is exact) and its status."""
    told: dict[str, Any] = {}
    for name in RETURNS:
        value: Return | None = getattr(results, name)
        told[name] = None if value is None else value.value
        told[f"{name}_half"] = None if value is None else value.half
        told[f"{name}_status"] = None if value is None else value.status
    return told
