"""Compare two finite tasks up to a map of states, step by step: probabilities, rewards and terminations."""

from __future__ import annotations

import operator
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Node, draws, reads
from taskspec.lang.variates.outcomes import once
from taskspec.model.extract import extract
from taskspec.model.model import Model
from taskspec.model.transitions import TIME, Steps, count, joint_outcomes, merge_outcomes
from taskspec.solve.enclosure import Inexact, Reader
from taskspec.solve.rational import ExactProbabilities
from taskspec.task.task import Task

MOST = 400_000
"""Outcomes of all steps together up to which tasks are compared."""
MOST_ENTRIES = 2_000_000
Law = dict[Any, Fraction]
"""Probabilities of outcomes."""


class Uncompared(Exception):
    """The tasks could not be compared: a few words that say why."""


def difference(task: Task, nodes: Sequence[Node], stand_in: Task, with_expert: bool) -> str | None:
    """Return a difference between a finite task and the stand-in that its states are mapped to; None if there is none.

    Args:
        nodes: the mapped state, as expressions over the state of the task.
        with_expert: whether the experts, given by expressions, are compared as well.

    Raises:
        Uncompared: if they are too large, or probabilities are not rationals.
        SpecError: (E712) if one of them has no exact model.
    """
    whole = extract(task, True, MOST_ENTRIES)
    other = extract(stand_in, True, MOST_ENTRIES)
    if max(_size(whole), _size(other)) > MOST:
        raise Uncompared("there are too many steps to compare")
    try:
        return _Comparison(whole, _mapped(whole, nodes, other), other).found(with_expert)
    except Inexact:
        raise Uncompared("probabilities are no rational numbers") from None


def _size(model: Model) -> float:
    """Return an upper bound on the outcomes of all steps together."""
    steps = Steps(model.task)
    return model.n_states * model.n_actions * steps.branching * _times(model, steps.uses_time)


def _times(model: Model, is_timed: bool) -> int:
    return (model.horizon or 1) if is_timed else 1


def _mapped(whole: Model, nodes: Sequence[Node], other: Model) -> Array:
    """Return the index in the other model of each mapped state (S,); -1 if it is not a state of it."""
    values = evaluate(nodes, whole.reads())
    codes, outside = other.states.encode(values, whole.n_states)
    index = np.minimum(np.searchsorted(other.codes, codes), other.n_states - 1)
    missing = (other.codes[index] != codes) | (False if outside is None else outside)
    return np.where(missing, -1, index)


class _Comparison:
    def __init__(self, whole: Model, mapped: Array, other: Model) -> None:
        self.whole = whole
        self.mapped = mapped
        self.other = other
        self.probabilities = ExactProbabilities(Reader())

    def found(self, with_expert: bool) -> str | None:
        nowhere = (self.mapped < 0) & self.whole.entered
        if nowhere.any():
            state = self.whole.state_name(int(np.flatnonzero(nowhere)[0]))
            return f"{state} is mapped to a state that the abstraction is never in"
        return self._starts() or self._steps() or (self._experts() if with_expert else None)

    def _starts(self) -> str | None:
        mine: Law = defaultdict(Fraction)
        for state, p in _first(self.whole, self.probabilities).items():
            mine[int(self.mapped[state])] += p
        others = _first(self.other, self.probabilities)
        for state in sorted(mine.keys() | others.keys()):
            p = mine.get(state, Fraction(0))
            q = others.get(state, Fraction(0))
            if p != q:
                odds = f"probability {float(p):.6g}, and {float(q):.6g} in the abstraction"
                return f"episodes start in {self.other.state_name(state)} with {odds}"
        return None

    def _steps(self) -> str | None:
        times = max(_times(m, Steps(m.task).uses_time) for m in (self.whole, self.other))
        for t, acting in self._acting(times):
            mine = _Laws.of(self.whole, t, self.probabilities, self.mapped)
            others = _Laws.of(self.other, t, self.probabilities, np.arange(self.other.n_states))
            rows = np.flatnonzero(np.tile(acting, self.whole.n_actions))
            row = mine.differs(others, rows, self._row(rows))
            if row is not None:
                action, state = divmod(row, self.whole.n_states)
                where = f"in {self.whole.state_name(state)} with {self.whole.action_name(action)}"
                words = _difference_of_laws(mine.law(row), others.law(self._row(row)))
                return f"{where}{f' at t = {t}' if times > 1 else ''} {words}"
        return None

    def _acting(self, times: int) -> Iterator[tuple[int, Array]]:
        """Return times, and the states (S,) in which episodes act then; a single time if the time does not matter."""
        return self.whole.levels() if times > 1 else iter([(0, self.whole.acting)])

    def _row(self, row: Any) -> Any:
        """Return the rows of the other model that rows a*S + s of the task are mapped to."""
        action, state = np.divmod(row, self.whole.n_states)
        return action * self.other.n_states + self.mapped[state]

    def _experts(self) -> str | None:
        nodes = [node for m in (self.whole, self.other) for node in _expert(m)]
        for t, acting in self._acting(_times(self.whole, TIME in reads(nodes))):
            mine, others = (_Laws.of_expert(m, t, self.probabilities) for m in (self.whole, self.other))
            rows = np.flatnonzero(acting)
            state = mine.differs(others, rows, self.mapped[rows])
            if state is not None:
                return f"in {self.whole.state_name(state)} the experts act in different ways"
        return None


