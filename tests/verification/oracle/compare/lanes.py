"""What the second interpreter says of one seed: a chain of steps and resets, which every environment walks in its own way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.verification.oracle.compare.cases import Case, Difference, random_action
from tests.verification.oracle.reference import spaces
from tests.verification.oracle.reference.episodes import Episodes, Result
from tests.verification.oracle.reference.task import State
from tests.verification.oracle.reference.values import DOUBTS, Value


@dataclass(frozen=True)
class Link:
    """A reset (without an action) or a step."""

    action: State | None
    result: Result


@dataclass(frozen=True)
class Lane:
    seed: int
    links: list[Link]
    """As far as they are beyond doubt."""


def lane(case: Case, seed: int, steps: int, *, absorb: bool = False) -> Lane:
    """A chain of so many steps, with resets between episodes."""
    rng = case.rng(f"actions {seed}")
    episodes = Episodes(case.reference, absorb=absorb)
    links = [Link(None, episodes.reset(seed))]
    before = DOUBTS.count
    for _ in range(steps):
        if episodes.over:
            links.append(Link(None, episodes.reset()))
        action = random_action(case.reference.action, rng)
        links.append(Link(action, episodes.step(action)))
        if DOUBTS.count != before:
            links.pop()
            break
    return Lane(seed, links)


# ------------------------------------------------------------------------------ single values


def close(ours: Value, theirs: Any, *, rough: bool) -> bool:
    """Whether numbers agree: to the bit, or to the last digits where no more is promised."""
    expected = np.array([float(x) for x in spaces.numbers(ours)])
    found = np.ravel(np.asarray(theirs, float))
    return found.shape == expected.shape and bool(near(expected, found, rough=rough or ours.rough).all())


def near(expected: np.ndarray, found: np.ndarray, *, rough: bool, tolerance: float = 1e-9) -> np.ndarray:
    same = (expected == found) | (np.isnan(expected) & np.isnan(found))
    if not rough:
        return same
    with np.errstate(invalid="ignore"):
        return same | (np.abs(expected - found) <= tolerance * np.maximum(1.0, np.abs(expected)))


def check_state(expected: State, found: dict[str, Any], where: str) -> None:
    found = {k: v for k, v in found.items() if k != "absorbed" or k in expected}
    if list(found) != list(expected):
        raise Difference("state names", f"{where}: {list(found)} for {list(expected)}")
    for name, value in expected.items():
        theirs = found[name]
        if value.choice is not None:
            labels = np.ravel(np.asarray(theirs, dtype=object)).tolist()
            same = [value.choice.labels[i] for i in value.data] == labels
        else:
            same = close(value, theirs, rough=False)
        if not same:
            raise Difference("state", f"{where}: {name} is {theirs}, expected {value.data}")


def check_measures(expected: Result, found: dict[str, Any], where: str, *, tolerance: float = 0.0) -> None:
    """What is measured in a step."""
    if list(found) != list(expected.measures):
        raise Difference("measures", f"{where}: {list(found)} for {list(expected.measures)}")
    for name, value in expected.measures.items():
        rough = value.rough or tolerance > 0
        if not near(np.array(float(value.item)), np.array(found[name]), rough=rough, tolerance=max(1e-9, tolerance)):
            raise Difference("measure", f"{where}: {name} is {found[name]}, expected {value.item}")


def check_mask(expected: Result, found: Any, where: str) -> None:
    """Which actions are legal in the state that is reached."""
    theirs = None if found is None else np.asarray(found).tolist()
    if theirs != expected.mask:
        raise Difference("mask", f"{where}: {theirs}, expected {expected.mask}")


def check_observation(case: Case, result: Result, found: Any, space: Any, where: str, *, tolerance: float = 0) -> None:
    """An observation, in whatever space: flat values agree, finite ones as what they are."""
    if isinstance(found, dict):
        for name, value in result.seen:
            part = np.asarray(found[name], float).ravel()
            check_numbers([(name, value)], part, f"{where}, {name}", tolerance)
        return
    ranges = finite_ranges(case, result)
    kind = (case.reference.sections.get("observation") or {}).get("space")
    if kind == "one_hot" and ranges is not None:
        expected = spaces.one_hot(result.seen, ranges)
    elif kind == "multi_discrete" and ranges is not None:
        expected = spaces.counted(result.seen, ranges)
    elif kind in ("one_hot", "multi_discrete"):
        return  # where its places begin follows from bounds that the compiler works out
    else:
        check_numbers(result.seen, np.asarray(found, float).ravel(), where, tolerance)
        return
    if not np.array_equal(np.asarray(found), expected):
        raise Difference("observation", f"{where}: {found}, expected {expected}")


def check_numbers(seen: spaces.Seen, found: np.ndarray, where: str, tolerance: float) -> None:
    expected = spaces.flat(seen).astype(float)
    rough = any(v.rough for _, v in seen) or tolerance > 0
    if expected.shape != found.shape or not near(expected, found, rough=rough, tolerance=max(1e-6, tolerance)).all():
        raise Difference("observation", f"{where}: {found}, expected {expected}")


def finite_ranges(case: Case, result: Result) -> list[spaces.Range] | None:
    """The ranges of what is observed, if each is declared or that of a component; else None."""
    section = case.reference.sections.get("observation")
    components = {c.name: c for c in case.reference.state}
    found: list[spaces.Range] = []
    for name, value in result.seen:
        entry: Any = name if section is None else section.get(name)
        if entry is None or name == "t":
            found.append(spaces.Range(0, 1 + (case.reference.horizon or 0)))
        elif isinstance(entry, dict) and "low" in entry:
            low, high = (case.reference.value(entry[k]).item for k in ("low", "high"))
            found += [spaces.Range(int(low), int(high) - int(low) + 1)] * len(value.data)
        elif isinstance(entry, str) and entry in components and components[entry].finite:
            c = components[entry]
            found += [spaces.Range(int(a), int(b) - int(a) + 1) for a, b in map(c.ends, range(c.size))]
        else:
            return None
    return found
