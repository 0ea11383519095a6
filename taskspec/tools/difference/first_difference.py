"""The first step at which two finite tasks part, by the names of states and actions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.display import decimal
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import refuse
from taskspec.exact.model.probabilities import ExactProbabilities, Reader
from taskspec.exact.model.transitions import Steps, joint_outcomes, outcome_count
from taskspec.language.task.task import Task

MOST_OUTCOMES = 400_000
"""Outcomes of all steps together up to which tasks are compared exactly."""

PLACES = 4
"""Decimals of rewards."""
MOST_PLACES = 15
"""Decimals of rewards that differ beyond these."""


@dataclass(frozen=True)
class FirstDifference:
    """A step at which two tasks part.

    Attributes:
        actions: the shortest actions that show it, the last one among them, by name.
        t, state, action: when and where; the action is None where the start, an observation, the legal actions or the
            horizon differ.
        first, second: what happens in each task, in words.
    """

    actions: tuple[str, ...]
    t: int
    state: str | None
    action: str | None
    first: str
    second: str


class NamedSteps:
    """The outcomes of a finite task in rationals; states and actions have their values as names.

    Raises:
        SpecError: E712 for tasks that are not finite, or too large.
        Inexact: for probabilities that are no rationals.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.model = extract(task, True)
        self._steps = Steps(task, as_paid=True)
        if math.isinf(self._steps.branching):
            self._steps = Steps(task)
        self.times = 1
        if self._steps.uses_time:
            self.times = task.horizon or 1
        if self.model.n_states * self.model.n_actions * self._steps.branching * self.times > MOST_OUTCOMES:
            refuse("there are too many steps to compare")
        if not task.observation.is_state and math.isinf(outcome_count(task.observation.nodes)):
            refuse("observations have infinitely many outcomes")
        self._numbers = ExactProbabilities(Reader(as_written=True))
        self.names = [_name(self.model.state(s)) for s in range(self.model.n_states)]
        self.index = {name: s for s, name in enumerate(self.names)}
        self.actions = [_name(self.model.action(a)) for a in range(self.model.n_actions)]
        codes, weights = self._steps.starts(self._numbers)
        self.start = dict(zip(np.searchsorted(self.model.codes, codes).tolist(), weights.tolist(), strict=True))
        self.named_start = {self.names[s]: p for s, p in self.start.items()}
        self._rows_at = lru_cache(maxsize=2)(self._rows)
        self._observed_at = lru_cache(maxsize=2)(self._observed)
        self.rows(0)
        self.observed(0)

    def rows(self, t: int) -> list[list[dict[Any, Fraction]]]:
        """Probabilities of the outcomes (next state, reward, end) at a time, by state and action."""
        return self._rows_at(min(t, self.times - 1))

    def _rows(self, t: int) -> list[list[dict[Any, Fraction]]]:
        steps = self._steps.table(self.model.codes, t, self._numbers).by_step(len(self.names))
        rows = []
        for s in range(len(self.names)):
            rows.append([steps.get((s, a), {}) for a in range(len(self.actions))])
        return rows

    def observed(self, t: int) -> list[Hashable]:
        """Observation in each state at a time; the distribution of it where it is drawn."""
        return self._observed_at(min(t, self.times - 1))

    def _observed(self, t: int) -> list[Hashable]:
        observation = self.task.observation
        if observation.is_state:
            return self.names
        distributions: list[Counter[Hashable]] = [Counter() for _ in self.names]
        for values, state, p in joint_outcomes(observation.nodes, self.model.reads(t), len(self.names), self._numbers):
            flat = np.vstack([value.reshape(-1, len(state)) for value in values])
            for s, value, weight in zip(state.tolist(), flat.T.tolist(), p.tolist(), strict=True):
                distributions[s][tuple(value)] += weight
        return [frozenset(distribution.items()) for distribution in distributions]

    def legal(self, s: int) -> list[Hashable]:
        """Legal actions in a state."""
        if self.model.legal is None:
            return self.actions
        return [self.actions[a] for a in np.flatnonzero(self.model.legal[:, s])]

    def named(self, t: int, s: int, a: int) -> dict[Any, Fraction]:
        """Probabilities of the outcomes of a step, with the names of next states."""
        outcomes = {}
        for (to, reward, ends), p in self.rows(t)[s][a].items():
            outcomes[self.names[to], reward, ends] = p
        return outcomes


def _name(values: Mapping[str, Any]) -> Hashable:
    return tuple((key, str(value)) for key, value in values.items())


