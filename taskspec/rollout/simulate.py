"""Returns of simulated episodes, and the bounds that they lie between."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NoReturn

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import tell
from taskspec.lang.interval import bounds
from taskspec.lang.ir import Const
from taskspec.model.model import refuse
from taskspec.model.points import Budget, Cost
from taskspec.rollout.rollout import Choose, Rollout
from taskspec.task.task import Task

EPISODES = 1000
LONGEST = 20_000
"""Steps after which an episode without a horizon is taken never to end."""
UNENDING = 2_000
"""Steps after which episodes are given up if hardly any of them has ended."""
WORDS = 4_000_000
"""Random words that a batch of episodes may take for one step."""
CUT = 1e-12
"""The weight of a reward (a power of the discount) at which simulated episodes are cut off."""


def simulate(task: Task, choose: Choose, episodes: int = EPISODES, seed: int = 0) -> Array:
    """Return the returns float64 (N,) of episodes, discounted as the task says. Episode i has the environment's seed `seed + i`.

    Raises:
        SpecError: (E712) when episodes without a horizon do not end.
    """
    never_ends = isinstance(task.terminal, Const) and not task.terminal.value
    if never_ends and task.discount == 1 and (task.horizon is None or task.horizon > LONGEST):
        _refuse_endless(task, LONGEST)
    parts = []
    expert = task.expert if isinstance(task.expert, tuple) else ()
    start = Cost(task.initial, simulated=True)
    step = Cost((*task.next, task.reward, task.terminal, *expert), simulated=True)
    lanes = step.batch(min(episodes, WORDS // max(1, Rollout(task, 1).words)))
    budget = Budget(f"{episodes:,} episodes")
    for first in range(0, episodes, lanes):
        some = min(lanes, episodes - first)
        budget.spend(start, some)
        parts.append(_simulate(task, choose, some, seed + first, partial(budget.spend, step, some)))
    return np.concatenate(parts)


def _simulate(task: Task, choose: Choose, lanes: int, seed: int, spend: Callable[[], None]) -> Array:
    rollout = Rollout(task, lanes, seed)
    rng = np.random.default_rng(seed)
    state = rollout.start()
    returns = np.zeros(lanes)
    running = np.ones(lanes, np.bool_)
    weight = 1.0
    t = 0
    is_undiscounted = task.horizon is None and task.discount == 1
    while running.any() and (task.horizon is None or t < task.horizon):
        spend()
        tell(f"{lanes:,} episodes, step {t + 1:,}")
        moved = rollout.step(state, choose(state, t, rng), t)
        with np.errstate(over="ignore", invalid="ignore"):  # a return that no float holds is infinite, or nan
            returns += np.where(running, weight * moved.reward, 0.0)
        running = running & ~moved.terminal
        state = {n: np.where(running, moved.state[n], state[n]) for n in state}
        weight *= task.discount
        t += 1
        if weight < CUT:
            break
        if running.any() and (t >= LONGEST or (is_undiscounted and t == UNENDING and _lasts(running))):
            _refuse_endless(task, t)
    return returns


def _lasts(running: Array) -> bool:
    """Return whether an episode is expected to run for `LONGEST` steps, judged by those that ended before `UNENDING`."""
    return bool(running.mean() ** (LONGEST / UNENDING) * len(running) >= 1)


def _refuse_endless(task: Task, steps: int) -> NoReturn:
    hint = "give the task a horizon, or a discount below 1" if task.horizon is None else "choose a smaller horizon"
    refuse(f"episodes are still running after {steps:,} steps", hint)


def return_range(task: Task) -> tuple[float, float]:
    """Return bounds of the return of an episode, from bounds of the reward."""
    low, high = (float(v) for v in bounds(task.reward, {}))
    weight = _total_weight(task)
    if not (isinstance(task.terminal, Const) and not task.terminal.value):
        low = min(low, 0.0)
        high = max(high, 0.0)
    cut = CUT * weight * max(abs(low), abs(high)) if task.discount < 1 else 0.0
    least, most = (0.0 if end == 0 else weight * end for end in (low, high))
    return least * _outward(least, -1) - cut, most * _outward(most, 1) + cut


def _outward(end: float, sign: int) -> float:
    """Return a factor that moves a bound outwards by more than the rounding error of sums."""
    return 1 + 1e-9 * (sign if end > 0 else -sign)


def _total_weight(task: Task) -> float:
    """Return the sum of gamma**t over the steps of the longest episode."""
    steps = math.inf if task.horizon is None else float(task.horizon)
    gap = 1 - task.discount
    if gap == 0:
        return steps
    if gap == 1:
        return 1.0
    return -math.expm1(steps * math.log1p(-gap)) / gap  # 1 - gamma**steps would cancel for gamma near 1
