"""The checks of an audit, one entry each: for faults, from which learners suffer, and facts, which users should know."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env

from taskspec.base.display import decimal, plural
from taskspec.exact.abstraction.abstraction import apart
from taskspec.tools.audit.evidence import Evidence
from taskspec.tools.audit.subject import Trace, TracePart, first_difference, frozen, shown

EQUAL = 1e-9
"""Returns that differ by less are equal."""


@dataclass(frozen=True)
class AuditFinding:
    """A finding in words, and a trace that shows it, where there is one."""

    words: str
    trace: Trace | None = None


@dataclass(frozen=True)
class AuditCheck:
    """One thing that is looked for."""

    name: str
    kind: Literal["fault", "fact"]
    look: Callable[[Evidence], AuditFinding | None]


# -- what every step must keep ----------------------------------------------------------------------------------------


def raises(x: Evidence) -> AuditFinding | None:
    """Find an exception of the environment."""
    for episode in x.all_episodes:
        if episode.steps[-1].error:
            return AuditFinding(episode.steps[-1].error, episode.trace())
    return None


def outside(x: Evidence) -> AuditFinding | None:
    """Find an observation that is not in the observation space."""
    for episode in x.all_episodes:
        for t, step in enumerate(episode.steps):
            if step.error:
                continue
            why = why_outside(x.subject.observation_space, step.observation)
            if why is not None:
                return AuditFinding(f"at t = {t} the observation {why}", episode.trace(t))
    return None


def why_outside(space: Any, value: Any) -> str | None:
    """Return why a value is not in a space; stricter than Gymnasium about types, which buffers of learners depend on."""
    spaces = gymnasium.spaces
    match space:
        case spaces.Dict():
            if not isinstance(value, dict) or set(value) != set(space.spaces):
                return f"has not the keys {', '.join(map(str, space.spaces))}"
            return _first_outside(space.spaces.values(), map(value.get, space.spaces))
        case spaces.Tuple():
            if not isinstance(value, tuple) or len(value) != len(space.spaces):
                return f"is no tuple of {len(space.spaces)}"
            return _first_outside(space.spaces, value)
        case spaces.Box() | spaces.MultiDiscrete() | spaces.MultiBinary():
            why = _why_another_array(space, value)
            if why is not None:
                return why
    if space.contains(value):
        return None
    return f"{shown(value)} is not in {space}"


def _why_another_array(space: Any, value: Any) -> str | None:
    if not isinstance(value, np.ndarray):
        return f"is of the type {type(value).__name__}; its space holds arrays"
    if value.dtype != space.dtype:
        return f"is {value.dtype}; its space is {space.dtype}"
    if value.shape != space.shape:
        return f"has the shape {value.shape}; its space has {space.shape}"
    if not isinstance(space, gymnasium.spaces.Box) or space.contains(value):
        return None
    wrong = np.argwhere(~((value >= space.low) & (value <= space.high)))[0]
    at = tuple(wrong.tolist())
    where = f" at {list(at)}" if at else ""
    return f"is {value[at]}{where}; its bounds are {space.low[at]} and {space.high[at]}"


def _first_outside(spaces: Iterable[Any], values: Iterable[Any]) -> str | None:
    return next(filter(None, map(why_outside, spaces, values)), None)


def reward_type(x: Evidence) -> AuditFinding | None:
    """Find a reward that is no finite number, or an end that is no truth value."""
    for episode in x.all_episodes:
        for t, step in enumerate(episode.steps[1:], 1):
            if step.error:
                break
            is_number = isinstance(step.reward, int | float | np.integer | np.floating) and np.isfinite(step.reward)
            if not is_number:
                return AuditFinding(
                    f"at t = {t} the reward is {shown(step.reward)}, which is no finite number", episode.trace(t)
                )
            for name in ("terminated", "truncated"):
                value = getattr(step, name)
                if not isinstance(value, bool | np.bool_):
                    return AuditFinding(
                        f"at t = {t} `{name}` is {shown(value)}, which is no truth value", episode.trace(t)
                    )
    return None


def mutated(x: Evidence) -> AuditFinding | None:
    """Find an observation or info that is changed after it was returned."""
    for episode in x.episodes:
        for t, step in enumerate(episode.steps):
            is_changed = frozen(step.observation) != step.seen
            if not step.error and (is_changed or frozen(step.info) != step.seen_info):
                name = "observation" if is_changed else "info"
                words = f"the {name} of t = {t} is changed by later steps; return a copy"
                return AuditFinding(words, episode.trace(t + 1))
    return None


# -- what repetitions must keep ---------------------------------------------------------------------------------------


def not_reproducible(x: Evidence) -> AuditFinding | None:
    """Find an episode that differs when it is repeated with the same seed in a new instance."""
    for episode in x.in_time(x.episodes):
        t = first_difference(episode.steps, x.subject.play(episode.trace(), world=episode.seed + 1))
        if t is not None:
            return AuditFinding(f"the same seed and actions give something else at t = {t}", episode.trace(t))
    return None


def kept_by_reset(x: Evidence) -> AuditFinding | None:
    """Find an episode that depends on the episodes before it."""
    if "same seed" in x.findings:
        return None
    for before, episode in x.in_time(pairwise(x.episodes)):
        trace = (*before.trace(), *episode.trace())
        t = first_difference(episode.steps, x.subject.play(trace)[len(before.steps) :])
        if t is not None:
            words = f"after another episode, the same seed and actions give something else at t = {t}"
            return AuditFinding(words, (*before.trace(), *episode.trace(t)))
    return None


def shared(x: Evidence) -> AuditFinding | None:
    """Find an episode that depends on what another instance does meanwhile."""
    if "same seed" in x.findings:
        return None
    for other, episode in x.in_time(pairwise(x.episodes)):
        trace = (*episode.trace(0), replace(other.trace()[0], instance="b"), TracePart(None, episode.actions))
        steps = x.subject.play(trace)
        t = first_difference(episode.steps, [steps[0], *steps[1 + len(other.steps) :]])
        if t is not None:
            short = (*trace[:2], TracePart(None, episode.actions[:t]))
            return AuditFinding(f"another instance changes what the same seed and actions give at t = {t}", short)
    return None


# -- ends -------------------------------------------------------------------------------------------------------------


def ends_by_time(x: Evidence) -> AuditFinding | None:
    """Find a termination that the time alone causes, where the time is not observed."""
    caused = []
    for episode, step, early in x.last_steps_without_time:
        if step.terminated and not early.terminated:
            if step.seen != early.seen:
                return None
            caused.append(episode)
    if not caused:
        return None
    episode = caused[0]
    words = f"step {len(episode.actions)} is terminated by a counter of steps that is not observed: it is a truncation"
    return AuditFinding(words, episode.trace())


def truncated_by_state(x: Evidence) -> AuditFinding | None:
    """Find a truncation that the time does not cause."""
    for episode, step, early in x.last_steps_without_time:
        if step.truncated and not step.terminated and early.truncated:
            return AuditFinding(
                f"step {len(episode.actions)} is truncated by the state, not by the time", episode.trace()
            )
    return None


# -- what tables show -------------------------------------------------------------------------------------------------


def table_disagrees(x: Evidence) -> AuditFinding | None:
    """Find a step that the environment's own `P` does not have."""
    if x.table is None and x.wrong_P is None:  # the table is made here, and compared with `P`
        return None
    if x.wrong_P is None:
        return None
    return AuditFinding(*x.wrong_P)


