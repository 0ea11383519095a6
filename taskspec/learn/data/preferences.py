"""Preferences: labelled pairs of trajectories or segments, and simulated teachers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.extras import need
from taskspec.envs.options import positive, seed_of
from taskspec.exact.model.model import misused, refuse
from taskspec.exact.policies.adapters import policy_of
from taskspec.exact.policies.policy import parsed, unknown
from taskspec.exact.scores.returns import Results
from taskspec.language import draws
from taskspec.language.registry import load, role
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.data.episodes import EXTRA, Trajectory, Transitions, columns, described, recorded

# Simulated teachers, who say which of two segments they prefer: noiseless, or with irrationalities, which may be combined.
#
# The irrationalities are those of B-Pref: Lee, Smith, Dragan and Abbeel, "B-Pref: Benchmarking preference-based reinforcement
# learning", NeurIPS Datasets and Benchmarks 2021, section 3 and algorithm 1, in the order of its algorithm.

FIRST = 1.0  # labels: the probability with which the first segment is said to be the better one
EQUAL = 0.5
SECOND = 0.0
WORDS = 2  # random words that a label takes: one for the choice, one for the mistake


@dataclass(frozen=True, slots=True)
class Teacher:
    """Who compares segments by their returns; without arguments, without noise.

    Temperature and thresholds are shares of `unit`, the range of returns that `preferences` finds for the segments.

    Args:
        boltzmann: temperature of the Bradley-Terry model: the first is preferred with the probability
            1 / (1 + exp((G2 - G1) / (boltzmann * unit))).
        myopic: discounts steps that lie further back: the reward k steps before the end of a segment counts `myopic ** k`.
        mistaken: the probability with which the answer is turned round.
        skipping: gives no answer where neither return is above this share of the way from the lowest to the highest return.
        equal: calls segments equally good whose returns are less than this share apart.
    """

    boltzmann: float = 0.0
    myopic: float = 1.0
    mistaken: float = 0.0
    skipping: float | None = None
    equal: float = 0.0

    def __post_init__(self) -> None:
        for name in ("boltzmann", "equal"):
            _check(name, getattr(self, name), 0, math.inf)
        for name in ("myopic", "mistaken"):
            _check(name, getattr(self, name), 0, 1)
        if self.skipping is not None:
            _check("skipping", self.skipping, 0, 1)

    @property
    def needs_range(self) -> bool:
        """True where answers depend on the range of returns."""
        return bool(self.boltzmann or self.equal or self.skipping is not None)

    def __str__(self) -> str:
        changed = []
        for setting in fields(self):
            value = getattr(self, setting.name)
            if value != setting.default:
                changed.append(f"{setting.name}({value:g})")
        return " + ".join(changed) or "noiseless"

    def labels(
        self, first: Array, second: Array, near: tuple[Array, Array], ends: tuple[float, float], words: Array
    ) -> Array:
        """Compare pairs of segments.

        Args:
            first, second: the segments' true returns, (P,).
            near: their returns as a myopic teacher sees them.
            ends: the lowest and the highest return that a segment may have, from the exact model.
            words: uint32 (2, P), fresh for each pair.

        Returns:
            float64 (P,): 1 where the first segment is preferred, 0 the second, 0.5 where they are equal, nan for no answer.
        """
        low = ends[0]
        unit = ends[1] - ends[0]
        ahead = near[0] - near[1]
        prefers = np.where(ahead > 0, FIRST, np.where(ahead < 0, SECOND, EQUAL))
        if self.boltzmann * unit:
            chance = 0.5 * (1 + np.tanh(ahead / (2 * self.boltzmann * unit)))  # the logistic function, without overflow
            prefers = np.where(words[0] * 2.0**-32 < chance, FIRST, SECOND)
        wrong = words[1] * 2.0**-32 < self.mistaken
        answers = np.where(wrong & (prefers != EQUAL), 1 - prefers, prefers)
        if self.equal:
            answers = np.where(np.abs(first - second) < self.equal * unit, EQUAL, answers)
        if self.skipping is not None:
            answers = np.where(np.maximum(first, second) > low + self.skipping * unit, answers, np.nan)
        return answers

    def seen(self, segments: Transitions, discount: float) -> Array:
        """Sum rewards as a myopic teacher sees them.

        Args:
            segments: transitions of E segments.
            discount: of the task.

        Returns:
            float64 (E,).
        """
        if self.myopic == 1:
            return segments.returns(discount)
        before = segments.time - np.repeat(segments.time[segments.starts], segments.lengths)
        left = np.repeat(segments.lengths, segments.lengths) - 1 - before
        weights = discount ** before.astype(np.float64) * self.myopic ** left.astype(np.float64)
        return np.add.reduceat(weights * segments.rews, segments.starts)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (low <= value <= high and math.isfinite(value)):
        span = f"a number from {low:g} on"
        if math.isfinite(high):
            span = f"between {low:g} and {high:g}"
        misused(f"`{name}` of a teacher is {span}, not {value!r}")


NAMES = {
    "noiseless": "prefers the higher return; equal returns are equal",
    "boltzmann(0.1)": "prefers by the Bradley-Terry model, at a temperature in units of the exact range of returns",
    "myopic(0.9)": "discounts earlier rewards of a segment",
    "mistaken(0.1)": "gives the opposite answer, with a probability",
    "skipping(0.2)": "gives no answer where neither return is above this fraction of the range",
    "equal(0.1)": "judges returns equal that differ by less than this fraction of the range",
}
"""The names of teachers, each with what it does; the numbers stand for any, and `+` combines several."""
KINDS = {field.name for field in fields(Teacher)}


def teacher_of(text: str | Teacher) -> Teacher:
    """Return the teacher of a text such as `myopic(0.9) + mistaken(0.1)`."""
    if isinstance(text, Teacher):
        return text
    teacher = Teacher()
    given = set[str]()
    for part in map(str.strip, str(text).split("+")):
        if part == "noiseless":
            continue
        name, value = parsed(part)
        if name not in KINDS or value is None:
            unknown(part, known=NAMES, noun="teacher")
        if name in given:
            misused(f"the teacher '{text}' is {name} twice")
        given.add(name)
        teacher = replace(teacher, **{name: value})
    return teacher


# Preferences: pairs of trajectories or of segments, labelled by their true returns.


@dataclass(frozen=True, eq=False)
class Preferences:
    """P pairs of segments, and which of the two a teacher prefers.

    Attributes:
        segments: the transitions of all segments; `segments.episode` is 2 i for the first segment of pair i, 2 i + 1 for the
            second, and `segments.time` the time in the episode that the segment is from.
        preferences: float64 (P,): 1 where the first is preferred, 0 the second, 0.5 where they are called equal.
        returns: float64 (P, 2), the true returns of both, discounted as the task says from the first step of a segment.
        queries: int64 (P,), the numbers of the pairs among those that the teacher was shown; without those that it skipped.
        metadata: plain data, as of demonstrations; with `teacher`, `length`, `shown`, `skipped` and `range`, the lowest and
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
        halves = self.segments.trajectories
        return tuple(zip(halves[::2], halves[1::2], strict=True))

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """All segments: the first and the second of the first pair, and so on."""
        return self.segments.trajectories

    def imitation(self) -> Any:
        """Return the pairs for the library imitation.

        Returns:
            A `PreferenceDataset`, which holds all pairs.

        Raises:
            SpecError: E705 where imitation is not installed.
        """
        comparisons = need("imitation.algorithms.preference_comparisons", EXTRA, "this")
        halves = self.segments.imitation()
        dataset = comparisons.PreferenceDataset()
        dataset.push(list(zip(halves[::2], halves[1::2], strict=True)), self.preferences.astype(np.float32))
        return dataset


