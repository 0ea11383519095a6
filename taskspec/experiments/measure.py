"""What is worked out of one instance: what a sweep hands to a worker, and gets back as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

from taskspec.exact import Return, Scores, scores
from taskspec.source import Document, Packed, unpacked
from taskspec.task.build import build
from taskspec.task.task import Task

RETURNS = ("optimal", "expert", "random", "worst")


@dataclass(frozen=True)
class Order:
    """A task, as its text and the values of its parameters, and what is asked of it."""

    text: Packed
    suite: str
    variant: str | None
    parameters: Mapping[str, Any]
    modifiers: tuple[str, ...] = ()
    measures: tuple[str, ...] = ()
    policies: tuple[str, ...] = ()
    seeds: int = 1
    episodes: int = 100
    speed: bool = False

    def task(self) -> Task:
        """The task.

        Raises:
            SpecError: with every mistake found.
        """
        return build(_document(self.text), self.variant, self.parameters, self.suite)

    @property
    def asked(self) -> dict[str, Any]:
        """What is asked, of whatever task."""
        return {
            key: value for key, value in asdict(self).items() if key not in ("text", "suite", "variant", "parameters")
        }


@lru_cache(maxsize=16)
def _document(text: Packed) -> Document:
    return unpacked(text)


def measure(order: Order) -> dict[str, Any]:
    """Sizes, returns, measures of difficulty and roll-outs of an instance, as JSON data.

    Raises:
        SpecError: where there is no such task, or it cannot be measured.
    """
    task = order.task()
    found = scores(task, max(order.episodes, 2))
    return {
        **_sizes(task, found),
        **_returns(found),
    }


def _sizes(task: Task, found: Scores) -> dict[str, Any]:
    return {
        "states": found.states, "actions": found.actions, "horizon": task.horizon, "discount": task.discount,
        "why_not_exact": found.why_not_exact,
    }  # fmt: skip


def _returns(found: Scores) -> dict[str, Any]:
    """Returns by name, each with half of its 95 % confidence interval (0 where it is exact) and its status."""
    told: dict[str, Any] = {}
    for name in RETURNS:
        value: Return | None = getattr(found, name)
        told[name] = None if value is None else value.value
        told[f"{name}_half"] = None if value is None else value.half
        told[f"{name}_status"] = None if value is None else value.status
    return told