def unsolvable(x: Evidence) -> AuditFinding | None:
    """Find that all policies earn the same."""
    if x.solved is None or x.table is None or x.table.by_time or x.solved.best - x.solved.worst > EQUAL:
        return None
    return AuditFinding(f"nothing can be learned: every policy earns {decimal(x.solved.best)}")


def one_action(x: Evidence) -> AuditFinding | None:
    """Find that one action is optimal everywhere."""
    values = x.solved
    if values is None or values.best - values.random <= EQUAL * max(1.0, abs(values.best)):
        return None
    for action, value in zip(x.subject.actions() or [], values.constant, strict=True):
        if value >= values.best - EQUAL * max(1.0, abs(values.best)):
            trace = x.subject.episode(0, repeat=action).trace()
            return AuditFinding(f"action {shown(action)}, always, is optimal: it earns {decimal(value)}", trace)
    return None


def nothing_told_apart(x: Evidence) -> AuditFinding | None:
    """Find that all episodes of a large environment earned the same."""
    if x.solved is not None:
        return None
    returns = set()
    for values in x.returns.values():
        returns |= {round(value, 9) for value in values}
    if len(returns) != 1:
        return None
    return AuditFinding(f"every episode earned {decimal(returns.pop())}, with random actions and with each fixed one")


