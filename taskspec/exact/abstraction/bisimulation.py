"""Bisimulation: classes of states that no sequence of actions tells apart, and shortest sequences that tell others apart.

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
    """Partition states into classes that no k actions tell apart, for k = 0, 1, ...

    Args:
        rows: outcomes of each state and action.
        labels: observation of each state, (S,).
        depth: the last level; None for all, up to the classes of bisimulation.

    Returns:
        the class of each state (S,) at each level; level 0 are the labels.
    """
    classes = [_numbered(labels)]
    while depth is None or len(classes) <= depth:
        classes.append(_refined(rows, classes))
        if max(classes[-1], default=0) == max(classes[-2], default=0):
            break
    return classes


def classes_from(steps: Iterable[Rows], labels: Sequence[Hashable]) -> list[int]:
    """Partition states into classes that no actions tell apart, in steps whose outcomes depend on the time.

    Args:
        steps: outcomes of each state and action, from the last step to the first.
        labels: observation of each state, (S,).

    Returns:
        the class of each state (S,) at the first step.
    """
    classes = [_numbered(labels)]
    for rows in steps:
        classes.append(_refined(rows, classes, labels))
    return classes[-1]


def _refined(rows: Rows, classes: Sequence[Sequence[int]], labels: Sequence[Hashable] | None = None) -> list[int]:
    if labels is None:
        labels = classes[-1]
    level = len(classes) - 1
    return _numbered([(labels[s], signature(rows, classes, level, s)) for s in range(len(rows))])


def _numbered(keys: Sequence[Hashable]) -> list[int]:
    numbers: dict[Hashable, int] = {}
    return [numbers.setdefault(key, len(numbers)) for key in keys]


def signature(rows: Rows, classes: Sequence[Sequence[int]], level: int, s: int) -> tuple[Hashable, ...]:
    """Outcomes of each action in a state, with the classes of next states at a level; of last states only the labels."""
    by_action = []
    for outcomes in rows[s]:
        merged: Counter[Hashable] = Counter()
        for (to, reward, ends), p in outcomes.items():
            seen_at = 0 if ends else level
            merged[reward, ends, classes[seen_at][to]] += p
        by_action.append(frozenset(merged.items()))
    return tuple(by_action)


def apart(rows: Rows, classes: Sequence[Sequence[int]], one: int, other: int) -> list[int]:
    """Search for a shortest sequence of actions after which two states differ.

    Args:
        rows: outcomes of each state and action.
        classes: of each level, as `levels` gives them.
        one: a state.
        other: a state of another class.

    Returns:
        actions; none where the labels differ. Where actions have several outcomes, it is a sequence for one of these.
    """
    level = _first_level(classes, one, other)
    actions: list[int] = []
    while level > 0:
        level -= 1
        mine = signature(rows, classes, level, one)
        theirs = signature(rows, classes, level, other)
        a = next(a for a in range(len(mine)) if mine[a] != theirs[a])
        actions.append(a)
        pair = _later(rows, classes[level], a, one, other)
        if pair is None:
            break
        one, other = pair
        level = _first_level(classes, one, other)
    return actions


def _first_level(classes: Sequence[Sequence[int]], one: int, other: int) -> int:
    return next(k for k, of_states in enumerate(classes) if of_states[one] != of_states[other])


def _later(rows: Rows, classes: Sequence[int], a: int, one: int, other: int) -> tuple[int, int] | None:
    """Two next states of different classes after the same reward; None where the outcomes themselves differ."""
    mine = {(reward, ends): to for to, reward, ends in rows[one][a]}
    theirs = {(reward, ends): to for to, reward, ends in rows[other][a]}
    if set(mine) != set(theirs):
        return None
    for key, to in mine.items():
        if not key[1] and classes[to] != classes[theirs[key]]:
            return to, theirs[key]
    return None
