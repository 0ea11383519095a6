"""Vector environments beside the second interpreter, in each autoreset mode."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import taskspec
from tests.verification.oracle.compare.cases import Case, Difference
from tests.verification.oracle.compare.lanes import Lane, Link, check_mask, check_measures, check_observation, near
from tests.verification.oracle.reference import spaces

MODES = ("NextStep", "SameStep", "Disabled")


@dataclass
class Walker:
    """Where a lane stands in its chain."""

    lane: Lane
    at: int = 0

    @property
    def here(self) -> Link:
        return self.lane.links[self.at]

    def next(self) -> Link | None:
        return self.lane.links[self.at + 1] if self.at + 1 < len(self.lane.links) else None


def walk(case: Case, lanes: list[Lane], backend: str, mode: str, *, tolerance: float = 0.0, **options: Any) -> int:
    """Walk all lanes together until the first of them has no more links; the number of steps compared."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return _walk(case, lanes, backend, mode, tolerance, options)


def _walk(case: Case, lanes: list[Lane], backend: str, mode: str, tolerance: float, options: dict[str, Any]) -> int:
    env = taskspec.make_vec(
        str(case.path), case.variant, num_envs=len(lanes), backend=backend, autoreset_mode=mode, **options, **case.given
    )
    walkers = [Walker(lane) for lane in lanes]
    seen, infos = env.reset(seed=lanes[0].seed)
    check = Checker(case, env, backend, mode, tolerance)
    check.observations([w.here for w in walkers], seen, range(len(walkers)))
    check.masks(walkers, infos)
    steps = 0
    while all(w.next() is not None for w in walkers):
        fresh = [i for i, w in enumerate(walkers) if (link := w.next()) is not None and link.action is None]
        if mode == "Disabled" and fresh:
            mask = np.array([i in fresh for i in range(len(walkers))])
            seen, _ = env.reset(options={"reset_mask": mask})
            advance(walkers, fresh)
            check.observations([w.here for w in walkers], seen, fresh)
            continue
        steps += check.step(walkers, fresh)
    env.close()
    return steps


def advance(walkers: list[Walker], which: Iterator[int] | list[int] | range) -> None:
    for i in which:
        walkers[i].at += 1


@dataclass
class Checker:
    case: Case
    env: Any
    backend: str
    mode: str
    tolerance: float

    def step(self, walkers: list[Walker], fresh: list[int]) -> int:
        """One call of `step`: lanes that begin anew in it ignore their action. How many lanes made a step."""
        links = [w.next() for w in walkers]
        spare = next((k.action for w in walkers for k in w.lane.links if k.action is not None), None)
        actions = [spaces.encoded(self.case.reference.action, k.action or spare) for k in links if k is not None]
        seen, paid, ended, cut, infos = self.env.step(np.array(actions))
        advance(walkers, range(len(walkers)))
        for i, w in enumerate(walkers):
            self.outcome(w.here, float(paid[i]), (bool(ended[i]), bool(cut[i])), i)
            if i not in fresh:
                self.measures(w.here, infos, i)
        moved = [i for i in range(len(walkers)) if i not in fresh]
        if self.mode == "SameStep":
            self.same_step(walkers, seen, infos)
        else:
            self.observations([w.here for w in walkers], seen, range(len(walkers)))
            self.masks(walkers, infos)
        return len(moved)

    def masks(self, walkers: list[Walker], infos: Any) -> None:
        """Which actions are legal in the state of each lane."""
        for i, w in enumerate(walkers):
            mask = infos["action_mask"][i] if "action_mask" in infos else None
            check_mask(w.here.result, mask, self.where(i, w.here))

    def same_step(self, walkers: list[Walker], seen: Any, infos: Any) -> None:
        """Lanes that end begin anew at once; what they saw last is in `infos`."""
        over = [i for i, w in enumerate(walkers) if w.here.result.terminated or w.here.result.truncated]
        if over:
            if not all(bool(infos["_final_obs"][i]) == (i in over) for i in range(len(walkers))):
                raise Difference("final_obs", f"{self.where(over[0], walkers[over[0]].here)}: {infos['_final_obs']}")
            self.observations([w.here for w in walkers], infos["final_obs"], over)
        here = [i for i in over if walkers[i].next() is not None]
        advance(walkers, here)
        rest = [i for i in range(len(walkers)) if i not in over or i in here]
        self.observations([w.here for w in walkers], seen, rest)
        if len(rest) == len(walkers):
            self.masks(walkers, infos)

    def where(self, i: int, link: Link) -> str:
        return f"{self.backend} {self.mode} lane {i}, time {link.result.time}"

    def outcome(self, link: Link, paid: float, ends: tuple[bool, bool], i: int) -> None:
        expected = np.array(float(link.result.reward.item))
        rough = link.result.reward.rough or self.tolerance > 0
        if not near(expected, np.array(paid), rough=rough, tolerance=max(1e-9, self.tolerance)):
            raise Difference("reward", f"{self.where(i, link)}: {paid}, expected {expected}")
        flags = (link.result.terminated, link.result.truncated)
        if ends != flags:
            raise Difference("end", f"{self.where(i, link)}: {ends}, expected {flags}")

    def measures(self, link: Link, infos: Any, i: int) -> None:
        """What is measured in a step, which is in the last info where the episode has begun again."""
        ended = link.result.terminated or link.result.truncated
        if ended and self.mode == "SameStep":
            infos = infos["final_info"]
        values = {
            k: v[i]
            for k, v in infos.get("measures", {}).items()
            if not k.startswith("_") and infos["measures"]["_" + k][i]
        }
        check_measures(link.result, values, self.where(i, link), tolerance=self.tolerance)

    def observations(self, links: list[Link], seen: Any, which: Any) -> None:
        for i in which:
            one = {k: v[i] for k, v in seen.items()} if isinstance(seen, dict) else seen[i]
            space = self.env.single_observation_space
            where = self.where(i, links[i])
            check_observation(self.case, links[i].result, one, space, where, tolerance=self.tolerance)
