"""One step of a finite task at many points at once: every outcome with its probability."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.exact.model.codes import distinct
from taskspec.exact.model.expectation import expected, is_faint
from taskspec.exact.model.failure import refuse
from taskspec.exact.model.lump import lumped
from taskspec.exact.model.outcomes import FLOATS, Branch, branches, count
from taskspec.exact.model.space import MAX_CODES, Reads, Space
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Const, Draw, Node, Role, draws, reads
from taskspec.lang.variates.entry import ProbabilityArithmetic
from taskspec.limits import count as count_of
from taskspec.limits import how_to_raise, limits
from taskspec.task.task import Task

Array = np.ndarray[Any, Any]
TIME = (Role.TIME, "t")


@dataclass(frozen=True)
class Outcomes:
    """What may happen at some of the points.

    Each of `weight`, `code`, `outside` (None: nothing is outside), `reward` and `terminal` has M
    entries, or one that stands for all. `origin` (M,) gives the point of each; None: one each.
    """

    weight: Array
    origin: Array | None
    code: Array
    outside: Array | None
    reward: Array
    terminal: Array


class Steps:
    """The dynamics, reward and termination of a task whose states are finite, ready to be enumerated.

    The reward is the expected one; `as_paid`: what is paid, with the draws that are only in it.
    """

    def __init__(self, task: Task, as_paid: bool = False) -> None:
        self.task = task
        self.states = Space(task.state, Role.STATE)
        self.actions = Space(task.action, Role.ACTION)
        decisive = draws((*task.next, task.terminal))
        self.reward = task.reward if as_paid else expected(task.reward, task.builder, decisive)
        self.is_faint = is_faint(task.reward, self.reward)
        self.roots = lumped((*task.raw_next, self.reward, task.terminal), task.builder)
        self.first = lumped(task.raw_initial, task.builder)

    @cached_property
    def draws(self) -> tuple[Draw, ...]:
        return draws(self.roots)

    @cached_property
    def names(self) -> frozenset[tuple[Role, str]]:
        return reads(self.roots)

    @property
    def uses_time(self) -> bool:
        return TIME in self.names

    @property
    def ends(self) -> bool:
        """Whether some step may terminate."""
        return not (isinstance(self.task.terminal, Const) and not self.task.terminal.value)

    @cached_property
    def branching(self) -> float:
        """An upper bound on the outcomes of one step; infinite where a draw is not finite."""
        return count(self.draws, {})

    def reads(self, states: Array, actions: Array, t: int | None) -> Reads:
        """What is read at points (N,) or (1,) of codes."""
        found = self.states.decode(states, self.names) | self.actions.decode(actions, self.names)
        if self.uses_time:
            found[TIME] = np.array([t], dtype=np.int64)
        return found

    def outcomes(
        self, states: Array, actions: Array, t: int | None = None, numbers: ProbabilityArithmetic = FLOATS
    ) -> Iterator[Outcomes]:
        """Every outcome of acting in states (N,) by actions (N,) or (1,) at time t."""
        lanes = len(states)
        given = self.reads(states, actions, t)
        for branch in branches(self.draws, given, lanes, numbers):
            values = evaluate(self.roots, branch.place(given), branch.sample)
            size = lanes if branch.origin is None else len(branch.origin)
            code, outside = self.states.encode(values[:-2], size)
            yield Outcomes(branch.weight, branch.origin, code, outside, values[-2], values[-1])

    def starts(self, numbers: ProbabilityArithmetic = FLOATS) -> tuple[Array, Array]:
        """Codes (N,) of the first states and their probabilities (N,), each code once.

        Raises:
            SpecError: (E712) when there are too many, or more states than there are codes, or one is outside the state space.
        """
        found, most = count(draws(self.first), {}), limits().outcomes
        if found > most:
            message = f"the start has up to {found:,.0f} outcomes; the limit is {most:,}"
            refuse(message, how_to_raise("outcomes", found))
        if self.states.size > MAX_CODES:
            refuse(f"there are {count_of(self.states.size)} states")
        codes, weights = [], []
        for branch in branches(draws(self.first), {}, 1, numbers):
            values = evaluate(self.first, {}, branch.sample)
            size = 1 if branch.origin is None else len(branch.origin)
            code, outside = self.states.encode(values, size)
            if outside is not None and outside.any():
                refuse("an episode can start outside the state space")
            codes.append(code)
            weights.append(np.broadcast_to(branch.weight, (size,)))
        every = np.concatenate(codes)
        first = distinct(every)
        return first, total(np.searchsorted(first, every), np.concatenate(weights), len(first))


def total(which: Array, values: Array, size: int) -> Array:
    """Sums (size,) of the values (N,) of each group, floats or rationals."""
    if values.dtype != object:
        return np.bincount(which, values, size)
    sums = np.array([Fraction(0)] * size, dtype=object)
    np.add.at(sums, which, values)
    return sums


def acted(actions: Space, nodes: Sequence[Node], given: Reads, branch: Branch, states: int) -> tuple[Array, Array]:
    """Codes of the actions that expressions give in some states for an outcome of their draws, and the state of each."""
    values = evaluate(nodes, branch.place(given), branch.sample)
    at = np.arange(states) if branch.origin is None else branch.origin
    return actions.encode(values, len(at))[0], at