def _difference_of_laws(mine: Law, others: Law) -> str | None:
    for outcome in mine.keys() | others.keys():
        p = mine.get(outcome, Fraction(0))
        q = others.get(outcome, Fraction(0))
        if p != q:
            odds = f"one has probability {float(p):.6g}, and {float(q):.6g} in the abstraction"
            return f"it gives another reward, end or next state: {odds}"
    return None


def _first(model: Model, probabilities: ExactProbabilities) -> Law:
    codes, weights = Steps(model.task).starts(probabilities)
    return dict(zip(np.searchsorted(model.codes, codes).tolist(), weights, strict=True))


@dataclass(frozen=True)
class _Laws:
    """Outcomes of each row a*S + s: (mapped) next states, terminations, rewards, in order, and their probabilities.

    Entries `first[r]` to `first[r + 1]` belong to row r. For experts, rows are states, and `to` are actions.
    """

    first: Array
    to: Array
    ends: Array
    reward: Array
    weight: Array

    @classmethod
    def of(cls, model: Model, t: int, probabilities: ExactProbabilities, mapped: Array) -> _Laws:
        steps = Steps(model.task)
        n = model.n_states
        parts = []
        for a in range(model.n_actions):
            for found in steps.outcomes(model.codes, np.array([a]), t, probabilities):
                at = np.arange(n) if found.origin is None else found.origin
                to = mapped[np.minimum(np.searchsorted(model.codes, found.code), n - 1)]
                values = (a * n + at, to, found.terminal, found.reward, found.weight)
                parts.append(tuple(np.broadcast_to(v, (len(at),)) for v in values))
        return cls._ordered(parts, n * model.n_actions)

    @classmethod
    def of_expert(cls, model: Model, t: int, probabilities: ExactProbabilities) -> _Laws:
        nodes = _expert(model)
        given = model.reads(t)
        parts = []
        if count(draws(nodes), {}) > MOST:
            raise Uncompared("the expert draws from too many outcomes")
        for values, at, weight in joint_outcomes(nodes, given, model.n_states, probabilities):
            action, _ = model.actions.encode(values, len(at))
            parts.append(tuple(np.broadcast_to(v, (len(at),)) for v in (at, action, False, 0.0, weight)))
        return cls._ordered(parts, model.n_states)

    @classmethod
    def _ordered(cls, parts: Sequence[tuple[Array, ...]], rows: int) -> _Laws:
        row, to, ends, reward, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
        (row, to, ends, reward), total = merge_outcomes((row, to, ends, reward), weight)
        return cls(np.searchsorted(row, np.arange(rows + 1)), to, ends, reward, total)

    def differs(self, others: _Laws, rows: Array, theirs: Array) -> int | None:
        """Return the first of some rows whose law differs from that of a row of others."""
        counts = np.diff(self.first)[rows]
        apart = counts != np.diff(others.first)[theirs]
        if not apart.any():
            own = _ranges(self.first[rows], counts)
            other = _ranges(others.first[theirs], counts)
            wrong = np.zeros(len(own), np.bool_)
            for name in ("to", "ends", "reward", "weight"):
                wrong |= once(operator.ne, getattr(self, name)[own], getattr(others, name)[other]).astype(np.bool_)
            apart = np.bincount(np.repeat(np.arange(len(rows)), counts), wrong, len(rows)) > 0
        return int(rows[np.flatnonzero(apart)[0]]) if apart.any() else None

    def law(self, row: int) -> Law:
        here = range(int(self.first[row]), int(self.first[row + 1]))
        return {(self.to[i].item(), self.ends[i].item(), self.reward[i].item()): self.weight[i] for i in here}


def _ranges(first: Array, counts: Array) -> Array:
    """Return the numbers first, first + 1, ... of each range, one range after the other."""
    return np.asarray(np.arange(counts.sum()) + np.repeat(first - np.cumsum(counts) + counts, counts))


def _expert(model: Model) -> tuple[Node, ...]:
    assert isinstance(model.task.expert, tuple)
    return model.task.expert
