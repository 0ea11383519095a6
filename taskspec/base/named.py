"""Entries of tables by their names."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar


class Named(Protocol):
    """An entry of a table, or anything else that has a name."""

    @property
    def name(self) -> str: ...


Entry = TypeVar("Entry", bound=Named)


def all_names(entries: Iterable[Named]) -> list[str]:
    return [entry.name for entry in entries]


def entries_by_name(entries: Iterable[Entry]) -> dict[str, Entry]:
    return {entry.name: entry for entry in entries}
