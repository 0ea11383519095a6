"""One learner on one task: what a job does, here or in another process, with plain data as its result.

Two short trials choose the seeds and steps of an exam within a time.
"""

from __future__ import annotations

import hashlib
import inspect
import itertools
import json
import math
import pickle
import re
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base import __version__
from taskspec.base.arrays import parts_of
from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError
from taskspec.base.limits import also
from taskspec.exact.policies.adapters import ProbabilisticPolicy
from taskspec.exact.policies.values import policy_value
from taskspec.exact.scores.returns import Results, Return, normalised
from taskspec.language.modifiers import modify
from taskspec.language.task.task import Task
from taskspec.learn.exam.case import Case, ExamTerms
from taskspec.learn.exam.examinee import train_at
from taskspec.learn.exam.learned import Learned, learned_fields
from taskspec.learn.jobs.work import within_limit
from taskspec.learn.learners import CannotLearn
from taskspec.learn.observed_policies import ObservedValue, observed_value

Row = dict[str, Any]
"""The result of one seed: returns, costs, and points of the learning curve, as JSON data."""
_OURS = str(Path(__file__).resolve().parents[2])


# Baselines: the returns of random actions, the expert and the optimum, by which scores are normalised.

MOST_CONSTANT = 64
"""Constant actions that are tried."""


def results_of(task: Task, episodes: int) -> Results:
    """Return the results of a task, computed once a process; `episodes` for what has to be simulated."""
    return _results(pickle.dumps(task), episodes)


@lru_cache(maxsize=16)
def _results(task: bytes, episodes: int) -> Results:
    return Results(pickle.loads(task), episodes)


def key_of(*content: Any) -> str:
    """Return a hash of JSON data and of the version of this package."""
    return hashlib.sha256(json.dumps([*content, __version__]).encode()).hexdigest()


def baselines(task: Task, episodes: int, limits: str) -> dict[str, Any]:
    """Return returns of random actions, the expert and the optimum, and the scores of constant actions, as JSON data.

    Args:
        limits: that hold, as `taskspec.base.limits.also` takes them.
    """
    with also(limits):
        results = results_of(task, episodes)
        values: dict[str, Any] = {}
        for name in ("random", "expert", "optimal", "worst"):
            value = getattr(results, name)
            if value is None:
                values[name] = None
            else:
                values[name] = value.value
        if values["expert"] is None:
            values["expert"] = values["optimal"]
        constants = []
        for action in _constant_actions(task):
            value = policy_value(results, _constant(results.task, action), True).value.value
            constants.append(score(value, values["random"], values["expert"]))
        if None in constants:
            constants = []
        return values | {"constants": constants}


def score(value: float, random: float | None, expert: float | None) -> float | None:
    """Return a return on the scale random 0, expert 1; None where the task has no such scale."""
    if random is None or expert is None:
        return None
    share = normalised(value, random, expert, floor=None)
    if math.isfinite(share):
        return share
    return None


def _constant_actions(task: Task) -> list[Any]:
    """Return actions as the environment takes them: all, or some of many; the ends and the middle of ranges."""
    layout = task.action_layout
    if layout.form == "discrete":
        return list(range(layout.starts[0], layout.starts[0] + min(layout.counts[0], MOST_CONSTANT)))
    if layout.form == "multi_discrete":
        combinations = itertools.product(*map(range, layout.counts))
        return [np.array(each) for each in itertools.islice(combinations, MOST_CONSTANT)]
    low, high = np.clip(np.array(layout.limits).T, -1e6, 1e6).reshape(2, *layout.shape)
    return [(low + share * (high - low)).astype(np.float32) for share in (0.0, 0.5, 1.0)]


def _constant(task: Task, action: Any) -> Any:
    """Return a policy that takes one action always; where it is illegal, a random legal one."""
    if not task.mask:
        return _Constant(action)
    row = np.eye(task.action_layout.counts[0])[action - task.action_layout.starts[0]]
    return ProbabilisticPolicy(task, lambda observations: np.tile(row, (len(parts_of(observations)[0]), 1)), 0)


