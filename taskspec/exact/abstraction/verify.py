"""Prove that an abstraction is faithful, by a comparison of all of its steps with those of the task.

It is proved if the task can be rewritten over the mapped state (`factor`), or is finite itself, and then agrees with the
stand-in in every state, for every action, in the probability of every outcome.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.exact.abstraction.abstraction import Abstraction
from taskspec.exact.model.extract import extract
from taskspec.exact.model.factor import Unfactored, factored
from taskspec.exact.model.model import Model
from taskspec.exact.model.probabilities import ExactProbabilities, Inexact, Reader
from taskspec.exact.model.space import entries_of
from taskspec.exact.model.transitions import Steps, joint_outcomes, merge_outcomes, outcome_count, total
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import Expression, Refused
from taskspec.language.expressions.variates.entry import once
from taskspec.language.task.questions import reads_time


@dataclass(frozen=True)
class AbstractionCheck:
    """The result of the verification of an abstraction.

    Args:
        problem: a difference from the task; None if none was found.
        why_not: the reason for which there is no proof; None if it is proved.
        has_expert: whether the experts were compared as well, if both are given by expressions.
    """

    problem: str | None = None
    why_not: str | None = None
    has_expert: bool = True

    @property
    def is_proved(self) -> bool:
        return self.problem is None and self.why_not is None


def verify(abstraction: Abstraction) -> AbstractionCheck:
    """Prove an abstraction, or say why it cannot be proved.

    Args:
        abstraction: a task, its stand-in, and the map of states.
    """
    try:
        return _verified(abstraction)
    except (Unfactored, Uncompared, Refused) as error:
        return AbstractionCheck(why_not=str(error))
    except SpecError as error:
        return AbstractionCheck(why_not=error.diagnostics[0].message)


def _verified(abstraction: Abstraction) -> AbstractionCheck:
    task = abstraction.task
    stand_in = abstraction.stand_in
    nodes = abstraction.nodes
    if not task.is_finite:
        task = factored(task, stand_in, nodes)
        nodes = tuple(c.value for c in task.state)
    whole = extract(task, True, MOST_ENTRIES)
    other = extract(stand_in, True, MOST_ENTRIES)
    has_expert = isinstance(task.annotations.expert, tuple) and isinstance(stand_in.annotations.expert, tuple)
    problem = difference(whole, nodes, other, has_expert)
    is_needed = isinstance(abstraction.task.annotations.expert, tuple)
    return AbstractionCheck(problem, None, has_expert or not is_needed)


MOST = 400_000
"""Outcomes of all steps together up to which models are compared."""
MOST_ENTRIES = 2_000_000


class Uncompared(Exception):
    """The models could not be compared; the message is the reason."""


def difference(
    whole: Model, nodes: Sequence[Expression], other: Model, with_expert: bool, as_paid: bool = False
) -> str | None:
    """Search for a difference between a model and the model that its states are mapped to.

    Args:
        whole: the first model.
        nodes: the mapped state, as expressions over the state of the first model.
        other: the second model.
        with_expert: whether the experts, given by expressions, are compared as well.
        as_paid: whether the distributions of rewards have to be the same, instead of their expectations.

    Returns:
        the difference in words; None if there is none.

    Raises:
        Uncompared: there are too many steps, or probabilities that are no rationals.
    """
    try:
        return _Comparison(whole, nodes, other, as_paid).problem(with_expert)
    except Inexact:
        raise Uncompared("probabilities are no rational numbers") from None


class _Comparison:
    """Two models with their steps; `mapped` has the index of each state (S,) in the other one, -1 if it has none."""

    def __init__(self, whole: Model, nodes: Sequence[Expression], other: Model, as_paid: bool) -> None:
        self.whole = whole
        self.other = other
        self.steps = Steps(whole.task, as_paid)
        self.other_steps = Steps(other.task, as_paid)
        self.numbers = ExactProbabilities(Reader())
        codes, outside = other.states.encode(evaluate(nodes, whole.reads()), whole.n_states)
        index = np.minimum(np.searchsorted(other.codes, codes), other.n_states - 1)
        missing = other.codes[index] != codes
        if outside is not None:
            missing |= outside
        self.mapped = np.where(missing, -1, index)

    def problem(self, with_expert: bool) -> str | None:
        is_timed = self.steps.uses_time or self.other_steps.uses_time
        times = 1
        if is_timed:
            times = self.whole.horizon or 1
        for model, steps in ((self.whole, self.steps), (self.other, self.other_steps)):
            if model.n_states * model.n_actions * steps.branching * times > MOST:
                raise Uncompared("there are too many steps to compare")
        nowhere = (self.mapped < 0) & self.whole.entered
        if nowhere.any():
            state = self.whole.state_name(int(np.flatnonzero(nowhere)[0]))
            return f"{state} is mapped to a state that the abstraction is never in"
        different = self._starts() or self._steps(is_timed)
        if different is None and with_expert:
            different = self._experts()
        return different

    def _starts(self) -> str | None:
        codes, weight = self.steps.starts(self.numbers)
        other_codes, other_weight = self.other_steps.starts(self.numbers)
        states = self.mapped[np.searchsorted(self.whole.codes, codes)]
        other_states = np.searchsorted(self.other.codes, other_codes)
        p = total(states, weight, self.other.n_states)
        q = total(other_states, other_weight, self.other.n_states)
        wrong = np.flatnonzero(p != q)
        if not len(wrong):
            return None
        state = int(wrong[0])
        odds = f"probability {float(p[state]):.6g}, and {float(q[state]):.6g} in the abstraction"
        return f"episodes start in {self.other.state_name(state)} with {odds}"

    def _steps(self, is_timed: bool) -> str | None:
        whole = self.whole
        for t, acting in self._levels(is_timed):
            own = _of_steps(whole, self.steps, self.mapped, t, self.numbers)
            others = _of_steps(self.other, self.other_steps, np.arange(self.other.n_states), t, self.numbers)
            rows = np.flatnonzero(np.tile(acting, whole.n_actions))
            action, state = np.divmod(rows, whole.n_states)
            row = own.differs(others, rows, action * self.other.n_states + self.mapped[state])
            if row is not None:
                a, s = divmod(row, whole.n_states)
                where = f"in {whole.state_name(s)} with {whole.action_name(a)}"
                if is_timed:
                    where += f" at t = {t}"
                return f"{where} it gives another reward, end or next state, or with another probability"
        return None

    def _experts(self) -> str | None:
        for t, acting in self._levels(reads_time([*_expert(self.whole), *_expert(self.other)])):
            own = _of_expert(self.whole, t, self.numbers)
            others = _of_expert(self.other, t, self.numbers)
            rows = np.flatnonzero(acting)
            state = own.differs(others, rows, self.mapped[rows])
            if state is not None:
                return f"in {self.whole.state_name(state)} the experts act in different ways"
        return None

    def _levels(self, is_timed: bool) -> Iterator[tuple[int, Array]]:
        """List times with the states (S,) in which episodes act then; a single time if the time does not matter."""
        if is_timed:
            return self.whole.levels()
        return iter([(0, self.whole.acting)])


@dataclass(frozen=True)
class _Rows:
    """Outcomes of each row a*S + s: (mapped) next states, terminations, rewards, in order, and their probabilities.

    Entries `first[r]` to `first[r + 1]` belong to row r. For experts, rows are states, and `to` are actions.
    """

    first: Array
    to: Array
    ends: Array
    reward: Array
    weight: Array

    @classmethod
    def merged(cls, row: Array, to: Array, ends: Array, reward: Array, weight: Array, rows: int) -> _Rows:
        (row, to, ends, reward), weight = merge_outcomes((row, to, ends, reward), weight)
        return cls(np.searchsorted(row, np.arange(rows + 1)), to, ends, reward, weight)

    def differs(self, others: _Rows, rows: Array, theirs: Array) -> int | None:
        """First of some rows whose outcomes differ from the outcomes of the matching row of others; None if all agree."""
        counts = np.diff(self.first)[rows]
        apart = counts != np.diff(others.first)[theirs]
        if not apart.any():
            own = entries_of(self.first[rows], counts)
            other = entries_of(others.first[theirs], counts)
            wrong = np.zeros(len(own), np.bool_)
            for name in ("to", "ends", "reward", "weight"):
                wrong |= once(operator.ne, getattr(self, name)[own], getattr(others, name)[other]).astype(np.bool_)
            apart = np.bincount(np.repeat(np.arange(len(rows)), counts), wrong, len(rows)) > 0
        if apart.any():
            return int(rows[np.flatnonzero(apart)[0]])
        return None


def _of_steps(model: Model, steps: Steps, mapped: Array, t: int, numbers: ExactProbabilities) -> _Rows:
    table = steps.table(model.codes, t, numbers)
    rows = model.n_states * model.n_actions
    return _Rows.merged(table.row, mapped[table.column], table.ends, table.reward, table.weight, rows)


def _of_expert(model: Model, t: int, numbers: ExactProbabilities) -> _Rows:
    nodes = _expert(model)
    if outcome_count(nodes) > MOST:
        raise Uncompared("the expert draws from too many outcomes")
    states = []
    actions = []
    weights = []
    for values, at, weight in joint_outcomes(nodes, model.reads(t), model.n_states, numbers):
        states.append(at)
        actions.append(model.actions.encode(values, len(at))[0])
        weights.append(weight)
    state = np.concatenate(states)
    none = np.zeros(len(state))
    return _Rows.merged(state, np.concatenate(actions), none, none, np.concatenate(weights), model.n_states)


def _expert(model: Model) -> tuple[Any, ...]:
    assert isinstance(model.task.annotations.expert, tuple)
    return model.task.annotations.expert
