"""A list in a temporary file, which may be longer than the memory holds."""

from __future__ import annotations

import pickle
import sqlite3
from collections.abc import Sequence
from typing import TypeVar, overload

T = TypeVar("T")


class DiskList(Sequence[T]):
    """Things that can be pickled, in order, each with a key of its own. Its file goes with it."""

    def __init__(self) -> None:
        self._database = sqlite3.connect("", isolation_level=None, check_same_thread=False)
        self._database.execute("create table things (number integer primary key, key text unique, thing blob)")
        self._database.execute("begin")  # nobody else reads the file, so that nothing is ever committed
        self._count = 0

    def add(self, key: str, thing: T) -> None:
        """Add a thing at the end, unless there is one with its key already."""
        row = (self._count, key, pickle.dumps(thing))
        self._count += self._database.execute("insert or ignore into things values (?, ?, ?)", row).rowcount

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[T]: ...
    def __getitem__(self, index: int | slice) -> T | Sequence[T]:
        numbers = range(self._count)[index]
        if isinstance(numbers, int):
            return self._thing(numbers)
        return [self._thing(number) for number in numbers]

    def _thing(self, number: int) -> T:
        (pickled,) = self._database.execute("select thing from things where number = ?", (number,)).fetchone()
        thing: T = pickle.loads(pickled)
        return thing
