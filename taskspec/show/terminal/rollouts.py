"""Rolling out a policy in an environment, and a summary of the episodes as data and as text on the terminal."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taskspec.base.arrays import Array, map_parts
from taskspec.base.display import decimal, estimate
from taskspec.base.limits import tell
from taskspec.exact.policies.adapters import ObservationPolicy, asked, policy_of
from taskspec.exact.policies.policy import EpisodeBatch, SharedDraws, TaskPolicy, is_name, observation_of, unknown
from taskspec.exact.policies.python_files import is_function
from taskspec.exact.rollout.rollout import alone
from taskspec.language.expressions.types import BOOLEAN_LABELS, Kind
from taskspec.language.task.parts import Component, RenderMode
from taskspec.language.task.spaces import pack, unpack
from taskspec.language.task.task import Task, recall
from taskspec.show.record import domain_words, settings, space_words, value_words
from taskspec.show.terminal.scripts import ScriptedPolicy, ScriptEnd, is_script
from taskspec.show.terminal.styled_text import Columns, VisibleText, console, line

if TYPE_CHECKING:
    from taskspec.envs import Environment


Act = Callable[[Any], Any]
"""From the observation just made to an action; raises ScriptEnd where there is none."""
Flat = tuple[Any, ...]
Watch = Callable[["Environment", str, bool], None]
"""Looks at the environment in every state: what was done and paid so far, in words, and whether the episode is over."""

ENDINGS = {
    "terminated": "reached a terminal state",
    "truncated": "reached the horizon",
    "script": "ran out of script",
    "cut": "were cut by --max-steps",
}
MOST_ELEMENTS = 16
"""The largest number of elements of an action that are all shown."""


def policy_for(name: str, env: Environment, seed: int) -> Act:
    """Return a policy that acts in an environment, one episode after the other."""
    if name == "random":
        env.action_space.seed(seed % 2**32)
        if env.task.mask:
            return lambda observation: env.action_space.sample(env.action_masks().astype(np.int8))
        return lambda observation: env.action_space.sample()
    task = env.task
    if is_script(name):
        components = [f"{c.name}: {domain_words(c)}" for c in task.action]
        words = f"{', '.join(components)} ({space_words(task.action_layout)})"
        policy: TaskPolicy = ScriptedPolicy(Path(name), task, words)
    elif is_function(name) or is_name(name):
        policy = policy_of(task, name)
    else:
        unknown(name, ("a .json or .csv file of actions", "FILE.py:FUNCTION"))
    draws = SharedDraws(np.random.default_rng(seed), 1)
    if isinstance(policy, ObservationPolicy):
        return _by_observation(policy, env, draws)
    return _by_state(policy, env, draws)


_RUNNING = np.ones(1, np.bool_)


def _by_observation(policy: ObservationPolicy, env: Environment, draws: SharedDraws) -> Act:
    def act(observation: Any) -> Any:
        observations = map_parts(lambda part: np.asarray(part)[None], observation)
        states = _states(env) if env.task.mask else {}
        batch = EpisodeBatch(env.time, states, observations, draws, _RUNNING)
        return observation_of(np.asarray(asked(policy, batch, policy.name)), 0)

    return act


def _by_state(policy: TaskPolicy, env: Environment, draws: SharedDraws) -> Act:
    task = env.task
    memory = task.annotations.memory if policy.task.annotations.remembers else None
    remembered: list[Flat] = []
    last: list[Flat] = []

    def act(observation: Any) -> Any:
        states = _states(env)
        if memory is not None:
            seen = unpack(task.observation_layout, observation)
            remembered[:] = recall(task, memory, seen, remembered, last, env.time)
            for c, flat in zip(memory.components, remembered, strict=True):
                states[c.name] = alone(c, flat)
        chosen = policy.choose(EpisodeBatch(env.time, states, None, draws, _RUNNING))
        last[:] = [tuple(np.asarray(chosen[c.name]).reshape(-1).tolist()) for c in task.action]
        return pack(policy.actions, last)

    return act


def _states(env: Environment) -> dict[str, Array]:
    return {c.name: alone(c, env.state[c.name]) for c in env.task.state}


@dataclass(frozen=True, slots=True)
class Episode:
    """One episode: its return, discounted as the task says and plain, its length, and how it ended (a key of ENDINGS)."""

    total: float
    plain: float
    length: int
    ending: str


def episodes_of(
    task: Task, policy: str, seed: int, count: int, max_steps: int, render_mode: RenderMode | None = None,
    watch: Watch | None = None,
) -> list[Episode]:  # fmt: skip
    """Return episodes of a policy in a new environment.

    Args:
        task: the task.
        policy: as `policy_for` takes it.
        seed: of the episodes.
        count: of episodes.
        max_steps: after which an episode is cut.
        render_mode: of the environment.
        watch: looks at every state; without it, progress is printed.
    """
    from taskspec.envs import Environment

    env = Environment(task, render_mode=render_mode)
    done = []
    try:
        for episode in rollouts(env, policy_for(policy, env, seed), seed, count, max_steps, watch):
            done.append(episode)
            if watch is None and render_mode is None:
                tell(f"episodes {len(done)}/{count}", len(done) / count)
    finally:
        env.close()
    return done


def rollouts(
    env: Environment, policy: Act, seed: int, count: int, max_steps: int, watch: Watch | None
) -> Iterator[Episode]:
    """Yield episodes one after the other, all functions of the seed."""
    yield _rollout(env, policy, seed, max_steps, watch)
    for _ in range(count - 1):
        yield _rollout(env, policy, None, max_steps, watch)


def _rollout(env: Environment, policy: Act, seed: int | None, max_steps: int, watch: Watch | None) -> Episode:
    """Return one episode. A seed restarts the stream of draws; without one it goes on."""
    observation, _ = env.reset(seed=seed)
    total = 0.0
    plain = 0.0
    weight = 1.0
    if watch is not None:
        watch(env, "", False)
    for length in range(max_steps):
        try:
            action = policy(observation)
        except ScriptEnd:
            return Episode(total, plain, length, "script")
        observation, reward, terminated, truncated, _ = env.step(action)
        total = total + weight * reward
        plain = plain + reward
        weight *= env.task.discount
        if watch is not None:
            note = f"action {action_words(env, action)}, reward {reward:.6g}, return {total:.6g}"
            watch(env, note, terminated or truncated)
        if terminated:
            return Episode(total, plain, length + 1, "terminated")
        if truncated:
            return Episode(total, plain, length + 1, "truncated")
    return Episode(total, plain, max_steps, "cut")


def action_words(env: Environment, action: Any) -> str:
    """Return an action for people: labels where it has them, and names for the other components of several."""
    words = []
    components = env.task.action
    for c, flat in zip(components, unpack(env.task.action_layout, action), strict=True):
        word = _value_words(c, flat)
        has_labels = c.domain is not None and c.type.kind is not Kind.BOOL
        if len(components) > 1 and not has_labels:
            word = f"{c.name} = {word}"
        words.append(word)
    return ", ".join(words)


def _value_words(c: Component, flat: Flat) -> str:
    if c.type.kind is Kind.BOOL:
        items = [BOOLEAN_LABELS[int(x)] for x in flat]
    elif c.domain is not None:
        items = [c.domain.labels[int(x)] for x in flat]
    else:
        items = list(map(value_words, flat))
    if len(items) > MOST_ELEMENTS:
        items = [*items[:3], "...", *items[-3:]]
    if c.type.is_scalar:
        return items[0]
    return f"[{', '.join(items)}]"


@dataclass(frozen=True, slots=True)
class Summary:
    """Statistics of episodes. `half` is half the 95 % confidence interval of the mean (None for one episode).

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


