"""One learner on one task: what a job does, here or in another process, with plain data as its result."""

from __future__ import annotations

import hashlib
import inspect
import json
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import taskspec
from taskspec.base.diagnostics import TaskspecError
from taskspec.base.limits import also
from taskspec.exam.baselines import results_of
from taskspec.exam.case import Case, ExamTerms
from taskspec.exam.learners import train_at
from taskspec.exam.rewards import Learned, told
from taskspec.learners import CannotLearn
from taskspec.policies.values import ObservedValue, observed_value
from taskspec.scores.returns import Results, Return
from taskspec.task.task import Task

Row = dict[str, Any]
"""What came of one seed: returns, costs, and points of the learning curve, as JSON data."""
_OURS = str(Path(taskspec.__file__).parent)


class LearnerFailed(TaskspecError):
    """A learner, or its policy, raised an error; the message is its own, with its place."""


@dataclass(frozen=True)
class Trial:
    """One learner on one task, for a block of seeds.

    Args:
        about: the task; with the modifiers of a twin, where it is one.
        negated: whether a learner that looks at the reward which is withheld sees it negated, instead of 0.
        place, content: of the learner, for another process.
        episodes: for scores that have to be simulated.
        limits: that hold, as `taskspec.base.limits.also` takes them.
    """

    about: Task
    negated: bool
    place: str
    content: str
    terms: ExamTerms
    seeds: tuple[int, ...]
    episodes: int
    limits: str

    @property
    def key(self) -> str:
        """Return a hash of all that the result depends on; the block is part of it, as its width may change results."""
        told = [
            self.about.content_hash, self.negated, self.content, vars(self.terms), self.seeds, self.episodes, self.limits,
            taskspec.__version__,
        ]  # fmt: skip
        return hashlib.sha256(json.dumps(told).encode()).hexdigest()


def run_trial(trial: Trial, train: Callable[[Any], Any] | None = None) -> list[Row]:
    """Do `_run` within the limits of a trial."""
    with also(trial.limits):
        return _run(trial, train)


def _run(trial: Trial, train: Callable[[Any], Any] | None) -> list[Row]:
    """Train, and score what was learned: a row for each seed of the block, with `cannot` alone where it is not for this task.

    Args:
        train: the learner, where it is at hand.

    Raises:
        LearnerFailed: it, or a policy of it, raised an error.
        SpecError: where the learner cannot be found again.
    """
    train = train_at(trial.place, trial.content) if train is None else train
    results = results_of(trial.about, trial.episodes)
    task = results.task
    case = Case(task, trial.seeds, trial.terms, trial.negated)
    begin = time.perf_counter()
    try:
        learned = train(case)
        trained = time.perf_counter()
        policies = _policies(learned, len(case.seeds), train)
        rows = [_scored(policy, results, seed) for policy, seed in zip(policies, case.seeds, strict=True)]
        curves = _curves(case, results)
    except CannotLearn as error:
        return [{"seed": seed, "cannot": error.message} for seed in trial.seeds]
    except Exception as error:
        raise LearnerFailed(_words(error, train)) from error
    shared = {"seconds": (trained - begin) / len(rows), "scoring": (time.perf_counter() - trained) / len(rows)}
    return [
        row | vars(case.spent_by(i)) | shared | {"curve": curve}
        for i, (row, curve) in enumerate(zip(rows, curves, strict=True))
    ]


def _policies(learned: Any, seeds: int, train: Any) -> Sequence[Any]:
    if not getattr(train, "together", False):
        return [learned]
    if not isinstance(learned, list | tuple) or len(learned) != seeds:
        told = f"{len(learned)} policies" if isinstance(learned, list | tuple) else type(learned).__name__
        raise TypeError(f"`train.together` promises a list of {seeds} policies, one for each seed; this is {told}")
    return learned


def _scored(policy: Any, results: Results, seed: int) -> Row:
    if policy is None:
        raise TypeError("`train` returned no policy: does it end with `return`?")
    found = _value(policy, results, seed)
    row = {"seed": seed, **_told("deterministic", found.deterministic), **_told("stochastic", found.stochastic)}
    if getattr(policy, "reward", None) is not None:
        row |= told(results.task, policy.reward)
    return row


def _value(policy: Any, results: Results, seed: int) -> ObservedValue:
    return observed_value(results, policy.policy if isinstance(policy, Learned) else policy, seed)


def _told(name: str, value: Return) -> Row:
    return {name: value.value, f"{name}_half": value.half}


def _curves(case: Case, results: Results) -> list[list[list[float]] | None]:
    """For each seed, points of steps and returns; None where the learner showed nothing."""
    if not case.curve:
        return [None] * len(case.seeds)
    points = [(steps, [_value(p, results, 0).deterministic.value for p in shown]) for steps, shown in case.curve]
    return [[[steps, found[i]] for steps, found in points] for i in range(len(case.seeds))]


def _words(error: Exception, train: Any) -> str:
    """Return an error with the place in the learner's file that it passed last, else in any file but ours."""
    words = "".join(traceback.format_exception_only(error)).strip()
    if isinstance(error, TaskspecError):
        words = str(error)
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith((_OURS, "<frozen"))]
    try:
        own = [f for f in frames if f.filename == inspect.getsourcefile(inspect.unwrap(train))]
    except TypeError:
        own = []
    at = (own or frames)[-1:]
    return words + "".join(f"\n  at {f.filename}:{f.lineno}, in {f.name}" for f in at)