def hidden_state(x: Evidence) -> AuditFinding | None:
    """Find two states with the same observation and different futures."""
    table = x.table
    if table is None or x.classes is None:
        return None
    pair = _alike(x, x.classes[-1])
    if pair is None:
        return None
    actions = [table.actions[a] for a in apart(x.rows, x.classes, *pair)]
    after = "after the same action"
    if len(actions) != 1:
        after = f"after the same {len(actions)} actions"
    words = f"{shown(table.shown[pair[0]])} is observed in two states, which differ {after}: it is a POMDP"
    return AuditFinding(words, _traces(x, pair, actions))


def hidden_reward(x: Evidence) -> AuditFinding | None:
    """Find two states with the same observation that pay differently for the same action."""
    table = x.table
    if table is None or x.classes is None:
        return None
    for a, action in enumerate(table.actions):
        paid: list[frozenset[float]] = []
        for row in table.rows:
            rewards: frozenset[float] = frozenset()
            if row:
                rewards = frozenset(reward for _, reward, _ in row[a])
            paid.append(rewards)
        pair = _alike(x, paid)
        if pair is not None:
            s, other = pair
            words = f"{shown(table.shown[s])} is observed, and action {shown(action)} pays"
            words += f" {_listed(paid[s])} or {_listed(paid[other])}"
            return AuditFinding(words, _traces(x, pair, [action]))
    return None


def _listed(rewards: frozenset[float]) -> str:
    return ", ".join(map(decimal, sorted(rewards)))


def _alike(x: Evidence, values: list[Any]) -> tuple[int, int] | None:
    first: dict[Hashable, int] = {}
    assert x.table is not None
    for s in x.acting:
        other = first.setdefault(x.table.observations[s], s)
        if values[other] != values[s]:
            return other, s
    return None


def _traces(x: Evidence, pair: tuple[int, int], actions: list[Any]) -> Trace | None:
    assert x.table is not None
    parts: list[TracePart] = []
    for s in pair:
        trace = x.table.traces[s]
        if trace is None:
            return None
        parts.append(TracePart(trace[0].seed, (*trace[0].actions, *actions)))
    return tuple(parts)


def by_time(x: Evidence) -> AuditFinding | None:
    """Find a reward or an end that depends on the time."""
    if x.table is None or x.table.by_time is None:
        return None
    s, a, trace = x.table.by_time
    words = f"the reward or the end depends on the time: in {shown(x.table.shown[s])}, for action {shown(x.table.actions[a])}"
    return AuditFinding(words, trace)


def same_actions(x: Evidence) -> AuditFinding | None:
    """Find actions that do the same in every state."""
    groups = x.equal_actions()
    if not groups:
        return None
    listed = []
    for group in groups:
        listed.append(", ".join(map(shown, group)))
    return AuditFinding(f"these actions do the same in every state: {'; '.join(listed)}")


def unreached(x: Evidence) -> AuditFinding | None:
    """Find declared states that no episode enters."""
    if x.table is None or x.table.declared is None:
        return None
    count = x.table.declared - x.entered
    if count <= 0:
        return None
    return AuditFinding(f"no episode enters {plural(count, 'state')} of {x.table.declared:,}")


def gymnasium_check(x: Evidence) -> AuditFinding | None:
    """Find what Gymnasium's own checker raises, where no other check has a finding."""
    if x.findings:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            check_env(x.subject.make().env, skip_render_check=True)
    except Exception as error:
        return AuditFinding(f"Gymnasium's check_env: {' '.join(str(error).split())[:200]}")
    return None


CHECKS = (
    AuditCheck("exception", "fault", raises),
    AuditCheck("observation", "fault", outside),
    AuditCheck("reward", "fault", reward_type),
    AuditCheck("changed later", "fault", mutated),
    AuditCheck("same seed", "fault", not_reproducible),
    AuditCheck("reset", "fault", kept_by_reset),
    AuditCheck("instances", "fault", shared),
    AuditCheck("time limit", "fault", ends_by_time),
    AuditCheck("P", "fault", table_disagrees),
    AuditCheck("unsolvable", "fault", unsolvable),
    AuditCheck("check_env", "fault", gymnasium_check),
    AuditCheck("truncation", "fact", truncated_by_state),
    AuditCheck("hidden state", "fact", hidden_state),
    AuditCheck("hidden reward", "fact", hidden_reward),
    AuditCheck("time", "fact", by_time),
    AuditCheck("one action", "fact", one_action),
    AuditCheck("returns", "fact", nothing_told_apart),
    AuditCheck("same actions", "fact", same_actions),
    AuditCheck("unreached", "fact", unreached),
)