def preferences(
    task: TaskLike, pairs: int, *, policy: Any = "random", length: int | None = None, teacher: str | Teacher = "noiseless",
    seed: int = 0, jobs: int = 1,
) -> Preferences:  # fmt: skip
    """Record pairs of a policy's trajectories, in the variant in which the spec's `roles` have the learner act.

    Pair i is of episodes 2 i and 2 i + 1 as `demonstrations` records them; its label is a function of the seed and i alone.

    Args:
        task: the task, its id or its path.
        pairs: how many the teacher is shown; those that it skips are left out.
        policy: as for `demonstrations`.
        length: of the segments; None takes whole episodes. A segment begins anywhere in its episode; of an episode that is no
            longer, it is the whole.
        teacher: "noiseless", "boltzmann(0.1)", "myopic(0.9)", "mistaken(0.1)", "skipping(0.2)", "equal(0.1)" with any numbers,
            several of them with `+`; or a `Teacher`.
        seed: of the episodes, the segments and the labels.
        jobs: processes.

    Returns:
        the segments of P pairs, with preferences float64 (P,), 1 where the first is preferred, and true returns
        float64 (P, 2).

    Source:
        K. Lee, L. Smith, A. Dragan and P. Abbeel, B-Pref: Benchmarking Preference-Based Reinforcement Learning, NeurIPS 2021.

    Raises:
        SpecError: as for `demonstrations`; E712 where the teacher needs the exact range of returns, and there is none.
    """
    learned = role(load(task), "learner")
    who = teacher_of(teacher)
    pairs = positive("pairs", pairs)
    seed = seed_of(seed)
    acting = policy_of(learned, policy)
    if length is not None:
        length = positive("length", length)
    ends = return_ends(learned, length) if who.needs_range else (0.0, 0.0)
    whole = recorded(learned, policy, 2 * pairs, None, seed, positive("jobs", jobs))
    segments = _cut(whole, length, seed) if length is not None else whole
    returns = segments.returns(learned.discount)
    near = who.seen(segments, learned.discount)
    words = draws.lanes_block(np.full(pairs, seed, np.uint64), draws.TEACHER, np.arange(pairs), WORDS)
    labels = who.labels(returns[::2], returns[1::2], (near[::2], near[1::2]), ends, words)
    kept = np.flatnonzero(~np.isnan(labels))
    if not len(kept):
        misused(f"the teacher {who} skipped all {pairs:,} pairs", "lower its threshold, or compare a better policy")
    told = described(learned, "preferences", acting, seed)
    answered = _of_pairs(segments, kept)
    steps = [int(answered.lengths.min()), int(answered.lengths.max())]
    told |= {"teacher": str(who), "length": length, "steps": steps}
    told |= {"shown": pairs, "skipped": pairs - len(kept), "range": None}
    if who.needs_range:
        told["range"] = list(ends)
    return Preferences(answered, labels[kept], returns.reshape(-1, 2)[kept], kept, told)


