"""Expected returns: exact where the task has an exact model, otherwise estimated from episodes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist
from typing import Any, NoReturn

import numpy as np

from taskspec.diagnostics import SpecError
from taskspec.exact import solve
from taskspec.exact.abstraction import Abstraction, abstraction
from taskspec.exact.extract import MAX_ENTRIES, extract
from taskspec.exact.failure import refuse
from taskspec.exact.model import Model
from taskspec.exact.plans import Plan, expert_plan, uniform_plan
from taskspec.exact.rollout import Choose, Rollout, at_random, by_expert
from taskspec.lang.ir import Const
from taskspec.spec.task import Task

Array = np.ndarray[Any, Any]
EPISODES = 1000
LONGEST = 100_000
WORDS = 4_000_000
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Return:
    """An expected return. `error` is the standard error of an estimate from `episodes`; both are 0 when exact."""

    value: float
    error: float = 0.0
    episodes: int = 0

    @property
    def exact(self) -> bool:
        return self.episodes == 0

    def interval(self, confidence: float = CONFIDENCE) -> tuple[float, float]:
        """A confidence interval (normal approximation); a point when exact."""
        width = NormalDist().inv_cdf(0.5 + confidence / 2) * self.error
        return self.value - width, self.value + width

    @classmethod
    def estimated(cls, returns: Sequence[float] | Array) -> Return:
        """From the returns of episodes (N,)."""
        found = np.asarray(returns, dtype=np.float64)
        error = float(found.std(ddof=1) / math.sqrt(len(found))) if len(found) > 1 else math.inf
        return cls(float(found.mean()), error, len(found))


class Results:
    """Everything that is known about a task's returns, worked out when asked for.

    `model` is that of the task or of its abstraction, or None; `why_not` then says why.
    """

    def __init__(self, task: Task, episodes: int = EPISODES, seed: int = 0, limit: int = MAX_ENTRIES) -> None:
        self.task, self.episodes, self.seed, self.limit = task, episodes, seed, limit
        self.unsettled: str | None = None

    @cached_property
    def abstraction(self) -> Abstraction | None:
        return abstraction(self.task)

    @cached_property
    def _extracted(self) -> Model | SpecError:
        found = self.abstraction
        try:
            return extract(self.task if found is None else found.stand_in, limit=self.limit)
        except SpecError as error:
            if any(d.code == "E705" for d in error.diagnostics):
                raise
            return error

    @property
    def model(self) -> Model | None:
        return self._extracted if isinstance(self._extracted, Model) else None

    @property
    def why_not(self) -> str | None:
        """Why there is no exact model, or why some value on it does not exist, in words; None when all is well."""
        found = self._extracted
        if isinstance(found, Model):
            return self.unsettled
        return " and ".join(filter(None, (found.diagnostics[0].message, self.unsettled)))

    # -- returns ----------------------------------------------------------------------------------

    @cached_property
    def optimal(self) -> Return | None:
        return self._solved(solve.optimal_return)

    @cached_property
    def worst(self) -> Return | None:
        return self._solved(solve.worst_return)

    @cached_property
    def random(self) -> Return | None:
        """Of uniformly random actions; None where the action has no finite range."""
        if self.model is not None:
            return self._solved(solve.random_return)
        ends = [v for c in self.task.action for v in (*c.low, *c.high)]
        return self._estimated(at_random(self.task)) if all(map(math.isfinite, ends)) else None

    @cached_property
    def expert(self) -> Return | None:
        """Of the spec's expert; None where there is none, or it cannot be worked out."""
        plan = self.expert_plan
        if plan is not None and self.model is not None:
            return self._solved(lambda model: solve.policy_return(model, plan))
        return self._estimated(by_expert(self.task)) if isinstance(self.task.expert, tuple) else None

    def _solved(self, how: Callable[[Model], float]) -> Return | None:
        """A return on the model; None where there is none, or where it is infinite for want of a horizon."""
        try:
            return None if self.model is None else Return(how(self.model))
        except SpecError as error:
            self.unsettled = error.diagnostics[0].message
            return None

    def _estimated(self, choose: Choose) -> Return | None:
        """A return from episodes; None where these do not end."""
        try:
            return self.simulated(choose)
        except SpecError as error:
            self.unsettled = error.diagnostics[0].message
            return None

    @cached_property
    def expert_plan(self) -> Plan | None:
        """The expert as probabilities of actions in the model; None where there is none."""
        try:
            return None if self.model is None else expert_plan(self.model)
        except SpecError as error:
            self.unsettled = error.diagnostics[0].message
            return None

    @property
    def random_plan(self) -> Plan | None:
        return None if self.model is None else uniform_plan(self.model)

    def simulated(self, choose: Choose, episodes: int | None = None) -> Return:
        """The return of a policy estimated from episodes."""
        return Return.estimated(simulate(self.task, choose, episodes or self.episodes, self.seed))


def simulate(task: Task, choose: Choose, episodes: int = EPISODES, seed: int = 0) -> Array:
    """Returns (N,) of episodes, discounted as the task says. Episode i is that of seed + i in the environment.

    Raises:
        SpecError: (E712) when episodes without a horizon do not end.
    """
    endless = isinstance(task.terminal, Const) and not task.terminal.value
    if endless and task.discount == 1 and (task.horizon is None or task.horizon > LONGEST):
        _refuse_endless(task)
    parts = []
    lanes = max(1, min(episodes, WORDS // max(1, Rollout(task, 1).words)))
    for first in range(0, episodes, lanes):
        parts.append(_simulate(task, choose, min(lanes, episodes - first), seed + first))
    return np.concatenate(parts)


def _simulate(task: Task, choose: Choose, lanes: int, seed: int) -> Array:
    rollout, rng = Rollout(task, lanes, seed), np.random.default_rng(seed)
    state, total, running = rollout.start(), np.zeros(lanes), np.ones(lanes, np.bool_)
    factor, t = 1.0, 0
    while running.any() and (task.horizon is None or t < task.horizon):
        moved = rollout.step(state, choose(state, t, rng), t)
        total += np.where(running, factor * moved.reward, 0.0)
        running = running & ~moved.terminal
        state = {n: np.where(running, moved.state[n], state[n]) for n in state}
        factor, t = factor * task.discount, t + 1
        if t >= LONGEST or factor < 1e-12:
            if task.discount == 1:
                _refuse_endless(task)
            break
    return total


def _refuse_endless(task: Task) -> NoReturn:
    hint = "give the task a horizon, or a discount below 1" if task.horizon is None else "choose a smaller horizon"
    refuse(f"episodes are still running after {LONGEST:,} steps", hint)


Normalise = Callable[[float], float]


def normalised(value: float, random: float, expert: float, floor: float | None = -1.0) -> float:
    """A score on which random actions are at 0 and the expert at 1.

    Args:
        floor: scores below it are reported as it; the paper truncates EarlyTermNeg, whose worst
            policies score below -3, at -1.

    Returns:
        nan where the expert is no better than random.
    """
    if expert == random:
        return math.nan
    score = (value - random) / (expert - random)
    return score if floor is None else max(floor, score)
