"""Limits on what a spec may cost, and listeners to the progress of long analyses."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import TypeAlias, TypeVar

from taskspec.base.diagnostics import spec_error, suggest

VARIABLE = "TASKSPEC_LIMITS"
"""The environment variable that changes limits: `TASKSPEC_LIMITS=seconds=60,candidates=1e7`.

Where something is refused for want of time, the time is worked out beforehand from how much there is to do, at a nominal
rate: what is refused does not depend on the machine.
"""
HOPELESS = 1e12


def _limit(value: int, what: str) -> int:
    return field(default=value, metadata={"what": what, "fixed": False})


def _fixed(value: int, what: str) -> int:
    """Declare a limit that programs rest on, which cannot be changed."""
    return field(default=value, metadata={"what": what, "fixed": True})


@dataclass(frozen=True)
class Limits:
    """The limits by name, each with its default and its documentation."""

    file: int = _limit(1_000_000, "bytes of a file")
    values: int = _limit(100_000, "values in a file")
    depth: int = _fixed(100, "nesting of values in a file")
    digits: int = _fixed(300, "digits of a number")
    variants: int = _limit(200, "variants of a spec")
    claims: int = _limit(500, "claims of a task, each counted for all parameter values that it is checked for")
    characters: int = _limit(20_000, "characters of an expression")
    brackets: int = _fixed(100, "nesting of brackets")
    operators: int = _fixed(150, "nesting of operators")
    expansions: int = _limit(50_000, "expressions that definitions and comprehensions write out")
    expressions: int = _limit(250_000, "expressions in all, each as often as it is written out")
    operations: int = _limit(200_000, "operations of a task")
    bits: int = _fixed(256, "bits of a constant")
    elements: int = _limit(2_000_000, "elements of a vector")
    width: int = _limit(20_000, "elements of the state, of the action and of the observation, each")
    candidates: int = _limit(1_000_000, "candidates of a set")
    unrolled: int = _limit(10_000, "elements of a comprehension that reads the state")
    cells: int = _limit(65_536, "cells of a table")
    one_hot: int = _limit(1_000_000, "elements of a one-hot observation")
    poisson: int = _fixed(100_000, "rate of `Poisson`")
    trials: int = _fixed(1_000, "trials of `Binomial`")
    waiting: int = _fixed(10_000, "trials of `Geometric` with a constant probability; otherwise as of `Binomial`")
    horizon: int = _fixed(2**31 - 2, "steps of an episode")
    points: int = _limit(2_000_000, "state-action pairs that `check` tries one by one")
    outcomes: int = _limit(1_000_000, "outcomes of one step")
    transitions: int = _limit(20_000_000, "transitions of an exact model")
    episodes: int = _limit(1_000_000, "episodes that are simulated for one claim, or of one policy in an experiment")
    enumerated: int = _limit(100_000, "episodes, or groups of them, that an exact expectation enumerates")
    lanes: int = _limit(2**24, "environments that are stepped together")
    instances: int = _limit(100_000, "instances of an experiment")
    seconds: int = _limit(10, "seconds of each exact analysis of a task")
    compiling: int = _limit(60, "seconds that Numba may take to compile a task, unless it was compiled before")
    megabytes: int = _limit(1_000, "megabytes of each array")


@lru_cache(maxsize=1)
def limits() -> Limits:
    return changed(Limits(), os.environ.get(VARIABLE, ""))


@contextmanager
def also(text: str, source: str = VARIABLE) -> Iterator[None]:
    """Change limits within the block, on top of the environment variable, also for processes that are started there."""
    before = os.environ.get(VARIABLE, "")
    changed(limits(), text, source)
    try:
        _set(f"{before},{text}")
        yield
    finally:
        _set(before)


def written() -> str:
    """Return the current limits as `also` takes them, for the keys of results that depend on limits."""
    now = limits()
    return ",".join(f"{row.name}={getattr(now, row.name)}" for row in table() if not row.fixed)


def _set(text: str) -> None:
    os.environ[VARIABLE] = text
    limits.cache_clear()


def changed(present: Limits, text: str, source: str = VARIABLE) -> Limits:
    """Return limits with those replaced that a text names: `seconds=60,candidates=1e7`; errors name its source."""
    fixed = {row.name: row.fixed for row in table()}
    known = [name for name, is_fixed in fixed.items() if not is_fixed]
    given = {}
    for part in filter(None, map(str.strip, text.split(","))):
        name, _, value = map(str.strip, part.partition("="))
        if name not in known:
            if name in fixed:
                message = f"the limit '{name}' cannot be changed"
            else:
                message = f"there is no limit '{name}'"
            raise spec_error("E713", f"{source}: {message}", suggest(name, known) or f"there are: {', '.join(known)}")
        try:
            given[name] = int(float(value))
        except (ValueError, OverflowError):
            given[name] = -1
        if given[name] < 0:
            raise spec_error("E713", f"{source}: '{part}' gives no number", f"{name}={getattr(present, name)}")
    return replace(present, **given)


@dataclass(frozen=True)
class LimitRow:
    """A row of the table of limits."""

    name: str
    value: int
    what: str
    fixed: bool


def table() -> tuple[LimitRow, ...]:
    """Return every limit with its default."""
    return tuple(LimitRow(f.name, f.default, **f.metadata) for f in fields(Limits))  # type: ignore[arg-type]


def how_to_raise(name: str, needed: float) -> str | None:
    """Return the hint of a message about a limit: the setting that allows this much; None above `HOPELESS`."""
    if needed > HOPELESS:
        return None
    value = str(int(-(-needed // 1)))
    if needed >= 1000:  # two digits, rounded up
        digits = len(str(int(needed))) - 2
        value = f"{-int(-needed // 10**digits)}e{digits}"
    return f"{VARIABLE}={name}={value} allows it"


def count(number: int) -> str:
    """Return a number with its digits in groups; as a power of ten from 10^15 on."""
    if abs(number) < 10**15:
        return f"{number:,}"
    return f"about 10^{int(abs(number).bit_length() * 0.30103)}"


# Progress of long analyses, reported to a listener where one is set.

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