def return_ends(task: Task, length: int | None) -> tuple[float, float]:
    """Return the worst and the optimal return, exact; of segments the share that they have in the horizon."""
    results = Results(task)
    if results.model is None or results.enclosure("worst") is None or results.enclosure("optimal") is None:
        why = results.why_not or "its returns are not finite"
        hint = results.remedy or "a noiseless, myopic or mistaken teacher needs none"
        refuse(f"the teacher needs the exact range of the returns of {task.id}: {why}", hint)
    worst = results.worst
    optimal = results.optimal
    assert worst is not None and optimal is not None
    share = 1.0
    if length is not None and task.horizon is not None:
        share = min(1.0, length / task.horizon)
    if worst.value == optimal.value:
        misused(f"every policy earns {worst.value:g} on {task.id}, so returns have no range")
    return worst.value * share, optimal.value * share


def _cut(whole: Transitions, length: int, seed: int) -> Transitions:
    seeds = draws.lane_seeds(seed, len(whole.starts))
    words = draws.lanes_block(seeds, draws.TEACHER, 2**32 - 1, 1)[0]
    begin = draws.indices(words, np.maximum(whole.lengths - length, 0) + 1)
    since = whole.time - np.repeat(begin, whole.lengths)
    return whole.rows(np.flatnonzero((since >= 0) & (since < length)))


def _of_pairs(segments: Transitions, kept: Array) -> Transitions:
    number = np.full(len(segments.starts) // 2, -1)
    number[kept] = np.arange(len(kept))
    pair = number[segments.episode // 2]
    some = segments.rows(np.flatnonzero(pair >= 0))
    anew = 2 * pair[pair >= 0] + some.episode % 2
    return Transitions(**columns(some) | {"episode": anew})
