"""Progress of long analyses, reported to a listener where one is set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeAlias, TypeVar

Listener: TypeAlias = Callable[[str, "float | None"], None]
T = TypeVar("T")

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def tell(what: str, share: float | None = None) -> None:
    """Report in a few words what is done now; for one of many parts, also the share that is done."""
    listener = _listener.get()
    if listener is not None:
        listener(what, share)


def telling(items: Sequence[T], name: Callable[[T], str]) -> Iterator[T]:
    """Yield items one after the other, and report each by its name."""
    for i, item in enumerate(items):
        tell(name(item), i / len(items))
        yield item


@contextmanager
def progress_listener(listener: Listener) -> Iterator[None]:
    """Send all progress within the block to this listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
