"""Task -> model: every state, action and outcome enumerated by the array form of the task, in chunks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskspec.exact.failure import refuse, scipy_sparse
from taskspec.exact.model import Model, Step
from taskspec.exact.outcomes import LOOP_FROM, count
from taskspec.exact.reach import visits
from taskspec.exact.transitions import MAX_OUTCOMES, Outcomes, Steps
from taskspec.lang.ir import draws
from taskspec.spec.task import Task

Array = np.ndarray[Any, Any]
MAX_ENTRIES = 50_000_000
"""Non-zeros that a model may have: 12 bytes each, so 600 MB."""
CHUNK = 16_384
WHOLE = 4_000_000
TIDY = 2_000_000
"""Up to this many non-zeros, equal columns of a row are merged and sorted."""


def extract(task: Task, reachable: bool | None = None, limit: int = MAX_ENTRIES) -> Model:
    """The exact model of a finite task.

    Args:
        reachable: only states that episodes enter (True), or all declared ones (False); None takes
            all where that is cheap.
        limit: how many non-zeros the matrices may have; checked before memory is spent.

    Raises:
        SpecError: (E712) when the task is not finite or too large; (E705) without scipy.
    """
    scipy_sparse()
    steps = Steps(task)
    _check_finite(steps)
    per_state = steps.actions.size * steps.branching
    times = task.horizon or 1 if steps.uses_time else 1
    if reachable is None:
        reachable = steps.states.size > WHOLE or steps.states.size * per_state * times > limit
    codes = _reachable(steps, limit) if reachable else np.arange(steps.states.size)
    size = len(codes) * per_state * times
    if size > limit:
        refuse(f"the exact model would have up to {size:,.0f} entries; the limit is {limit:,}", "choose smaller parameters")
    start = np.zeros(len(codes))
    first, weight = steps.starts()
    start[np.searchsorted(codes, first)] = weight
    model = Model(task, steps.states, steps.actions, codes, start, _steps(steps, codes, times))
    _check_inside(model)
    return model


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


def _check_finite(steps: Steps) -> None:
    task = steps.task
    for c in (*task.state, *task.action):
        if not c.is_finite:
            refuse(f"'{c.name}' has infinitely many values", "give it bounds, or the spec an `abstraction`")
    if steps.branching > MAX_OUTCOMES:
        found = next((d for d in steps.draws if count([d], {}) == float("inf")), None)
        if found is not None:
            refuse(f"a step draws from a {found.base} distribution, which has infinitely many outcomes")
        refuse(f"a step has up to {steps.branching:,.0f} outcomes; the limit is {MAX_OUTCOMES:,}")
    if count(draws(task.initial), {}) > MAX_OUTCOMES:
        refuse("the start has too many outcomes to enumerate")
    if steps.uses_time and task.horizon is None:
        refuse("dynamics or rewards depend on the time, and there is no horizon")
    if steps.states.size > 2**62 or steps.actions.size > 10_000_000:
        refuse(f"there are {steps.states.size:,} states and {steps.actions.size:,} actions")


def _reachable(steps: Steps, limit: int) -> Array:
    return visits(steps, int(limit // max(1, steps.actions.size))).entered


def _steps(steps: Steps, codes: Array, times: int) -> tuple[Step, ...]:
    found: list[Step] = []
    for t in range(times):
        step = _step(steps, codes, t)
        found.append(found[-1] if found and found[-1].same(step) else step)
    if all(step is found[0] for step in found):
        return (found[0],)
    return tuple(found)


# -- rows of the matrices -------------------------------------------------------------------------


@dataclass(frozen=True)
class _Rows:
    """Some consecutive rows: entries in each (n,), columns, probabilities, ends (or None), rewards (n,)."""

    counts: Array
    columns: Array
    weights: Array
    ends: Array | None
    reward: Array
    escaping: Array | None = None


def _step(steps: Steps, codes: Array, t: int) -> Step:
    rows = list(_all_rows(steps, codes, t))
    sparse = scipy_sparse()
    counts = np.concatenate([r.counts for r in rows])
    indptr = np.concatenate(([0], np.cumsum(counts)))
    index: Any = np.int32 if indptr[-1] < 2**31 else np.int64
    columns = np.concatenate([r.columns for r in rows])
    weights = np.concatenate([r.weights for r in rows])
    reward = np.concatenate([r.reward for r in rows])
    shape = (len(counts), len(codes))
    parts = [weights]
    if any(r.ends is not None for r in rows):
        ends = np.concatenate([np.zeros(len(r.columns), np.bool_) if r.ends is None else r.ends for r in rows])
        parts = [np.where(ends, 0.0, weights), np.where(ends, weights, 0.0)]
    built = [sparse.csr_array((data, columns, indptr.astype(index)), shape=shape) for data in parts]
    if len(columns) <= TIDY:
        built = [_tidy(matrix.copy()) for matrix in built]
    escaping = None
    if any(r.escaping is not None for r in rows):
        escaping = np.concatenate([_or_none(r) for r in rows])
    return Step(built[0], built[1] if len(built) > 1 else None, reward, escaping)


def _or_none(rows: _Rows) -> Array:
    return np.zeros(len(rows.counts), np.bool_) if rows.escaping is None else rows.escaping


def _tidy(matrix: Any) -> Any:
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix


def _all_rows(steps: Steps, codes: Array, t: int) -> Iterator[_Rows]:
    """Rows in order: action by action where there are many states, all actions at once where there are few."""
    size, actions = len(codes), steps.actions.size
    if size >= LOOP_FROM:
        for a in range(actions):
            for low in range(0, size, CHUNK):
                yield _rows(steps, codes, codes[low : low + CHUNK], np.array([a]), t)
        return
    per_chunk = max(1, int(CHUNK * 4 // max(1.0, min(steps.branching, CHUNK))))
    for low in range(0, size * actions, per_chunk):
        action, state = np.divmod(np.arange(low, min(size * actions, low + per_chunk)), size)
        yield _rows(steps, codes, codes[state], action, t)


def _rows(steps: Steps, codes: Array, states: Array, actions: Array, t: int) -> _Rows:
    found = list(steps.outcomes(states, actions, t))
    if any(f.outside is not None for f in found):
        return _escaping(steps, codes, found, len(states))
    if all(f.origin is None for f in found):
        return _regular(steps, codes, found, len(states))
    return _irregular(steps, codes, found, len(states))


def _escaping(steps: Steps, codes: Array, found: list[Outcomes], n: int) -> _Rows:
    """Rows some of which leave the state space; they are marked, and those outcomes have no weight."""
    kept, escaping = [], np.zeros(n, np.bool_)
    for f in found:
        if f.outside is not None:
            points = np.arange(n) if f.origin is None else f.origin
            escaping[points[f.outside]] = True
            f = replace(f, weight=np.where(f.outside, 0.0, f.weight))
        kept.append(f)
    paid = _irregular(steps, codes, found, n).reward
    return replace(_irregular(steps, codes, kept, n), reward=paid, escaping=escaping)


def _regular(steps: Steps, codes: Array, found: list[Outcomes], n: int) -> _Rows:
    """Every outcome happens at every point: rows of one length."""
    k = len(found)
    columns = np.empty((n, k), np.int32)
    weights = np.empty((n, k))
    reward: Any = 0.0
    for i, f in enumerate(found):
        columns[:, i] = _columns(codes, f)
        weights[:, i] = f.weight
        reward = reward + f.weight * f.reward
    reward = np.broadcast_to(reward, (n,))
    ends = None
    if steps.ends:
        ends = np.stack([np.broadcast_to(f.terminal, (n,)) for f in found], axis=1).reshape(-1)
    return _Rows(np.full(n, k), columns.reshape(-1), weights.reshape(-1), ends, reward)


def _irregular(steps: Steps, codes: Array, found: list[Outcomes], n: int) -> _Rows:
    points = np.concatenate([np.arange(n) if f.origin is None else f.origin for f in found])
    sizes = [len(f.code) for f in found]

    def joined(name: str) -> Array:
        return np.concatenate([np.broadcast_to(getattr(f, name), (m,)) for f, m in zip(found, sizes, strict=True)])

    columns = np.concatenate([_columns(codes, f) for f in found])
    weights, reward, ends = joined("weight"), joined("reward"), joined("terminal")
    if len(found) > 1:
        order = np.argsort(points, kind="stable")
        points, columns, weights, reward, ends = (x[order] for x in (points, columns, weights, reward, ends))
    counts = np.bincount(points, minlength=n)
    total = np.bincount(points, weights * reward, minlength=n)
    return _Rows(counts, columns, weights, ends if steps.ends else None, total)


def _columns(codes: Array, found: Outcomes) -> Array:
    """Indices of the states reached; `extract` sees to it that none that matters is outside."""
    if len(codes) and codes[-1] == len(codes) - 1:
        return found.code
    return np.minimum(np.searchsorted(codes, found.code), len(codes) - 1)
