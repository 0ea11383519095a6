"""Evaluate the checks of a phase at its points; keep the best counterexample to each that fails."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Const, Draw, Node, Role, draws
from taskspec.lang.variates import WordLayout, batch_sampler
from taskspec.model.extract import Visits, successors, visits
from taskspec.model.points import Batch, Cost, Grid, Method
from taskspec.model.space import Reads, Space, distinct, holds, union, without
from taskspec.model.transitions import Branch, Steps, branches, count, is_finite
from taskspec.rollout.rollout import visited
from taskspec.soundness.phases import Check, CheckPhase

BATCH = 65_536
"""Points that are evaluated at once."""
MOST_WORDS = 2_000_000
"""Random words that are drawn at once."""
FEW_OUTCOMES = 64
"""Outcomes of draws up to which they are enumerated where points are samples."""
STARTS = 1024
"""First states that are sampled where they are not enumerated."""
SEARCH = 20_000_000
"""Outcomes up to which all states that episodes visit are searched."""
SEARCH_STARTS = 200_000
"""Outcomes of the start up to which they are."""


@dataclass(frozen=True)
class Violation:
    """A check that fails: the values that are read at the counterexample (batch axis of one), and the wrong value."""

    check: Check
    reads: Reads
    value: Array
    state: int | None  # its code, in a finite task
    acting: bool | None  # whether an episode acts in that state; None: unknown


class Examination:
    """The checks of one phase, evaluated at its points."""

    def __init__(self, phase: CheckPhase) -> None:
        self.phase = phase
        self.task = phase.task
        self.layout = WordLayout.of(phase.roots)
        self.enumerated = _enumerated(phase)
        self.rng = np.random.default_rng(1)

    @property
    def method(self) -> Method:
        if not self.phase.checks:
            return Method(True, 0)
        exact = self.phase.exact and len(self.enumerated) == len(self.phase.draws)
        if self.phase.name == "start":
            return Method(exact, int(max(1, count(self.phase.draws, {}))) if exact else STARTS)
        points = self.phase.points
        states = points.states.size if isinstance(points, Grid) else None
        return Method(exact, points.size, states)

    # -- the points -------------------------------------------------------------------------------

    def batches(self) -> Iterator[Batch]:
        if self.phase.name == "start":
            lanes = 1 if len(self.enumerated) == len(self.phase.draws) else STARTS
            yield Batch({}, Cost(self.phase.roots).batch(lanes), None, True)
            return
        outcomes = max(1.0, count(self.enumerated, {}))
        most = min(BATCH, BATCH * 4 // outcomes, MOST_WORDS // max(1, self.layout.count))
        yield from self.phase.points.batches(Cost(self.phase.roots).batch(max(256, most)))

    def flagged(self, batch: Batch) -> Iterator[tuple[Check, Branch, Array, Array]]:
        """Yield checks that fail in a batch: the branch, where (M,) it fails, and the values."""
        words = self.rng.integers(0, 2**32, (self.layout.count, batch.lanes), dtype=np.uint32)
        for branch in branches(self.enumerated, batch.reads, batch.lanes):
            here = words if branch.origin is None else words[:, branch.origin]
            values = iter(evaluate(self.phase.roots, branch.place(batch.reads), self._sample(branch, here)))
            for check in self.phase.checks:
                guards = [next(values) for _ in check.guards]
                value = next(values)
                wrong = check.wrong(value)
                if wrong.any():
                    flags = np.logical_and.reduce(np.broadcast_arrays(wrong, *guards))
                    if flags.any():
                        yield check, branch, flags, value

    def _sample(self, branch: Branch, words: Array) -> Any:
        sampler = batch_sampler(self.layout, words)

        def sample(draw: Draw, args: list[Array]) -> Array:
            known = branch.drawn.get(draw.site)
            return sampler(draw, args) if known is None else known

        return sample

    # -- what fails -------------------------------------------------------------------------------

    def violations(self) -> Iterator[Violation]:
        if not self.phase.checks:
            return
        first: dict[Check, Violation] = {}
        codes: dict[Check, list[Array]] = {}
        for batch in self.batches():
            for check, branch, flags, value in self.flagged(batch):
                if batch.states is not None:
                    codes.setdefault(check, []).append(batch.states[_points(branch, flags)])
                if check not in first:
                    first[check] = _violation(check, batch, branch, flags, value)
        for check, violation in first.items():
            found = codes.get(check)
            if found is None:
                yield violation
            elif (best := self._best(check, union(found))) is not None:
                yield best

    def _best(self, check: Check, states: Array) -> Violation | None:
        """Return the best counterexample: in a state in which episodes act, if there is one."""
        if self.visits is None:
            seen = states[holds(states, self._seen)]
            return self._at(check, int((seen if len(seen) else states)[0]), True if len(seen) else None)
        if self.phase.name == "observation":
            entered = states[holds(states, self.visits.entered)]
            return self._at(check, int((entered if len(entered) else states)[0]), len(entered) > 0)
        acting = states[holds(states, self.visits.acting)]
        if len(acting):
            return self._at(check, int(acting[0]), True)
        if check.section == "expert":  # it does not act there
            return None
        unfinished = without(states, self._finished)
        return self._at(check, int(unfinished[0]), False) if len(unfinished) else None

    def _at(self, check: Check, state: int, acting: bool | None) -> Violation | None:
        """Return the first failure of a check in a state."""
        points = self.phase.points
        assert isinstance(points, Grid)
        for batch in points.batches(BATCH):
            here = np.flatnonzero(np.asarray(batch.states) == state)
            reads = {k: v if v.shape[-1] == 1 else v[..., here] for k, v in batch.reads.items()}
            small = Batch(reads, len(here), here * 0 + state)
            for other, branch, flags, value in self.flagged(small) if len(here) else ():
                if other is check:
                    found = _violation(check, small, branch, flags, value)
                    return Violation(check, found.reads, found.value, state, acting)
        return None

    @cached_property
    def _searchable(self) -> bool:
        """True if the search for states that episodes visit is cheap enough."""
        steps = Steps(self.task)
        if steps.uses_time and self.task.horizon is None:  # the search would not end
            return False
        times = max(1, self.task.horizon or 1) if steps.uses_time else 1
        cost = float(steps.states.size) * steps.actions.size * steps.branching * times
        return cost <= SEARCH and count(draws(steps.first), {}) <= SEARCH_STARTS

    @cached_property
    def _seen(self) -> Array:
        """States of a few episodes, for tasks in which the search for all of them costs too much."""
        found = visited(self.task, self.phase.name == "observation")
        space = Space(self.task.state, Role.STATE)
        return distinct(space.encode([found[c.read] for c in self.task.state], found[Role.TIME, "t"].shape[-1])[0])

    @cached_property
    def visits(self) -> Visits | None:
        """The states of all episodes; None if the search would take too long."""
        try:
            return visits(Steps(self.task)) if self._searchable else None
        except SpecError:
            return None

    @cached_property
    def _finished(self) -> Array:
        """States that only a step which ends the episode can enter: no action is taken there."""
        if isinstance(self.task.terminal, Const) or not isinstance(self.phase.points, Grid):
            return np.zeros(0, np.int64)
        steps = Steps(self.task)
        every = np.arange(steps.states.size)
        found = [successors(steps, every, t) for t in self.phase.points.times or (0,)]
        entered = [steps.starts()[0], *(going for going, _ in found)]
        return without(union([ended for _, ended in found]), union(entered))


def _enumerated(phase: CheckPhase) -> tuple[Draw, ...]:
    """Return draws that are enumerated: finite ones with few outcomes, whose arguments are not sampled."""
    chosen: list[Draw] = []
    known: set[int] = set()
    most = count(phase.draws, {}) if phase.exact else FEW_OUTCOMES
    for draw in phase.draws:
        below: tuple[Node, ...] = draw.args
        if not is_finite(draw) or not all(d.site in known for d in draws(below)):
            continue
        if count([*chosen, draw], {}) <= max(FEW_OUTCOMES, 0 if most == float("inf") else most):
            chosen.append(draw)
            known.add(draw.site)
    return tuple(chosen)


def _points(branch: Branch, flags: Array) -> Array:
    """Return the points of flagged outcomes."""
    if branch.origin is None:
        return np.flatnonzero(flags) if len(flags) > 1 else np.zeros(1, np.int64)
    return branch.origin[flags] if len(flags) > 1 else branch.origin[:1]


def _violation(check: Check, batch: Batch, branch: Branch, flags: Array, value: Array) -> Violation:
    outcome = int(np.flatnonzero(flags)[0])
    point = int(_points(branch, flags)[0])
    reads = {k: v if v.shape[-1] == 1 else v[..., point : point + 1] for k, v in batch.reads.items()}
    seen = value if value.shape[-1] == 1 else value[..., outcome : outcome + 1]
    return Violation(check, reads, seen, None, batch.acting)
