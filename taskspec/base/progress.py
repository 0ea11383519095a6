"""What a long analysis is at, told as it goes on to whoever listens; nobody does unless asked to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeAlias, TypeVar

Listener: TypeAlias = Callable[[str, "float | None"], None]
T = TypeVar("T")

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def tell(what: str, share: float | None = None) -> None:
    """Say what is done now, in a few words; where that is a part of many, also which share of them is over."""
    listener = _listener.get()
    if listener is not None:
        listener(what, share)


def telling(items: Sequence[T], name: Callable[[T], str]) -> Iterator[T]:
    """Items one after the other, each told by its name."""
    for i, item in enumerate(items):
        tell(name(item), i / len(items))
        yield item


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """Within the block, everything that is told goes to this listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
