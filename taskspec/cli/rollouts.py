"""Rolling out a policy, and what the episodes amount to."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from taskspec.cli.policies import Act
from taskspec.lang.types import BOOLEAN_LABELS, Kind
from taskspec.policies.files import ScriptEnd
from taskspec.task.spaces import unpack

if TYPE_CHECKING:
    from taskspec.envs import Environment
    from taskspec.task.task import Component

ENDINGS = {
    "terminated": "reached a terminal state",
    "truncated": "reached the horizon",
    "script": "ran out of script",
    "cut": "were cut by --max-steps",
}
MOST_ELEMENTS = 16
"""Elements of an action that are all told."""
_STUDENT = (12.706, 4.303, 3.182, 2.776)  # 97.5 % quantiles for 1 to 4 degrees of freedom


@dataclass(frozen=True, slots=True)
class Episode:
    """One episode: its return, discounted as the task says and plain, its length, and how it ended (a key of ENDINGS)."""

    total: float
    plain: float
    length: int
    ending: str


Watch = Callable[["Environment", str, bool], None]
"""Looks at the environment in every state: what was done and paid so far, in words, and whether the episode is over."""


def rollout(env: Environment, policy: Act, seed: int | None, max_steps: int, watch: Watch | None) -> Episode:
    """Return one episode. A seed restarts the stream of draws; without one it goes on."""
    observation, _ = env.reset(seed=seed)
    total = 0.0
    plain = 0.0
    weight = 1.0
    length = 0
    if watch is not None:
        watch(env, "", False)
    while length < max_steps:
        try:
            action = policy(observation)
        except ScriptEnd:
            return Episode(total, plain, length, "script")
        observation, reward, terminated, truncated, _ = env.step(action)
        total = total + weight * reward
        plain = plain + reward
        length = length + 1
        weight *= env.task.discount
        if watch is not None:
            note = f"action {shown(env, action)}, reward {reward:.6g}, return {total:.6g}"
            watch(env, note, terminated or truncated)
        if terminated or truncated:
            return Episode(total, plain, length, "terminated" if terminated else "truncated")
    return Episode(total, plain, length, "cut")


def shown(env: Environment, action: Any) -> str:
    """Return an action for people: labels where it has them, and names for the other components of several."""
    components = env.task.action
    words = [_words(c, flat) for c, flat in zip(components, unpack(env.task.action_layout, action), strict=True)]
    if len(words) == 1:
        return words[0]
    return ", ".join(x if _has_labels(c) else f"{c.name} = {x}" for c, x in zip(components, words, strict=True))


def _has_labels(c: Component) -> bool:
    return c.domain is not None and c.type.kind is not Kind.BOOL


def _words(c: Component, flat: tuple[Any, ...]) -> str:
    """Return a component's value: labels, true and false, or numbers; in brackets where it has several elements."""
    if c.type.kind is Kind.BOOL:
        items = [BOOLEAN_LABELS[int(x)] for x in flat]
    elif c.domain is not None:
        items = [c.domain.labels[int(x)] for x in flat]
    else:
        items = [f"{x:.4g}" if isinstance(x, float) else str(x) for x in flat]
    items = items if len(items) <= MOST_ELEMENTS else [*items[:3], "...", *items[-3:]]
    return items[0] if c.type.is_scalar else f"[{', '.join(items)}]"


def rollouts(
    env: Environment, policy: Act, seed: int, count: int, max_steps: int, watch: Watch | None
) -> Iterator[Episode]:
    """Yield episodes one after the other, all functions of the seed."""
    for i in range(count):
        yield rollout(env, policy, seed if i == 0 else None, max_steps, watch)


# -- summary ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Summary:
    """What episodes amount to. `half` is half the 95 % confidence interval of the mean (None for one episode).

    Returns are discounted as the task says; `undiscounted` is the mean of the plain sums of rewards.
    """

    episodes: int
    steps: int
    mean: float
    half: float | None
    deviation: float
    lowest: float
    highest: float
    undiscounted: float
    length: float
    endings: dict[str, int]
    seconds: float


class Stopwatch:
    """Seconds since it was made."""

    def __init__(self) -> None:
        self.start = time.perf_counter()

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.start


def summarize(episodes: Sequence[Episode], seconds: float) -> Summary:
    """Mean return with its confidence interval, and how the episodes went; there is at least one episode."""
    returns = np.array([e.total for e in episodes])
    n = len(episodes)
    deviation = float(returns.std(ddof=1)) if n > 1 else 0.0
    return Summary(
        episodes=n, steps=sum(e.length for e in episodes), mean=float(returns.mean()),
        half=student(n - 1) * deviation / math.sqrt(n) if n > 1 else None, deviation=deviation,
        lowest=float(returns.min()), highest=float(returns.max()),
        undiscounted=float(np.mean([e.plain for e in episodes])),
        length=float(np.mean([e.length for e in episodes])), endings=dict(Counter(e.ending for e in episodes)),
        seconds=seconds,
    )  # fmt: skip


def student(freedom: int) -> float:
    """Return the 97.5 % quantile of Student's t: tabulated for few degrees of freedom, else the Cornish-Fisher expansion.

    Source: Abramowitz and Stegun, 26.7.5; the error is below 0.005 from 5 degrees of freedom on.
    """
    if freedom <= len(_STUDENT):
        return _STUDENT[freedom - 1]
    z = 1.959964
    v = freedom
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * v**3)
    return z + (z**3 + z) / (4 * v) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * v**2) + third