class _Constant:
    """A policy that takes one action always."""

    def __init__(self, action: Any) -> None:
        self.action = action

    def predict(self, observations: Any) -> Any:
        return np.array([self.action] * len(parts_of(observations)[0]))


# Trials.


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
        longer: a horizon on which policies are scored, too.
        is_compared: whether what was learned is compared with known mistakes, too.
    """

    about: Task
    negated: bool
    place: str
    content: str
    terms: ExamTerms
    seeds: tuple[int, ...]
    episodes: int
    limits: str
    longer: int | None = None
    is_compared: bool = True

    @property
    def key(self) -> str:
        """A hash of all that the result depends on; the block is part of it, as its width may change results."""
        learned = (self.about.content_hash, self.negated, self.content, vars(self.terms), self.seeds)
        return key_of(*learned, self.episodes, self.limits, self.longer, self.is_compared)


def run_trial(trial: Trial, train: Callable[[Any], Any] | None = None) -> list[Row]:
    """Train, and score what was learned: a row for each seed of the block, with `cannot` alone where it is not for this task.

    Args:
        train: the learner, where it is at hand.

    Raises:
        LearnerFailed: it, or a policy of it, raised an error.
        SpecError: where the learner cannot be found again.
    """
    with also(trial.limits):
        if train is None:
            train = train_at(trial.place, trial.content)
        results = results_of(trial.about, trial.episodes)
        case = Case(results.task, trial.seeds, trial.terms, trial.negated)
        begin = time.perf_counter()
        try:
            with within_limit():
                learned = train(case)
            trained = time.perf_counter()
            policies = _policies(learned, len(case.seeds), train)
            rows = [_scored(policy, case, results, i) for i, policy in enumerate(policies)]
            if trial.is_compared:
                for i, policy in enumerate(policies):
                    sees_reward = "reward" in case.terms.learns_from
                    rows[i] |= learned_fields(results.task, policy, sees_reward, case.shown_to(i), case.behaviour_of(i))
            _add_curves(rows, case, results)
            if trial.longer is not None:
                _add_longer(rows, policies, trial)
        except CannotLearn as error:
            return [{"seed": seed, "cannot": error.message} for seed in trial.seeds]
        except Exception as error:
            refused = _refused_space(error, case)
            if refused is not None:
                return [{"seed": seed, "cannot": refused} for seed in trial.seeds]
            raise LearnerFailed(_words(error, train)) from error
    for i, row in enumerate(rows):
        row |= vars(case.spent_by(i)) | {"seconds": (trained - begin) / len(rows), "reseeded": case.resets.reseeded}
    return rows


def _refused_space(error: Exception, case: Case) -> str | None:
    """Return why a learner is not for the spaces of a task, where it shows that by asking them for what they do not have.

    A learner of discrete actions asks a box for `n`; those of Stable-Baselines3 say themselves what they support.
    """
    if isinstance(error, AssertionError) and re.search(r"only supports .* as (action|observation) spaces", str(error)):
        return str(error)
    if not isinstance(error, AttributeError):
        return None
    for kind, space in (("action", case.action_space), ("observation", case.observation_space)):
        if error.obj == space:
            return f"its {kind} space is a {type(space).__name__}, which has no `{error.name}`"
    return None


def _policies(learned: Any, seeds: int, train: Any) -> Sequence[Any]:
    if not getattr(train, "together", False):
        return [learned]
    if not isinstance(learned, list | tuple) or len(learned) != seeds:
        if isinstance(learned, list | tuple):
            given = f"{len(learned)} policies"
        else:
            given = type(learned).__name__
        raise TypeError(f"`train.together` promises a list of {seeds} policies, one for each seed; this is {given}")
    return learned


def _scored(policy: Any, case: Case, results: Results, i: int) -> Row:
    if policy is None:
        raise TypeError("`train` returned no policy: does it end with `return`?")
    seed = case.seeds[i]
    value = _value(policy, results, seed)
    return {
        "seed": seed, "curve": None, "deterministic": value.deterministic.value,
        "deterministic_half": value.deterministic.half, "stochastic": value.stochastic.value,
    }  # fmt: skip


def _value(policy: Any, results: Results, seed: int) -> ObservedValue:
    return observed_value(results, policy.policy if isinstance(policy, Learned) else policy, seed)


def _add_curves(rows: Sequence[Row], case: Case, results: Results) -> None:
    """Add points of steps and returns to each row: of the policies that the learner showed, else of its training episodes."""
    for steps, shown in case.curve:
        for row, policy in zip(rows, shown, strict=True):
            row["curve"] = [*(row["curve"] or ()), [steps, _value(policy, results, 0).deterministic.value]]
    if not case.curve:
        for i, row in enumerate(rows):
            row["curve"] = case.training_of(i) or None


def _add_longer(rows: Sequence[Row], policies: Sequence[Any], trial: Trial) -> None:
    """Add the score on a longer horizon to each row; None where the task or the policy does not allow for one."""
    try:
        results = results_of(_longer(trial.about, trial.longer), trial.episodes)
        expert = results.expert or results.optimal
        for row, policy in zip(rows, policies, strict=True):
            value = _value(policy, results, row["seed"]).deterministic.value
            row["longer"] = score(value, _number(results.random), _number(expert))
    except SpecError:
        return


@lru_cache(maxsize=16)
def _longer(task: Task, horizon: int | None) -> Task:
    return modify(task, f"horizon={horizon}")


def _number(value: Return | None) -> float | None:
    if value is None:
        return None
    return value.value


def _words(error: Exception, train: Any) -> str:
    words = "".join(traceback.format_exception_only(error)).strip()
    if isinstance(error, TaskspecError):
        words = str(error)
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith((_OURS, "<frozen"))]
    try:
        file = inspect.getsourcefile(inspect.unwrap(train))
    except TypeError:
        file = None
    own = [f for f in frames if f.filename == file]
    for frame in (own or frames)[-1:]:
        words += f"\n  at {frame.filename}:{frame.lineno}, in {frame.name}"
    return words


PILOTS = (1_000, 4_000)
"""Steps of the two trials on each task: time is a line through both."""
SEEDS = 15
"""Seeds, where there is time for that many."""


def seeds_and_steps(
    seconds: float, pilot: Callable[[int], bool], runs: float, most: int, is_fixed: bool
) -> tuple[int, int]:
    """Return how many seeds of how many steps an exam has time for.

    Args:
        seconds: for the whole exam, the two trials included.
        pilot: trains one seed on every task for so many steps; false where no run succeeds, so that one seed of the first
            trial is all.
        runs: how often each seed is trained on every task, twins included.
        most: the most steps.
        is_fixed: whether there are `most` steps, not fewer.

    Raises:
        SpecError: E713 where the time is too short for one seed.
    """
    begin = time.perf_counter()
    took = []
    for steps in PILOTS:
        before = time.perf_counter()
        if not pilot(min(steps, most)):
            return 1, min(steps, most)
        took.append(time.perf_counter() - before)
    left = seconds - (time.perf_counter() - begin)
    per_step = max(0.0, (took[1] - took[0]) / (PILOTS[1] - PILOTS[0]))
    start = max(0.0, took[0] - per_step * PILOTS[0])
    fewest = most
    if not is_fixed:
        fewest = min(most, PILOTS[0])
    shortest = runs * (start + per_step * fewest)
    seeds = min(SEEDS, int(left / max(shortest, 1e-9)))
    if seeds < 1:
        needed = math.ceil((seconds - left + shortest) / 60)
        message = f"{seconds:g} s are too short for one seed on every task, which takes about {needed} min"
        raise SpecError([Diagnostic("E713", None, message, "more time, or fewer tasks or twins")])
    if is_fixed or per_step == 0:
        return seeds, most
    affordable = (left / (seeds * runs) - start) / per_step
    return seeds, max(fewest, min(most, _rounded(affordable)))


def _rounded(number: float) -> int:
    if number < 1:
        return 1
    unit = int(10 ** max(0, math.floor(math.log10(number)) - 1))
    return int(number // unit) * unit
