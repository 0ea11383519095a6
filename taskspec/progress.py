"""What a long analysis is at, told as it goes on to whoever listens; nobody does unless asked to."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeAlias

Listener: TypeAlias = Callable[[str], None]

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def tell(what: str) -> None:
    """Say what is done now, in a few words."""
    listener = _listener.get()
    if listener is not None:
        listener(what)


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """Within the block, everything that is told goes to this listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