def shown(name: Any) -> str:
    """Write a name in words: `x = 2, y = 0`."""
    return ", ".join(f"{key} = {value}" for key, value in name)


def few(parts: Sequence[str], most: int) -> str:
    return "; ".join(parts[:most]) + "; ..." * (len(parts) > most)


def _with_chance(words: str, p: Fraction) -> str:
    if p == 1:
        return words
    return f"{words} with probability {p}"


def _outcome_words(outcomes: Mapping[Any, Fraction], places: int) -> str:
    parts = []
    for (name, reward, ends), p in sorted(outcomes.items(), key=lambda item: (-item[1], repr(item[0]))):
        words = f"{shown(name)}, reward {decimal(reward, places)}"
        if ends:
            words += ", end"
        parts.append(_with_chance(words, p))
    return few(parts, 4)


def _action_words(names: Sequence[Any]) -> str:
    return f"actions {few(list(map(shown, names)), 8)}"


def _start_words(starts: Mapping[Any, Fraction]) -> str:
    states = []
    for name, p in starts.items():
        states.append(_with_chance(shown(name), p))
    return f"starts in {few(states, 4)}"


def _seen_words(label: Any) -> str:
    if not isinstance(label, frozenset):
        return shown(label)
    values = []
    for value, p in sorted(label)[:4]:
        values.append(_with_chance(str(list(value)), p))
    return "; ".join(values)


# -- the first difference ----------------------------------------------------------------------------------------------


def first_difference(one: NamedSteps, other: NamedSteps) -> FirstDifference | None:
    """Search for a difference in order of time; the shortest actions show it."""
    if one.actions != other.actions:
        return FirstDifference((), 0, None, None, _action_words(one.actions), _action_words(other.actions))
    if one.named_start != other.named_start:
        return FirstDifference((), 0, None, None, _start_words(one.named_start), _start_words(other.named_start))
    if one.task.discount != other.task.discount:
        discounts = (f"discount {one.task.discount:g}", f"discount {other.task.discount:g}")
        return FirstDifference((), 0, None, None, *discounts)
    is_alike = one.task.horizon == other.task.horizon
    last = min(one.task.horizon or math.inf, other.task.horizon or math.inf)
    level: dict[int, tuple[str, ...]] = dict.fromkeys(one.start, ())
    seen: set[int] = set()
    t = 0
    while level and t <= last:
        if t == last and not is_alike:
            path = next(iter(level.values()))
            return FirstDifference(path, t, None, None, _end_words(one.task.horizon), _end_words(other.task.horizon))
        if is_alike and one.times == other.times == 1:
            for s in seen.intersection(level):
                del level[s]
            seen |= set(level)
        difference, level = _level(one, other, t, level, t < last)
        if difference is not None:
            return difference
        t += 1
    return None


def _end_words(horizon: int | None) -> str:
    if horizon is None:
        return "no horizon"
    return f"truncated after {horizon} steps"


def _level(
    one: NamedSteps, other: NamedSteps, t: int, level: Mapping[int, tuple[str, ...]], acts: bool
) -> tuple[FirstDifference | None, dict[int, tuple[str, ...]]]:
    following: dict[int, tuple[str, ...]] = {}
    for s, path in level.items():
        same = other.index[one.names[s]]
        state = shown(one.names[s])
        seen = one.observed(t)[s]
        other_seen = other.observed(t)[same]
        if seen != other_seen:
            words = (f"observed {_seen_words(seen)}", f"observed {_seen_words(other_seen)}")
            return FirstDifference(path, t, state, None, *words), {}
        if not acts:
            continue
        legal = one.legal(s)
        other_legal = other.legal(same)
        if legal != other_legal:
            words = (f"legal {_action_words(legal)}", f"legal {_action_words(other_legal)}")
            return FirstDifference(path, t, state, None, *words), {}
        for a, action in enumerate(one.actions):
            outcomes = one.named(t, s, a)
            other_outcomes = other.named(t, same, a)
            here = (*path, shown(action))
            if outcomes != other_outcomes:
                words = (_outcome_words(outcomes, PLACES), _outcome_words(other_outcomes, PLACES))
                if words[0] == words[1]:
                    words = (_outcome_words(outcomes, MOST_PLACES), _outcome_words(other_outcomes, MOST_PLACES))
                return FirstDifference(here, t, state, shown(action), *words), {}
            for to, _, ends in one.rows(t)[s][a]:
                if not ends:
                    following.setdefault(to, here)
    return None, following
