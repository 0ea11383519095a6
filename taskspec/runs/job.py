"""What is to be done, and what came of it."""

from __future__ import annotations

import importlib
import json
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

Status = Literal["done", "failed", "timed_out", "quarantined"]
"""How a job ended: with a result, with an error, at its time limit, or with the death of its process, twice."""


@dataclass(frozen=True, slots=True)
class Job:
    """One call of a function, which gives JSON data.

    Args:
        key: a content hash of all that the result depends on; it names the result for ever.
        name: what people call it.
        function: at the top level of a module other than `__main__`, or its place as text, `"module:name"`.
        arguments: for the function, in order; whatever can be pickled.
    """

    key: str
    name: str
    function: Callable[..., Any] | str
    arguments: tuple[Any, ...] = ()

    def packed(self) -> bytes:
        """The call as bytes; in place of one that cannot be pickled, a call that fails for that reason."""
        try:
            return pickle.dumps((self.function, self.arguments))
        except Exception as error:
            return pickle.dumps((_unpicklable, (str(error),)))


def _unpicklable(reason: str) -> None:
    raise TypeError(f"the call cannot be pickled: {reason}")


def unpacked(call: bytes) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """The function and the arguments of a call."""
    function, arguments = pickle.loads(call)
    if isinstance(function, str):
        module, _, name = function.partition(":")
        function = getattr(importlib.import_module(module), name)
    return function, arguments


class Ending(NamedTuple):
    """How a call ended, as its process says it; `died` is said by those who waited for one that no longer says anything."""

    status: Literal["done", "failed", "timed_out", "died"]
    result: str | None = None
    message: str | None = None
    seconds: float = 0.0
    versions: Mapping[str, str] = {}


@dataclass(frozen=True, slots=True)
class JobResult:
    """What is kept of a job.

    Args:
        result: JSON text; None unless the job is done.
        message: why it is not done, for people; None if it is.
        seconds: that the last attempt took.
        attempts: how often it was begun, in the runs that say how it ended.
        when: it ended, in UTC, as ISO 8601 writes it.
        versions: of Python and taskspec, where it ran.
    """

    key: str
    name: str
    status: Status
    result: str | None
    message: str | None
    seconds: float
    attempts: int
    when: str
    versions: Mapping[str, str]

    @property
    def value(self) -> Any:
        """The result as JSON data; None unless the job is done."""
        return None if self.result is None else json.loads(self.result)
