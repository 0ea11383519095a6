"""Bisimulation: which states of finite tasks no sequence of actions tells apart, and the shortest one that does.

Level k has the classes of states that no k actions tell apart. The classes of level k + 1 follow from those of level k, until
their number stays the same (R. Givan, T. Dean and M. Greig, Equivalence notions and model minimization in Markov decision
processes, Artificial Intelligence 147, 2003).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

Rows = Sequence[Sequence[Mapping[Any, Any]]]
"""The outcomes of each state and action, (next state, reward, whether the episode ends there), with their probabilities."""


def levels(rows: Rows, labels: Sequence[Hashable], depth: int | None = None) -> list[list[int]]:
    """Return the class of each state at each level; level 0 are the labels.

    Args:
        labels: what is seen of each state.
        depth: the last level; None for all, up to the classes of bisimulation.
    """
    found = [_numbered(labels)]
    while depth is None or len(found) <= depth:
        found.append(_refined(rows, found))
        if max(found[-1], default=0) == max(found[-2], default=0):
            break
    return found


def classes_from(steps: Iterable[Rows], labels: Sequence[Hashable]) -> list[int]:
    """Return classes of states that nothing tells apart in some steps, whose rows are given from the last step to the first."""
    found = [_numbered(labels)]
    for rows in steps:
        found.append(_refined(rows, found, labels))
    return found[-1]


def _refined(rows: Rows, found: Sequence[Sequence[int]], labels: Sequence[Hashable] | None = None) -> list[int]:
    seen = found[-1] if labels is None else labels
    return _numbered([(seen[s], signature(rows, found, len(found) - 1, s)) for s in range(len(rows))])


def _numbered(keys: Sequence[Hashable]) -> list[int]:
    numbers: dict[Hashable, int] = {}
    return [numbers.setdefault(key, len(numbers)) for key in keys]


def signature(rows: Rows, found: Sequence[Sequence[int]], level: int, s: int) -> tuple[Hashable, ...]:
    """Return the outcomes of each action in a state, with next states up to a level; of an end only the label is seen."""
    by_action = []
    for outcomes in rows[s]:
        merged: Counter[Hashable] = Counter()
        for (to, reward, ends), p in outcomes.items():
            if ends:
                seen = found[0][to]
            else:
                seen = found[level][to]
            merged[reward, ends, seen] += p
        by_action.append(frozenset(merged.items()))
    return tuple(by_action)


def apart(rows: Rows, found: Sequence[Sequence[int]], one: int, other: int) -> list[int]:
    """Return a shortest sequence of actions after which two states differ; empty where their labels do.

    Where actions have several outcomes, it is a sequence for one of these.
    """
    level = next(k for k, classes in enumerate(found) if classes[one] != classes[other])
    actions: list[int] = []
    while level > 0:
        level -= 1
        mine = signature(rows, found, level, one)
        theirs = signature(rows, found, level, other)
        a = next(a for a, (x, y) in enumerate(zip(mine, theirs, strict=True)) if x != y)
        actions.append(a)
        pair = _later(rows, found[level], a, one, other)
        if pair is None:
            break
        one, other = pair
        level = next(k for k, classes in enumerate(found) if classes[one] != classes[other])
    return actions


def _later(rows: Rows, classes: Sequence[int], a: int, one: int, other: int) -> tuple[int, int] | None:
    """Return two next states of different classes after the same reward; None where the outcomes themselves differ."""
    mine = {(reward, ends): to for (to, reward, ends), _ in rows[one][a].items()}
    theirs = {(reward, ends): to for (to, reward, ends), _ in rows[other][a].items()}
    if set(mine) != set(theirs):
        return None
    for key, to in mine.items():
        if not key[1] and classes[to] != classes[theirs[key]]:
            return to, theirs[key]
    return None
