"""Rows of transition matrices: from the outcomes of some points to sparse matrices, written once and in place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.model.model import RoundingTerms, Step, scipy_sparse
from taskspec.model.transitions import LOOP_FROM, Outcomes, Steps

CHUNK = 16_384
MOVED = 500_000
"""How many entries are moved together at once."""
TIDY = 2_000_000
"""Up to this many non-zeros, equal columns of a row are merged and sorted."""


@dataclass(frozen=True)
class Rows:
    """Some consecutive rows: entries in each (n,), columns, probabilities, ends (or None), rewards (n,).

    The rewards of all outcomes are from `lowest` to `highest`.
    """

    counts: Array
    columns: Array
    weights: Array
    ends: Array | None
    reward: Array
    escaping: Array | None = None
    lowest: float = 0.0
    highest: float = 0.0


class RowCollector:
    """Gathers rows into arrays as long as all of them may need; what is not written costs no memory."""

    def __init__(self, rows: int, entries: int) -> None:
        self.columns = np.empty(entries, np.int32)
        self.weights = np.empty(entries)
        self.counts = np.empty(rows, np.int32)
        self.reward = np.empty(rows)
        self.marked: dict[str, Array] = {}  # `ends` and `escaping`, once they occur
        self.row = self.entry = self.terms = 0
        self.lowest = self.highest = 0.0

    def add(self, rows: Rows) -> None:
        n = len(rows.counts)
        m = len(rows.columns)
        here = slice(self.row, self.row + n)
        there = slice(self.entry, self.entry + m)
        self.counts[here], self.reward[here] = rows.counts, rows.reward
        self.columns[there], self.weights[there] = rows.columns, rows.weights
        self._mark("ends", rows.ends, there, len(self.columns))
        self._mark("escaping", rows.escaping, here, len(self.counts))
        self.terms = max(self.terms, int(rows.counts.max(initial=0)))
        self.lowest = min(self.lowest, rows.lowest)
        self.highest = max(self.highest, rows.highest)
        self.row = self.row + n
        self.entry = self.entry + m

    def _mark(self, name: str, flags: Array | None, where: slice, size: int) -> None:
        if flags is not None:
            self.marked.setdefault(name, np.zeros(size, np.bool_))[where] = flags

    def step(self, states: int) -> Step:
        """Return the matrices of everything gathered."""
        sparse = scipy_sparse()
        columns = self.columns[: self.entry]
        weights = self.weights[: self.entry]
        indptr = np.zeros(self.row + 1, np.int32 if self.entry < 2**31 else np.int64)
        np.cumsum(self.counts, out=indptr[1:])
        self.counts = self.counts[:0]  # as there may be no memory for these as well
        parts: list[tuple[Array, Array, Array]] = [(weights, columns, indptr)]
        if "ends" in self.marked:
            ends = self.marked["ends"][: self.entry]
            ended = _only(ends, weights, columns, indptr)
            parts = [_without(ends, weights, columns, indptr), ended]
        built = [sparse.csr_array(part, shape=(self.row, states)) for part in parts]
        if self.entry <= TIDY:
            built = [_tidy(matrix.copy()) for matrix in built]
        P_end = built[1] if len(built) > 1 else None
        rounding = RoundingTerms(self.terms, self.lowest, self.highest)
        return Step(built[0], P_end, self.reward, rounding, self.marked.get("escaping"))


def _only(flags: Array, weights: Array, columns: Array, indptr: Array) -> tuple[Array, Array, Array]:
    """Return the entries of rows that are marked: weights, columns, and where each row begins."""
    before = np.zeros(len(flags) + 1, indptr.dtype)
    np.cumsum(flags, out=before[1:])
    return weights[flags], columns[flags], before[indptr]


def _without(flags: Array, weights: Array, columns: Array, indptr: Array) -> tuple[Array, Array, Array]:
    """Return the entries of rows that are not marked, moved together in place: there may be no memory for a copy."""
    before = np.zeros(len(flags) + 1, indptr.dtype)
    np.cumsum(~flags, out=before[1:])
    last = 0
    for low in range(0, len(flags), MOVED):
        kept = np.flatnonzero(~flags[low : low + MOVED]) + low
        weights[last : last + len(kept)], columns[last : last + len(kept)] = weights[kept], columns[kept]
        last += len(kept)
    return weights[:last], columns[:last], before[indptr]


def _tidy(matrix: Any) -> Any:
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix


def all_rows(steps: Steps, codes: Array, t: int) -> Iterator[Rows]:
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
    found = list(steps.outcomes(states, actions, t))
    if any(f.outside is not None for f in found):
        return _escaping(steps, codes, found, len(states))
    if all(f.origin is None for f in found):
        return _regular(steps, codes, found, len(states))
    return _irregular(steps, codes, found, len(states))


def _escaping(steps: Steps, codes: Array, found: list[Outcomes], n: int) -> Rows:
    """Return rows some of which leave the state space; they are marked, and those outcomes have no weight."""
    kept = []
    escaping = np.zeros(n, np.bool_)
    for f in found:
        if f.outside is not None:
            points = np.arange(n) if f.origin is None else f.origin
            escaping[points[f.outside]] = True
            f = replace(f, weight=np.where(f.outside, 0.0, f.weight))
        kept.append(f)
    paid = _irregular(steps, codes, found, n)
    inside = _irregular(steps, codes, kept, n)
    return replace(inside, reward=paid.reward, lowest=paid.lowest, highest=paid.highest, escaping=escaping)


def _regular(steps: Steps, codes: Array, found: list[Outcomes], n: int) -> Rows:
    """Return every outcome happens at every point: rows of one length."""
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
    extent = _extent([f.reward for f in found])
    return Rows(np.full(n, k), columns.reshape(-1), weights.reshape(-1), ends, reward, None, *extent)


def _extent(rewards: list[Array]) -> tuple[float, float]:
    """Return the least and the largest of finite rewards, and of 0."""
    lowest = min(float(np.min(r, where=np.isfinite(r), initial=0.0)) for r in rewards)
    highest = max(float(np.max(r, where=np.isfinite(r), initial=0.0)) for r in rewards)
    return lowest, highest


def _irregular(steps: Steps, codes: Array, found: list[Outcomes], n: int) -> Rows:
    points = np.concatenate([np.arange(n) if f.origin is None else f.origin for f in found])
    sizes = [len(f.code) for f in found]

    def joined(name: str) -> Array:
        return np.concatenate([np.broadcast_to(getattr(f, name), (m,)) for f, m in zip(found, sizes, strict=True)])

    columns = np.concatenate([_columns(codes, f) for f in found])
    weights = joined("weight")
    reward = joined("reward")
    ends = joined("terminal")
    if len(found) > 1:
        order = np.argsort(points, kind="stable")
        points, columns, weights, reward, ends = (x[order] for x in (points, columns, weights, reward, ends))
    counts = np.bincount(points, minlength=n)
    total = np.bincount(points, weights * reward, minlength=n)
    return Rows(counts, columns, weights, ends if steps.ends else None, total, None, *_extent([reward]))


def _columns(codes: Array, found: Outcomes) -> Array:
    """Return indices of the states reached; `extract` sees to it that none that matters is outside."""
    if len(codes) and codes[-1] == len(codes) - 1:
        return found.code.astype(np.int32)
    return np.minimum(np.searchsorted(codes, found.code), len(codes) - 1).astype(np.int32)
