"""Tasks that can travel to another process or machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from taskspec.modifiers import modify
from taskspec.source import Document, Packed, packed, unpacked
from taskspec.task.build import build
from taskspec.task.task import Task


@dataclass(frozen=True)
class Sent:
    """A task, as its text and the values of its parameters."""

    text: Packed
    suite: str
    variant: str | None
    parameters: Mapping[str, Any]
    modifiers: tuple[str, ...]

    def task(self) -> Task:
        """The task.

        Raises:
            SpecError: with every mistake found.
        """
        return modify(build(_document(self.text), self.variant, self.parameters, self.suite), *self.modifiers)


def sent(task: Task) -> Sent:
    """A task, ready to travel."""
    return Sent(packed(task.document), task.suite, task.variant, task.values, tuple(map(str, task.modifiers)))


@lru_cache(maxsize=16)
def _document(text: Packed) -> Document:
    return unpacked(text)
