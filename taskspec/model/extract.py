"""Task -> model: every state, action and outcome enumerated by the array form of the task, in chunks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits, tell
from taskspec.lang.ir import Const, Node, draws, walk
from taskspec.lang.types import Kind
from taskspec.model.cost import Cost, duration
from taskspec.model.model import Model, NoModel, Step, refuse, scipy_sparse
from taskspec.model.reach import visits
from taskspec.model.rows import RowCollector, all_rows
from taskspec.model.space import MAX_CODES
from taskspec.model.transitions import Steps, count, is_finite
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike

WHOLE = 4_000_000
MANY = 10_000
FEW = 50
"""Of so many states it is tried whether episodes enter less than one in so many, such as on boards with two mines."""
MOST_ACTIONS = 10_000_000
SWEEP = 1e9
"""Non-zeros that are gone through in a second, nominally: all of them in a sweep for each step of an episode."""
OVERHEAD = 20_000
"""What a sweep costs whatever the size of the model, as non-zeros."""
LAYER = 5e-4
"""Seconds that a time with transitions of its own takes, nominally, however few states there are: matrices are made for it."""


SMALLEST_NUMBER = 1e-100
LARGEST_NUMBER = 1e100
"""Sizes of the numbers other than 0 of which rewards may be made; no probability is below the smallest."""


def outside_domain(task: Task) -> tuple[str, float] | None:
    """Return the first section with a number outside of the domain of exact models, and the number (E411)."""
    sections = {
        "reward": (task.reward,),
        "initial": task.initial,
        "dynamics": task.next,
        "expert": task.expert if isinstance(task.expert, tuple) else (),
    }
    for value in _sizes([task.reward]):
        if not SMALLEST_NUMBER <= value <= LARGEST_NUMBER:
            return "reward", value
    for section, nodes in sections.items():
        probabilities = [d.args[0] for d in draws(nodes) if is_finite(d) and d.args]
        for value in _sizes(probabilities):
            if value < SMALLEST_NUMBER or 0 < 1 - value < SMALLEST_NUMBER:
                return section, value
    return None


def number_words(value: Any) -> str:
    """Return a positive number in three digits."""
    digits = len(str(value.denominator // value.numerator)) if isinstance(value, Fraction) and value < 1 else 0
    return f"1e-{digits}" if digits > 300 else f"{float(value):.3g}"


def _sizes(nodes: Sequence[Node]) -> Iterator[Any]:
    """Yield the sizes of constant reals other than 0 of which some nodes are made."""
    for node in walk(nodes):
        if isinstance(node, Const) and node.type.kind is Kind.REAL:
            yield from (abs(v) for v in node.flat if v and abs(v) < math.inf)


def extract(task: TaskLike, reachable: bool | None = None, limit: int | None = None) -> Model:
    """Return the exact model of a finite task.

    Args:
        reachable: only states that episodes enter (True), or all declared ones (False); None takes
            all where that is cheap, and episodes enter more than a few of them.
        limit: how many non-zeros the matrices may have, 12 bytes each; checked, as the time is, before it is spent.

    Raises:
        SpecError: (E712) when the task is not finite or too large; (E705) without scipy.
    """
    scipy_sparse()
    task = load(task)
    steps = Steps(task)
    _check_finite(steps)
    found = outside_domain(task)
    if found is not None:
        refuse(
            f"the {found[0]} has the number {number_words(found[1])}, which is outside of the domain of numbers (E411)"
        )
    times = task.horizon or 1 if steps.uses_time else 1
    room = _Room(steps, times, limits().transitions if limit is None else limit)
    codes = _codes(steps, room, reachable)
    room.check(len(codes))
    start = np.zeros(len(codes))
    first, weight = steps.starts()
    start[np.searchsorted(codes, first)] = weight
    model = Model(task, steps.states, steps.actions, codes, start, _steps(steps, codes, times))
    _check_inside(model)
    _check_rewards(model)
    return model


def _codes(steps: Steps, room: _Room, reachable: bool | None) -> Array:
    """Return the states of the model, in order."""
    size = steps.states.size
    if reachable is None:
        reachable = size > min(WHOLE, room.states)
        if not reachable and size >= MANY:
            with suppress(NoModel):
                return visits(steps, size // FEW).entered
    if reachable:
        return visits(steps, room.states, room.hint, room.each).entered
    room.check(size)
    return np.arange(size)


class _Room:
    """How large a model may be: its transitions, the time to find them, and that to plan an episode with them."""

    def __init__(self, steps: Steps, times: int, most: int) -> None:
        self.horizon = steps.task.horizon or 1
        self.times = times
        self.most = most
        self.cost = Cost(steps.roots)
        self.per_state = max(1.0, steps.actions.size * steps.branching * times)

    @property
    def states(self) -> int:
        """How many states there may be."""
        return max(1, int(min(self.most, self.cost.affordable()) // self.per_state))

    @property
    def each(self) -> str:
        """What a state costs, in words."""
        return f"each with up to {count_of(int(self.per_state))} transitions"

    @property
    def hint(self) -> str | None:
        """What to raise when there are more."""
        if self.cost.affordable() < self.most:
            return how_to_raise("seconds", 10 * limits().seconds)
        return how_to_raise("transitions", 10 * self.most)

    def check(self, states: int) -> None:
        """Refuse (E712) a model of so many states if it has no room."""
        size = states * self.per_state
        if size > self.most:
            message = f"the exact model would have up to {count_of(int(size))} transitions; the limit is {self.most:,}"
            refuse(message, how_to_raise("transitions", size))
        needed = self.cost.seconds(size) + LAYER * (self.times - 1)
        if needed > limits().seconds:
            message = f"the exact model would take {duration(needed)}; the limit is {limits().seconds}"
            refuse(message, how_to_raise("seconds", needed))
        needed = self.horizon * (size / self.times + OVERHEAD) / SWEEP
        if needed > limits().seconds:
            message = f"to plan an episode of {self.horizon:,} steps takes {duration(needed)}; the limit is {limits().seconds}"
            refuse(message, how_to_raise("seconds", needed))


def _check_inside(model: Model) -> None:
    """Refuse a model in which an episode can leave the state space."""
    for t, step in enumerate(model.steps):
        if step.escaping is None:
            continue
        wrong = step.escaping.reshape(model.n_actions, model.n_states) & model.acting
        if wrong.any():
            action, state = (int(i[0]) for i in np.nonzero(wrong))
            when = f" at t = {t}" if model.is_timed else ""
            place = f"{model.state_name(state)} with {model.action_name(action)}{when}"
            refuse(f"the next state is outside the state space, from {place}")


def _check_rewards(model: Model) -> None:
    """Refuse a model in which an episode can be paid what is no number; where no episode acts, nothing is paid."""
    for t, step in enumerate(model.steps):
        wrong = ~np.isfinite(step.R.reshape(model.n_actions, model.n_states))
        if not wrong.any():
            continue
        if (wrong & model.acting).any():
            action, state = (int(i[0]) for i in np.nonzero(wrong & model.acting))
            when = f" at t = {t}" if model.is_timed else ""
            refuse(f"the reward is not finite, from {model.state_name(state)} with {model.action_name(action)}{when}")
        step.R[wrong.reshape(-1)] = 0.0


def _check_finite(steps: Steps) -> None:
    task = steps.task
    for c in (*task.state, *task.action):
        if not c.is_finite:
            refuse(f"'{c.name}' has infinitely many values", "give it bounds, or the spec an `abstraction`")
    most = limits().outcomes
    if steps.branching > most:
        found = next((d for d in steps.draws if count([d], {}) == float("inf")), None)
        if found is not None:
            refuse(f"a step draws from a {found.base} distribution, which has infinitely many outcomes")
        refuse(f"a step has up to {steps.branching:,.0f} outcomes; the limit is {most:,}",
               how_to_raise("outcomes", steps.branching))  # fmt: skip
    if steps.uses_time and task.horizon is None:
        refuse("dynamics or rewards depend on the time, and there is no horizon")
    if steps.states.size > MAX_CODES or steps.actions.size > MOST_ACTIONS:
        refuse(f"there are {count_of(steps.states.size)} states and {count_of(steps.actions.size)} actions")


def _steps(steps: Steps, codes: Array, times: int) -> tuple[Step, ...]:
    found: list[Step] = []
    for t in range(times):
        step = _step(steps, codes, t)
        found.append(found[-1] if found and found[-1].same(step) else step)
    if all(step is found[0] for step in found):
        return (found[0],)
    return tuple(found)


def _step(steps: Steps, codes: Array, t: int) -> Step:
    rows = len(codes) * steps.actions.size
    sink = RowCollector(rows, int(rows * steps.branching))
    for some in all_rows(steps, codes, t):
        sink.add(some)
        tell(f"{sink.row:,} of {rows:,} rows of the model{f' at t = {t:,}' if t else ''}")
    return sink.step(len(codes))
