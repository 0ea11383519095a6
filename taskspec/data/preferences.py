"""Preferences: pairs of trajectories or of segments, labelled by their true returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.data.actors import actor_of
from taskspec.data.demonstrations import described, role
from taskspec.data.episodes import recorded
from taskspec.data.teachers import WORDS, Teacher, teacher_of
from taskspec.data.transitions import EXTRA, Trajectory, Transitions, columns
from taskspec.envs.options import positive, seed_of
from taskspec.exact.model.failure import misused, refuse
from taskspec.exact.scoring.returns import Results
from taskspec.extras import need
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike

Array = np.ndarray[Any, Any]


@dataclass(frozen=True, eq=False)
class Preferences:
    """P pairs of segments, and which of the two a teacher prefers.

    Attributes:
        segments: the transitions of all segments; `segments.episode` is 2 i for the first segment of pair i, 2 i + 1 for the
            second, and `segments.time` the time in the episode that the segment is from.
        preferences: float64 (P,): 1 where the first is preferred, 0 the second, 0.5 where they are called equal.
        returns: float64 (P, 2), the true returns of both, discounted as the task says from the first step of a segment.
        queries: int64 (P,), the numbers of the pairs among those that the teacher was shown; without those that it skipped.
        metadata: plain data, as of demonstrations; besides `teacher`, `length`, `shown`, `skipped` and `range`, the lowest and
            the highest return that temperature and thresholds are measured by (None where they are not needed).
    """

    segments: Transitions
    preferences: Array
    returns: Array
    queries: Array
    metadata: Mapping[str, Any]

    def __len__(self) -> int:
        return len(self.preferences)

    @cached_property
    def pairs(self) -> tuple[tuple[Trajectory, Trajectory], ...]:
        """The two segments of each pair."""
        found = self.segments.trajectories
        return tuple(zip(found[::2], found[1::2], strict=True))

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """All segments: the first and the second of the first pair, and so on."""
        return self.segments.trajectories

    def imitation(self) -> Any:
        """The pairs as imitation's `PreferenceDataset`.

        Raises:
            SpecError: E705 where imitation is not installed.
        """
        comparisons = need("imitation.algorithms.preference_comparisons", EXTRA, "this")
        found, dataset = self.segments.imitation(), comparisons.PreferenceDataset()
        dataset.push(list(zip(found[::2], found[1::2], strict=True)), self.preferences.astype(np.float32))
        return dataset


def preferences(
    task: TaskLike,
    pairs: int,
    *,
    policy: Any = "random",
    length: int | None = None,
    teacher: str | Teacher = "noiseless",
    seed: int = 0,
    jobs: int = 1,
) -> Preferences:
    """Pairs of a policy's trajectories, in the variant in which the spec's `roles` have the learner act.

    Pair i is of episodes 2 i and 2 i + 1 as `demonstrations` records them; its label is a function of the seed and i alone.

    Args:
        pairs: how many the teacher is shown; those that it skips are left out.
        policy: as for `demonstrations`.
        length: of the segments; None takes whole episodes. A segment begins anywhere in its episode; of an episode that is no
            longer, it is the whole.
        teacher: "noiseless", "boltzmann(0.1)", "myopic(0.9)", "mistaken(0.1)", "skipping(0.2)", "equal(0.1)" with any numbers,
            several of them with `+`; or a `Teacher`.
        jobs: processes.

    Raises:
        SpecError: as for `demonstrations`; E712 where the teacher needs the exact range of returns, and there is none.
    """
    found, who = role(load(task), "learner"), teacher_of(teacher)
    pairs, seed, actor = positive("pairs", pairs), seed_of(seed), actor_of(found, policy)
    length = None if length is None else positive("length", length)
    ends = return_ends(found, length) if who.needs_range else (0.0, 0.0)
    whole = recorded(found, policy, 2 * pairs, None, seed, positive("jobs", jobs))
    segments = whole if length is None else _cut(whole, length, seed)
    returns, labels = segments.returns(found.discount), _labels(segments, found, who, ends, seed)
    kept = np.flatnonzero(~np.isnan(labels))
    if not len(kept):
        misused(f"the teacher {who} skipped all {pairs:,} pairs", "lower its threshold, or compare a better policy")
    told = {"teacher": str(who), "length": length, "shown": pairs, "skipped": pairs - len(kept),
            "range": list(ends) if who.needs_range else None}  # fmt: skip
    told = described(found, "preferences", actor, seed) | told
    return Preferences(_of_pairs(segments, kept), labels[kept], returns.reshape(-1, 2)[kept], kept, told)


def _labels(segments: Transitions, task: Task, who: Teacher, ends: tuple[float, float], seed: int) -> Array:
    """What the teacher says of each pair (P,)."""
    returns, near = segments.returns(task.discount), who.seen(segments, task.discount)
    pairs = len(returns) // 2
    words = draws.lanes_block(np.full(pairs, seed, np.uint64), draws.TEACHER, np.arange(pairs), WORDS)
    return who.labels(returns[::2], returns[1::2], (near[::2], near[1::2]), ends, words)


def return_ends(task: Task, length: int | None) -> tuple[float, float]:
    """The worst and the optimal return, exact; of segments the share that they have in the horizon.

    Raises:
        SpecError: E712 where there is no exact model, E713 where all policies earn the same.
    """
    results = Results(task)
    if results.model is None or results.enclosure("worst") is None or results.enclosure("optimal") is None:
        why = results.why_not or "its returns are not finite"
        hint = results.remedy or "a noiseless, myopic or mistaken teacher needs none"
        refuse(f"the teacher needs the exact range of the returns of {task.id}: {why}", hint)
    worst, optimal = results.worst, results.optimal
    assert worst is not None and optimal is not None
    share = 1.0 if length is None or task.horizon is None else min(1.0, length / task.horizon)
    if worst.value == optimal.value:
        misused(f"every policy earns {worst.value:g} on {task.id}, so returns have no range")
    return worst.value * share, optimal.value * share


def _cut(whole: Transitions, length: int, seed: int) -> Transitions:
    """A segment of every episode, beginning at a time that is uniform over those where it fits."""
    seeds = draws.lane_seeds(seed, len(whole.starts))
    words = draws.lanes_block(seeds, draws.TEACHER, 2**32 - 1, 1)[0]
    begin = draws.indices(words, np.maximum(whole.lengths - length, 0) + 1)
    since = whole.time - np.repeat(begin, whole.lengths)
    return whole.rows(np.flatnonzero((since >= 0) & (since < length)))


def _of_pairs(segments: Transitions, kept: Array) -> Transitions:
    """The segments of some pairs, numbered anew."""
    number = np.full(len(segments.starts) // 2, -1)
    number[kept] = np.arange(len(kept))
    pair = number[segments.episode // 2]
    some = segments.rows(np.flatnonzero(pair >= 0))
    anew = 2 * pair[pair >= 0] + some.episode % 2
    return Transitions(**columns(some) | {"episode": anew})