def summarize(episodes: Sequence[Episode], seconds: float) -> Summary:
    """Return statistics of at least one episode."""
    from scipy.special import stdtrit

    returns = np.array([e.total for e in episodes])
    lengths = [e.length for e in episodes]
    n = len(episodes)
    deviation = 0.0
    half = None
    if n > 1:
        deviation = float(returns.std(ddof=1))
        half = float(stdtrit(n - 1, 0.975)) * deviation / math.sqrt(n)
    return Summary(
        n, sum(lengths), float(returns.mean()), half, deviation, float(returns.min()), float(returns.max()),
        float(np.mean([e.plain for e in episodes])), float(np.mean(lengths)), dict(Counter(e.ending for e in episodes)), seconds,
    )  # fmt: skip


def print_summary(task: Task, policy: str, seed: int, summary: Summary) -> None:
    """Print how a policy did: return with its interval, lengths, and how episodes ended."""
    out = console()
    given = f" {settings(task)}".rstrip()
    who = policy
    if "." not in policy:
        who = f"{policy} policy"
    out.print(line((task.id, "name"), (given, "value"), (f"  {who}, seed {seed}", "quiet")))
    table = Columns("", "", styles=("quiet",), fold=(1,))
    table.add_row("  return", _mean(summary))
    if summary.deviation > 0:
        spread = f"{decimal(summary.lowest)} to {decimal(summary.highest)}, standard deviation {summary.deviation:.3g}"
        table.add_row("", VisibleText(spread, style="quiet"))
    if task.discount != 1:
        plain = f"discounted by {task.discount:g} a step; {decimal(summary.undiscounted)} without"
        table.add_row("", VisibleText(plain, style="quiet"))
    table.add_row("  length", f"{decimal(summary.length, 2)} steps")
    endings = Counter(summary.endings).most_common()
    table.add_row("  episodes", ", ".join(f"{n:,} {ENDINGS[key]}" for key, n in endings))
    out.print(table)


def _mean(summary: Summary) -> Any:
    if summary.half is None or summary.deviation == 0:
        every = "  in every episode" * (summary.episodes > 1)
        return line((decimal(summary.mean), "title"), (every, "quiet"))
    mean, half = estimate(summary.mean, summary.half)
    low = estimate(summary.mean - summary.half, summary.half)[0]
    high = estimate(summary.mean + summary.half, summary.half)[0]
    return line((mean, "title"), f" ± {half}", (f"   95 % CI: {low} to {high}", "quiet"))


def summary_data(task: Task, policy: str, seed: int, summary: Summary, done: Sequence[Episode]) -> dict[str, Any]:
    """Return how a policy did as plain data, with every return."""
    record = dataclasses.asdict(summary)
    half = record.pop("half")
    interval = None
    if half is not None:
        interval = [summary.mean - half, summary.mean + half]
    return {
        "id": task.id, "parameters": task.values, "modifiers": list(map(str, task.modifiers)), "policy": policy, "seed": seed,
        "content_hash": task.content_hash, **record, "confidence_95": interval, "returns": [each.total for each in done],
    }  # fmt: skip
