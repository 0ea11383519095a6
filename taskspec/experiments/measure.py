"""What is worked out of one instance: what a sweep hands to a worker, and gets back as plain data."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from taskspec import __version__
from taskspec.exact import Results, Return
from taskspec.limits import also
from taskspec.progress import tell
from taskspec.source import Document, Packed, unpacked
from taskspec.task.build import build
from taskspec.task.task import Task

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
class Wanted:
    """What is asked of every instance. `seconds` is the limit of each exact analysis (None: the usual one)."""

    measures: tuple[str, ...] = ()
    policies: tuple[str, ...] = ()
    seeds: int = 1
    episodes: int = 1000
    speed: bool = False
    seconds: float | None = None


@dataclass(frozen=True)
class Order:
    """A task, as its text and the values of its parameters, and what is asked of it: it can travel to another machine."""

    text: Packed
    suite: str
    variant: str | None
    parameters: Mapping[str, Any]
    modifiers: tuple[str, ...]
    wanted: Wanted

    def task(self) -> Task:
        """The task.

        Raises:
            SpecError: with every mistake found.
        """
        return build(_document(self.text), self.variant, self.parameters, self.suite)


@lru_cache(maxsize=16)
def _document(text: Packed) -> Document:
    return unpacked(text)


def key(content_hash: str, modifiers: tuple[str, ...], wanted: Wanted) -> str:
    """What a result is kept under: the hash of the task's content, of the modifiers, of what is asked, and of the version."""
    content = [content_hash, modifiers, sorted(vars(wanted).items()), __version__]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def measure(order: Order) -> dict[str, Any]:
    """Sizes, returns, measures of difficulty and roll-outs of an instance, as JSON data.

    Raises:
        SpecError: where there is no such task, or something that is asked of it cannot be told of any task.
    """
    wanted = order.wanted
    with also("" if wanted.seconds is None else f"seconds={wanted.seconds:g}"):
        task = order.task()
        tell("the exact model")
        results = Results(task, wanted.episodes)
        return {**_sizes(task, results), **_returns(results), "why_not_exact": results.why_not}


def _sizes(task: Task, results: Results) -> dict[str, Any]:
    model = results.model
    return {
        "states": None if model is None else int(model.entered.sum()),
        "actions": None if model is None else model.n_actions,
        "horizon": task.horizon,
        "discount": task.discount,
    }


def _returns(results: Results) -> dict[str, Any]:
    """Returns by name, each with half of its 95 % confidence interval (0 where it is exact) and its status."""
    told: dict[str, Any] = {}
    for name in RETURNS:
        value: Return | None = getattr(results, name)
        told[name] = None if value is None else value.value
        told[f"{name}_half"] = None if value is None else value.half
        told[f"{name}_status"] = None if value is None else value.status
    return told
