"""Task -> model: every state, action and outcome enumerated by the array form of the task, in chunks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple, NoReturn

import numpy as np
from scipy import sparse

from taskspec.base.arrays import Array
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits, tell
from taskspec.exact.model.model import Model, NoModel, RoundingTerms, Step, refuse, too_large
from taskspec.exact.model.points import Budget, Cost, duration
from taskspec.exact.model.space import MAX_CODES, Growing, distinct, union
from taskspec.exact.model.transitions import LOOP_FROM, Outcomes, Steps, count, is_finite
from taskspec.language.expressions.ir import Const, Node, draws, walk
from taskspec.language.expressions.types import Kind
from taskspec.language.registry import load
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task, TaskLike

WHOLE = 4_000_000
MANY = 10_000
FEW = 50
"""Of models with less than one in so many of the declared states, all are never taken, such as of boards with two mines."""
NEARLY_ALL = 3 / 4
"""Of so many states, those that episodes enter are searched for, and all are taken once that is nearly all of them."""
MOST_ACTIONS = 10_000_000
SWEEP = 1e9
"""Nominal number of non-zeros of a second: all of them in a sweep for each step of an episode."""
OVERHEAD = 20_000
"""The cost of a sweep whatever the size of the model, as non-zeros."""
LAYER = 5e-4
"""Nominal seconds for the matrices of a time with transitions of its own, however few states there are."""
SMALLEST_NUMBER = 1e-100
LARGEST_NUMBER = 1e100
"""Sizes of the numbers other than 0 of which rewards may be made; no probability is below the smallest."""


def outside_domain(task: Task) -> tuple[str, float] | None:
    """Return the first section with a number outside of the domain of exact models, and the number (E411)."""
    sections = {
        "reward": (task.process.reward,),
        "initial": task.process.initial,
        "dynamics": task.process.next,
        "expert": task.annotations.expert_nodes,
    }
    for value in _sizes([task.process.reward]):
        if not SMALLEST_NUMBER <= value <= LARGEST_NUMBER:
            return "reward", value
    for section, nodes in sections.items():
        for value in _sizes([d.args[0] for d in draws(nodes) if is_finite(d) and d.args]):
            if value < SMALLEST_NUMBER or 0 < 1 - value < SMALLEST_NUMBER:
                return section, value
    return None


def number_words(value: Any) -> str:
    """Return a positive number in three digits."""
    if isinstance(value, Fraction) and value < Fraction(1, 10**300):
        return f"1e-{len(str(value.denominator // value.numerator))}"
    return f"{float(value):.3g}"


def _sizes(nodes: Sequence[Node]) -> Iterator[Any]:
    for node in walk(nodes):
        if isinstance(node, Const) and node.type.kind is Kind.REAL:
            yield from (abs(v) for v in node.flat if v and abs(v) < math.inf)


def extract(task: TaskLike, reachable: bool | None = None, limit: int | None = None) -> Model:
    """Return the exact model of a finite task.

    Args:
        reachable: only states that episodes enter (True), or all declared ones (False); None takes
            all where these are few, or episodes enter nearly all of them.
        limit: how many non-zeros the matrices may have, 12 bytes each; checked, as the time is, before it is spent.

    Raises:
        SpecError: (E712) when the task is not finite or too large.
    """
    task = load(task)
    steps = Steps(task)
    room = _checked_room(steps, limit)
    codes = _codes(steps, room, reachable)
    room.check(len(codes))
    start = np.zeros(len(codes))
    first, weight = steps.starts()
    start[np.searchsorted(codes, first)] = weight
    return _checked(Model(task, steps.states, steps.actions, codes, start, _steps(steps, codes, room.times)))


def lasting(model: Model) -> Model:
    """Return the model with all declared states, where it lacks some that longer episodes would enter.

    Values of states at times at which no episode is there depend on these. A model of few of the declared states, or of too
    many of them, is returned as it is.
    """
    size = model.states.size
    if model.is_closed or model.n_states <= size // FEW or size > WHOLE:
        return model
    with suppress(NoModel):
        return extract(model.task, reachable=False)
    return model


def with_reward(model: Model, reward: Node) -> Model:
    """Return the model with another expression as its reward, such as a measure.

    Raises:
        SpecError: (E712) when that has no exact model.
    """
    task = model.task.with_process(reward=reward)
    steps = Steps(task)
    room = _checked_room(steps, None)
    room.check(model.n_states)
    return _checked(replace(model, task=task, steps=_steps(steps, model.codes, room.times)))


def _checked_room(steps: Steps, limit: int | None) -> _Room:
    """Return the room for a model; refuse (E712) a task that is not finite, or beyond the domain of numbers."""
    task = steps.task
    _check_finite(steps)
    problem = outside_domain(task)
    if problem is not None:
        refuse(
            f"the {problem[0]} has the number {number_words(problem[1])}, which is outside of the domain of numbers (E411)"
        )
    times = 1
    if steps.uses_time and task.horizon is not None:
        times = task.horizon
    return _Room(steps, times, limits().transitions if limit is None else limit)


def _checked(model: Model) -> Model:
    """Return a model; refuse (E712) one whose episodes leave the state space, or are paid no number."""
    for t, step in enumerate(model.steps):
        _check_step(model, step, t)
    return model


def _codes(steps: Steps, room: _Room, reachable: bool | None) -> Array:
    size = steps.states.size
    if reachable is None:
        reachable = size > min(WHOLE, room.states)
        if not reachable and size >= MANY:
            with suppress(NoModel):
                return visits(steps, int(NEARLY_ALL * size)).entered
    if reachable:
        return visits(steps, room.states, room.hint, room.each).entered
    room.check(size)
    return np.arange(size)


class _Room:
    """Limits on the size of a model: its transitions, the time to find them, and that to plan an episode with them."""

    def __init__(self, steps: Steps, times: int, most: int) -> None:
        self.horizon = steps.task.horizon or 1
        self.times = times
        self.most = most
        self.cost = Cost(steps.roots)
        self.per_state = max(1.0, steps.actions.size * steps.branching * times)
        self.each = f"each with up to {count_of(int(self.per_state))} transitions"
        affordable = self.cost.affordable()
        self.states = max(1, int(min(most, affordable) // self.per_state))
        self.hint = how_to_raise("transitions", 10 * most)
        if affordable < most:
            self.hint = how_to_raise("seconds", 10 * limits().seconds)

    def check(self, states: int) -> None:
        """Refuse (E712) a model of so many states if it has no room."""
        size = states * self.per_state
        if size > self.most:
            message = f"the exact model would have up to {count_of(int(size))} transitions; the limit is {self.most:,}"
            too_large(message, how_to_raise("transitions", size))
        seconds = limits().seconds
        needed = self.cost.seconds(size) + LAYER * (self.times - 1)
        if needed > seconds:
            message = f"the exact model would take {duration(needed)}; the limit is {seconds}"
            too_large(message, how_to_raise("seconds", needed))
        needed = self.horizon * (size / self.times + OVERHEAD) / SWEEP
        if needed > seconds:
            message = f"to plan an episode of {self.horizon:,} steps takes {duration(needed)}; the limit is {seconds}"
            too_large(message, how_to_raise("seconds", needed))


def _check_step(model: Model, step: Step, t: int) -> None:
    """Refuse a model in which an episode can leave the state space, or be paid no number; no episode acts elsewhere."""
    shape = (model.n_actions, model.n_states)
    wrong = ~np.isfinite(step.R)
    problems = [(wrong, "the reward is not finite")]
    if step.escaping is not None:
        problems.insert(0, (step.escaping, "the next state is outside the state space"))
    for rows, message in problems:
        action, state = np.nonzero(rows.reshape(shape) & model.acting)
        if len(state):
            when = ""
            if model.is_timed:
                when = f" at t = {t}"
            place = f"{model.state_name(int(state[0]))} with {model.action_name(int(action[0]))}{when}"
            refuse(f"{message}, from {place}")
    step.R[wrong] = 0.0


def _check_finite(steps: Steps) -> None:
    task = steps.task
    for c in (*task.state, *task.action):
        if not c.is_finite:
            hint = "give the spec an `abstraction`"
            if c.type.kind is Kind.INT:
                hint = "give it bounds, or the spec an `abstraction`"
            refuse(f"'{c.name}' has infinitely many values", hint)
    most = limits().outcomes
    if steps.branching > most:
        for draw in steps.draws:
            if count([draw], {}) == math.inf:
                refuse(f"a step draws from a {draw.base} distribution, which has infinitely many outcomes")
        message = f"a step has up to {steps.branching:,.0f} outcomes; the limit is {most:,}"
        too_large(message, how_to_raise("outcomes", steps.branching))
    if steps.uses_time and task.horizon is None:
        refuse("dynamics or rewards depend on the time, and there is no horizon")
    if steps.states.size > MAX_CODES or steps.actions.size > MOST_ACTIONS:
        too_large(f"there are {count_of(steps.states.size)} states and {count_of(steps.actions.size)} actions")


# -- the states that episodes visit: a search from the start, level by level, up to the horizon ---------------------------

VISITED = 65_536
"""The number of pairs of a state and an action that are stepped at once."""
LEVEL = 2e-4
"""Seconds for a level of the search, however few states there are."""
SORTED = 10
"""Operations for which a state has its place among those that a step leads to."""
CODED = 3
"""Operations by which an element of a state is read from its code, or written into it."""
MERGED = 300
"""Operations by which a state is looked up among those that are known, and put among them."""
HELD = 1_000_000
"""The number of outcomes of steps that are held at once."""


@dataclass(frozen=True)
class Visits:
    """Codes of states, sorted: those where an action is taken, and all that are entered."""

    acting: Array
    entered: Array


def visits(steps: Steps, limit: int | None = None, hint: str | None = None, each: str = "") -> Visits:
    """Return the states of all episodes, for all actions and draws. Steps out of the state space are passed over."""
    horizon = steps.task.horizon
    level = distinct(steps.starts()[0])
    acting = Growing()
    entered = Growing()
    entered.add(level)
    budget = Budget("the steps until episodes find no new state")
    cost = Cost(steps.roots, beside=SORTED + CODED * sum(map(len, steps.states.strides)))
    merging = Cost((), beside=MERGED)
    if limit is not None and entered.size > limit:
        _too_many_states(limit, hint, each)
    t = 0
    while len(level) and t != horizon:
        budget.spend(merging, len(level), LEVEL)
        acting.add(level)
        ahead = []
        for going, ended in _batches(steps, level, t, lambda outcomes: budget.spend(cost, outcomes)):
            ahead.append(going)
            entered.add(union([going, ended]))
            if limit is not None and entered.size > limit:
                _too_many_states(limit, hint, each)
        level = union(ahead)
        if not steps.uses_time:
            level = acting.without(level)
        t += 1
    return Visits(acting.all(), entered.all())


def _too_many_states(limit: int, hint: str | None, each: str) -> NoReturn:
    costs = ""
    if each:
        costs = f", {each}"
    remedy = None
    if hint:
        remedy = f"choose smaller parameters, or: {hint}"
    too_large(f"more than {limit:,} states can be reached{costs}", remedy)


def successors(steps: Steps, states: Array, t: int) -> tuple[Array, Array]:
    """Return the states entered from given states: those in which the episode goes on, and those in which it ends."""
    going = [states[:0]]
    ended = [states[:0]]
    for on, over in _batches(steps, states, t, lambda outcomes: None):
        going.append(on)
        ended.append(over)
    return union(going), union(ended)


def _batches(steps: Steps, states: Array, t: int, spend: Callable[[int], None]) -> Iterator[tuple[Array, Array]]:
    """Yield successors of a few states at a time: where the episode goes on, and where it ends; `spend` counts outcomes."""
    per_chunk = max(1, int(min(VISITED, HELD // max(1.0, steps.branching))) // steps.actions.size)
    for low in range(0, len(states), per_chunk):
        some = states[low : low + per_chunk]
        tell(f"looking for states, step {t + 1:,}: {low:,} of {len(states):,} looked at")
        for first in range(0, steps.actions.size, VISITED):
            actions = np.arange(first, min(steps.actions.size, first + VISITED))
            for outcomes in steps.outcomes(np.tile(some, len(actions)), np.repeat(actions, len(some)), t):
                spend(len(outcomes.code))
                if outcomes.outside is None:
                    inside = np.ones(len(outcomes.code), np.bool_)
                else:
                    inside = ~outcomes.outside
                going = distinct(outcomes.code[inside & ~outcomes.terminal])
                ended = distinct(outcomes.code[inside & outcomes.terminal])
                yield going, ended


# -- matrices ---------------------------------------------------------------------------------------------------------

CHUNK = 16_384
TIDY = 2_000_000
"""Up to this many non-zeros, equal columns of a row are merged and sorted."""


class Rows(NamedTuple):
    """Some consecutive rows: entries in each (n,), columns, probabilities, ends (or None), rewards (n,).

    The rewards of all outcomes are from `lowest` to `highest`; `escaping` (n,) marks rows that leave the state space.
    """

    counts: Array
    columns: Array
    weights: Array
    ends: Array | None
    reward: Array
    lowest: float
    highest: float
    escaping: Array | None = None


def _steps(steps: Steps, codes: Array, times: int) -> tuple[Step, ...]:
    extracted: list[Step] = []
    total = len(codes) * steps.actions.size
    for t in range(times):
        parts = []
        row = 0
        for part in _all_rows(steps, codes, t):
            parts.append(part)
            row += len(part.counts)
            tell(f"{row:,} of {total:,} rows of the model{f' at t = {t:,}' if t else ''}")
        step = _assembled(parts, len(codes))
        if extracted and extracted[-1].same(step):
            step = extracted[-1]
        extracted.append(step)
    if all(step is extracted[0] for step in extracted):
        return (extracted[0],)
    return tuple(extracted)


def _all_rows(steps: Steps, codes: Array, t: int) -> Iterator[Rows]:
    """Yield rows in order: action by action where there are many states, all actions at once where there are few."""
    size = len(codes)
    actions = steps.actions.size
    if size >= LOOP_FROM:
        chunks = np.array_split(codes, max(1, size // CHUNK))  # none so small that it would be treated otherwise
        for a in range(actions):
            for chunk in chunks:
                yield _rows(steps, codes, chunk, np.array([a]), t)
        return
    per_chunk = max(1, int(CHUNK * 4 // max(1.0, min(steps.branching, CHUNK))))
    for low in range(0, size * actions, per_chunk):
        action, state = np.divmod(np.arange(low, min(size * actions, low + per_chunk)), size)
        yield _rows(steps, codes, codes[state], action, t)


def _rows(steps: Steps, codes: Array, states: Array, actions: Array, t: int) -> Rows:
    outcomes = list(steps.outcomes(states, actions, t))
    n = len(states)
    lowest = min(float(np.min(f.reward, where=np.isfinite(f.reward), initial=0.0)) for f in outcomes)
    highest = max(float(np.max(f.reward, where=np.isfinite(f.reward), initial=0.0)) for f in outcomes)
    if any(f.outside is not None or f.origin is not None for f in outcomes):
        return _irregular(steps, codes, outcomes, n)._replace(lowest=lowest, highest=highest)
    k = len(outcomes)  # every outcome happens at every point
    columns = np.empty((n, k), np.int32)
    weights = np.empty((n, k))
    ends = np.empty((n, k), np.bool_)
    reward = np.zeros(n)
    for i, f in enumerate(outcomes):
        columns[:, i] = _columns(codes, f.code)
        weights[:, i] = f.weight
        ends[:, i] = f.terminal
        reward += f.weight * f.reward
    flat = None
    if steps.ends:
        flat = ends.reshape(-1)
    return Rows(np.full(n, k), columns.reshape(-1), weights.reshape(-1), flat, reward, lowest, highest)


def _irregular(steps: Steps, codes: Array, outcomes: list[Outcomes], n: int) -> Rows:
    """Return rows of any lengths; outcomes outside of the state space are paid, and have no weight."""
    points, codes_reached, weights, reward, ends, outside = (
        np.concatenate(x) for x in zip(*(f.spread(n) for f in outcomes), strict=True)
    )
    columns = _columns(codes, codes_reached)
    if len(outcomes) > 1:
        order = np.argsort(points, kind="stable")
        points, columns, weights, reward, ends, outside = (
            x[order] for x in (points, columns, weights, reward, ends, outside)
        )
    counts = np.bincount(points, minlength=n)
    total = np.bincount(points, weights * reward, minlength=n)
    escaping = None
    if outside.any():
        escaping = np.zeros(n, np.bool_)
        escaping[points[outside]] = True
        weights = np.where(outside, 0.0, weights)
    return Rows(counts, columns, weights, ends if steps.ends else None, total, 0.0, 0.0, escaping)


def _columns(codes: Array, reached: Array) -> Array:
    """Return indices of the states reached; `extract` sees to it that none that matters is outside."""
    if len(codes) and codes[-1] == len(codes) - 1:
        return np.minimum(reached, len(codes) - 1).astype(np.int32)
    return np.minimum(np.searchsorted(codes, reached), len(codes) - 1).astype(np.int32)


def _assembled(parts: list[Rows], states: int) -> Step:
    counts = np.concatenate([part.counts for part in parts])
    columns = np.concatenate([part.columns for part in parts])
    weights = np.concatenate([part.weights for part in parts])
    reward = np.concatenate([part.reward for part in parts])
    indptr = np.zeros(len(counts) + 1, np.int32 if len(columns) < 2**31 else np.int64)
    np.cumsum(counts, out=indptr[1:])
    entries = [(weights, columns, indptr)]
    if parts[0].ends is not None:
        ends = np.concatenate([part.ends for part in parts if part.ends is not None])
        entries = []
        for chosen in (~ends, ends):
            before = np.zeros(len(chosen) + 1, indptr.dtype)
            np.cumsum(chosen, out=before[1:])
            entries.append((weights[chosen], columns[chosen], before[indptr]))
    matrices = []
    for entry in entries:
        matrix = sparse.csr_array(entry, shape=(len(counts), states))
        if len(columns) <= TIDY:
            matrix.sum_duplicates()
            matrix.eliminate_zeros()
        matrices.append(matrix)
    escaping = None
    if any(part.escaping is not None for part in parts):
        flags = [np.zeros(len(part.counts), np.bool_) if part.escaping is None else part.escaping for part in parts]
        escaping = np.concatenate(flags)
    lowest = min(part.lowest for part in parts)
    highest = max(part.highest for part in parts)
    rounding = RoundingTerms(int(counts.max(initial=0)), lowest, highest)
    P_end = None
    if len(matrices) > 1:
        P_end = matrices[1]
    return Step(matrices[0], P_end, reward, rounding, escaping)


# -- the model of a finite decision process that is given by its outcomes ---------------------------------------------

SPEC = """\
taskspec: 1
name: Tabulated
state: {{s: {{type: int, low: 0, high: {last_state}}}}}
action: {{a: {{type: int, low: 0, high: {last_action}}}}}
horizon: {horizon}
discount: {discount!r}
initial: {{s: 0}}
dynamics: {{s': s}}
reward: 0
"""
"""What gives names to the states and actions."""
TableOutcome = tuple[int, int, int, float, float, bool]
"""A state, an action, the next state, its probability, the reward, and whether the episode ends there."""


def tabulated(
    outcomes: Iterable[TableOutcome], start: Array, actions: int, horizon: int | None, discount: float = 1.0,
    legal: Array | None = None,
) -> Model:  # fmt: skip
    """Return the model of some outcomes; states in which no episode acts need none.

    Args:
        outcomes: of each state and action.
        start: float64 (S,), the probabilities of first states.
        actions: their number.
        horizon: of episodes.
        discount: of rewards.
        legal: bool (A, S), the legal actions; None where all are.
    """
    n = len(start)
    s, a, to, p, reward, ends = map(np.array, zip(*outcomes, strict=True))
    row = (a * n + s).astype(np.int32)
    shape = (actions * n, n)
    matrices = []
    for kept in (~ends, ends):
        entries = (p[kept], (row[kept], to[kept].astype(np.int32)))
        matrices.append(sparse.csr_array(entries, shape=shape))
    rounding = RoundingTerms(int(np.bincount(row).max()), min(0.0, reward.min()), max(0.0, reward.max()))
    step = Step(matrices[0], matrices[1], np.bincount(row, p * reward, shape[0]), rounding)
    numbers = {"last_state": n - 1, "last_action": actions - 1, "horizon": horizon or "none", "discount": discount}
    task = build(read_text(SPEC.format(**numbers), "tabulated.yaml"))
    steps = Steps(task)
    return Model(task, steps.states, steps.actions, np.arange(n), start, (step,), legal)
