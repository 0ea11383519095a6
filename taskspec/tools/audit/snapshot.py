"""The state of an environment as its object holds it: numbers and texts by their places, and random generators.

Two instances whose objects hold the same are in the same state, unless part of it is kept elsewhere, such as in a library
of C. Tables made by it are therefore compared with episodes (`tabulate`).
"""

from __future__ import annotations

import enum
import hashlib
import random
from collections import deque
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import gymnasium
import numpy as np

Place = tuple[Hashable, ...]
"""How to get from the environment to a value: names of attributes, and keys of containers in a tuple of their own."""
SKIPPED = (
    gymnasium.Space, gymnasium.envs.registration.EnvSpec, ModuleType, type, FunctionType, MethodType, BuiltinFunctionType,
)  # fmt: skip
GENERATORS = (np.random.Generator, np.random.RandomState, random.Random)
SEEDS = ("_np_random_seed", "_seed", "seed")
"""Where Gymnasium and others keep the seed of the last reset, on which steps should not depend."""
LENGTH = ("length",)


@dataclass
class Snapshot:
    """The contents of an environment's object at one time."""

    leaves: dict[Place, Any] = field(default_factory=dict)
    generators: list[Any] = field(default_factory=list)

    def key(self, ignored: frozenset[Place] = frozenset()) -> bytes:
        """Return a hash of the state, without what is at or below some places."""
        kept = []
        for place, value in self.leaves.items():
            if not _is_below(place, ignored):
                kept.append((place, value))
        return hashlib.blake2b(repr(kept).encode(), digest_size=16).digest()


@lru_cache(maxsize=100_000)
def _is_below(place: Place, ignored: frozenset[Place]) -> bool:
    return any(place[:n] in ignored for n in range(1, len(place) + 1))


def snapshot(env: Any) -> Snapshot:
    """Return what an environment and its wrappers hold."""
    contents = Snapshot()
    seen: set[int] = set()
    waiting: deque[tuple[Place, Any]] = deque([((), env)])
    while waiting:
        place, value = waiting.popleft()
        if _is_leaf(value):
            contents.leaves[place] = _plain(value)
        elif not isinstance(value, SKIPPED) and id(value) not in seen:
            seen.add(id(value))
            if isinstance(value, GENERATORS):
                contents.generators.append(value)
                continue
            if isinstance(value, list | tuple | deque | set | frozenset | Mapping):
                contents.leaves[*place, LENGTH] = len(value)
            for step, inner in _inside(value):
                waiting.append(((*place, step), inner))
    return contents


def _is_leaf(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return bool(value.dtype.kind != "O")
    return isinstance(value, None | bool | int | float | complex | str | bytes | np.generic | enum.Enum)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        if value.size <= 64:
            return [_plain(each) for each in value.ravel().tolist()]
        return value.shape, hashlib.blake2b(np.ascontiguousarray(value).data, digest_size=16).hexdigest()
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool | float) and value == value // 1:
        return int(value)
    return value


def _inside(value: Any) -> Iterator[tuple[Hashable, Any]]:
    match value:
        case np.ndarray():
            yield from _inside(value.ravel().tolist())
        case list() | tuple() | deque():
            for i, inner in enumerate(value):
                yield (i,), inner
        case set() | frozenset():
            yield ("members",), repr(sorted(map(repr, value)))
        case Mapping():
            for key in value:
                yield (key,), value[key]
        case _:
            yield from _attributes(value)


def _attributes(value: Any) -> Iterator[tuple[Hashable, Any]]:
    for name, inner in getattr(value, "__dict__", {}).items():
        if name not in SEEDS:
            yield name, inner
    for kind in type(value).__mro__:
        slots = vars(kind).get("__slots__", ())
        if isinstance(slots, str):
            slots = (slots,)
        for name in slots:
            if hasattr(value, name):
                yield name, getattr(value, name)


def drawn(generators: Iterable[Any]) -> str:
    """Return the state of generators, those of Python and NumPy included, as a text: it changes with each draw."""
    states = []
    for each in generators:
        match each:
            case np.random.Generator():
                states.append(each.bit_generator.state)
            case np.random.RandomState():
                states.append(each.get_state())
            case _:
                states.append(each.getstate())
    used: Any = np.random.get_state()  # noqa: NPY002
    return repr(states) + repr((used[1].sum(), used[2:], hash(random.getstate())))


def reseed(generators: Iterable[Any], seed: int) -> None:
    """Give generators, those of Python and NumPy included, the state of a seed."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    for each in generators:
        match each:
            case np.random.Generator():
                each.bit_generator.state = type(each.bit_generator)(seed).state
            case _:
                each.seed(seed)


def counters(episodes: Iterable[list[Snapshot]]) -> frozenset[Place]:
    """Return the places of numbers that grow by the same amount in each step: they tell the time."""
    return _places(episodes, lambda steps: len(set(steps)) == 1 and steps[0] != 0)


def totals(episodes: Iterable[list[Snapshot]]) -> frozenset[Place]:
    """Return the places of numbers and lists that never shrink in an episode, or never grow: counters, sums, histories."""
    return _places(episodes, lambda steps: any(steps) and (min(steps) >= 0 or max(steps) <= 0))


def _places(episodes: Iterable[list[Snapshot]], wanted: Any) -> frozenset[Place]:
    verdicts: dict[Place, bool] = {}
    for snapshots in episodes:
        if len(snapshots) < 3:
            continue
        for place, first in snapshots[0].leaves.items():
            values: list[Any] = [each.leaves.get(place) for each in snapshots]
            if all(value == first for value in values):
                continue
            is_number = all(isinstance(value, int | float) for value in values)
            steps = []
            if is_number:
                steps = [round(b - a, 9) for a, b in pairwise(values)]
            verdicts[place] = verdicts.get(place, True) and is_number and wanted(steps)
    places = set()
    for place, is_wanted in verdicts.items():
        if is_wanted and place[-1] == LENGTH:
            places.add(place[:-1])
        elif is_wanted:
            places.add(place)
    return frozenset(places)


def place_value(env: Any, place: Place, value: Any) -> None:
    """Set the number at a place."""
    *path, last = place
    for step in path:
        if isinstance(step, tuple):
            env = env[step[0]]
        else:
            env = getattr(env, str(step))
    if isinstance(last, tuple):
        env[last[0]] = value
    else:
        object.__setattr__(env, str(last), value)
