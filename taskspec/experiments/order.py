"""Tasks that another process or machine is to build, so that they need not be built here first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from taskspec.modifiers import modify
from taskspec.source import Document, Packed, unpacked
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


@lru_cache(maxsize=16)
def _document(text: Packed) -> Document:
    return unpacked(text)
