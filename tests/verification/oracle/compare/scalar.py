"""The scalar environment beside the second interpreter."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import taskspec
from tests.verification.oracle.compare.cases import Case, Difference
from tests.verification.oracle.compare.lanes import (
    Lane,
    Link,
    check_mask,
    check_measures,
    check_observation,
    check_state,
    close,
)
from tests.verification.oracle.reference import spaces
from tests.verification.oracle.reference.episodes import Result
from tests.verification.oracle.reference.task import State
from tests.verification.oracle.reference.values import scalar


def walk(case: Case, lane: Lane, **options: Any) -> int:
    """Walk one seed's chain; the number of steps compared. `Difference`: the first thing that is not as expected."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = taskspec.make(case.task, **options)
        for i, link in enumerate(lane.links):
            where = f"scalar {options or ''} seed {lane.seed}, event {i} ({describe(link)})"
            if link.action is None:
                seen, info = env.reset(seed=lane.seed) if i == 0 else env.reset()
                paid = 0.0
                ends = (False, False)
            else:
                seen, paid, *flags, info = env.step(encoded(case, link.action))
                ends = (bool(flags[0]), bool(flags[1]))
                check_measures(link.result, info.get("measures", {}), where)
            check_mask(link.result, info.get("action_mask"), where)
            check_state(link.result.state, env.state, where)
            check_step(link, paid, ends, where)
            result = with_time(link.result) if options.get("observe_time") else link.result
            check_observation(case, result, seen, env.observation_space, where)
            if not env.observation_space.contains(seen):
                raise Difference("bounds", f"{where}: {seen} is not in {env.observation_space}")
    return sum(link.action is not None for link in lane.links)


def encoded(case: Case, action: State) -> Any:
    return spaces.encoded(case.reference.action, action)


def describe(link: Link) -> str:
    before = link.result.time
    if link.action is None:
        return "reset"
    return f"step to time {before} by {[v.data for v in link.action.values()]}"


def check_step(link: Link, paid: float, ends: tuple[bool, bool], where: str) -> None:
    if not close(link.result.reward, paid, rough=False):
        raise Difference("reward", f"{where}: {paid}, expected {link.result.reward.item}")
    expected = (link.result.terminated, link.result.truncated)
    if ends != expected:
        raise Difference("end", f"{where}: terminated, truncated {ends}, expected {expected}")


def with_time(result: Result) -> Result:
    """What is seen where the time is added to the observation."""
    return replace(result, seen=[*result.seen, ("t", scalar(result.time))])
