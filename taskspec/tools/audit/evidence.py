"""The evidence of an audit: episodes, a table with its exact values where the environment is small, and returns."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.base.display import decimal
from taskspec.base.limits import tell
from taskspec.exact.abstraction.abstraction import Rows, levels, signature
from taskspec.exact.solve.backward import Given, Uniform
from taskspec.exact.solve.plans import optimal_plan, stationary
from taskspec.exact.solve.solve import Solvers
from taskspec.tools.audit.snapshot import Place, Snapshot, counters, place_value, snapshot, totals
from taskspec.tools.audit.subject import MOST_STEPS, Deadline, EnvEpisode, EnvStep, Subject, Trace, TracePart
from taskspec.tools.audit.tabulate import StateTable, TableSearch, Untabulated, by_probabilities, compare

T = TypeVar("T")
EPISODES = 20
MOST_TOGETHER = 5_000
"""Steps of all episodes that are kept."""
WATCHED = 5
"""Episodes whose states are looked at after each step."""
MOST_RETURNS = 1_000


@dataclass(frozen=True)
class TableValues:
    """Expected returns of a table: of the best and the worst policy, of random actions, and of each action alone."""

    best: float
    worst: float
    random: float
    constant: tuple[float, ...]


class Evidence:
    """The evidence about an environment; each part is worked out when it is asked for.

    Args:
        seconds: that all of it may take, roughly.
    """

    def __init__(self, subject: Subject, seconds: float) -> None:
        self.subject = subject
        self.seconds = seconds
        subject.longest = 0.05 * seconds
        self.findings: dict[str, Any] = {}
        self.unexamined: list[str] = []
        self.why_not = ""
        self.wrong_P: tuple[str, Trace | None] | None = None

    def until(self, share: float) -> Deadline:
        """Return the end of a share of the seconds, from now on."""
        return Deadline(share * self.seconds)

    def in_time(self, items: Iterable[T]) -> Iterator[T]:
        """Yield items until a tenth of the seconds is over."""
        end = self.until(0.1)
        for item in items:
            yield item
            if end.is_over:
                return

    @cached_property
    def episodes(self) -> list[EnvEpisode]:
        """Episodes of random actions, each in an instance of its own."""
        episodes: list[EnvEpisode] = []
        together = 0
        end = self.until(0.05)
        for seed in range(EPISODES):
            tell(f"episode {seed + 1}")
            episodes.append(self.subject.episode(seed))
            together += len(episodes[-1].steps)
            if end.is_over or together > MOST_TOGETHER:
                break
        return episodes

    @cached_property
    def all_episodes(self) -> list[EnvEpisode]:
        """The episodes, and one of each action again and again."""
        episodes = list(self.episodes)
        for action in self.in_time(self.subject.actions() or []):
            episodes.append(self.subject.episode(0, repeat=action))
        return episodes

    @cached_property
    def returns(self) -> dict[str, list[float]]:
        """Returns of random actions, and of each action again and again, as many as there is time for."""
        instance = self.subject.make()
        policies: dict[str, Any] = {"random": None}
        for action in self.subject.actions(16) or []:
            policies[str(action)] = action
        returns: dict[str, list[float]] = defaultdict(list)
        end = self.until(0.15)
        for seed in range(MOST_RETURNS):
            for name, action in policies.items():
                episode = self.subject.episode(seed, instance, action)
                if episode.steps[-1].is_last or len(episode.steps) > MOST_STEPS:
                    returns[name].append(sum(step.paid for step in episode.steps))
            tell(f"returns, {seed + 1} episodes each")
            if end.is_over:
                break
        return returns

    @cached_property
    def snapshots(self) -> list[list[Snapshot]]:
        """The states of some episodes, step by step."""
        states = []
        end = self.until(0.05)
        for episode in self.episodes[:WATCHED]:
            instance = self.subject.make()
            instance.reset(episode.seed)
            seen = [snapshot(instance.env)]
            for action in episode.actions[:200]:
                instance.step(action)
                seen.append(snapshot(instance.env))
                if end.is_over:
                    break
            states.append(seen)
        return states

    @cached_property
    def counters(self) -> frozenset[Place]:
        """The places of numbers that count steps."""
        return counters(self.snapshots)

    @cached_property
    def horizon(self) -> int | None:
        """The time limit that is declared; else the length of all episodes that are truncated, if they have the same one."""
        if self.subject.limit is not None:
            return self.subject.limit
        truncated = set()
        longest = 0
        for episode in self.episodes:
            length = len(episode.actions)
            longest = max(longest, length)
            if episode.steps[-1].truncated:
                truncated.add(length)
        if truncated != {longest} or not self.counters:
            return None
        return longest

    @cached_property
    def last_steps_without_time(self) -> list[tuple[EnvEpisode, EnvStep, EnvStep]]:
        """Episodes with their last step, and with the same step where the counters of steps are those of a reset."""
        pairs: list[tuple[EnvEpisode, EnvStep, EnvStep]] = []
        if not self.counters:
            return pairs
        for episode in self.in_time(self.episodes[: 2 * WATCHED]):
            last = episode.steps[-1]
            if last.error or not last.is_last or len(episode.actions) < 2:
                continue
            instance = self.subject.make()
            instance.reset(episode.seed)
            first = snapshot(instance.env)
            for action in episode.actions[:-1]:
                instance.step(action)
            try:
                early = instance.copy()
                for place in self.counters:
                    place_value(early.env, place, first.leaves[place])
            except Exception:  # such an object cannot be copied, or is not to be changed
                return []
            pairs.append((episode, instance.step(episode.actions[-1]), early.step(episode.actions[-1])))
        return pairs

    @cached_property
    def after_the_end(self) -> str | None:
        """The result of a step after a termination, in words; None where no episode terminated."""
        shortest = None
        for episode in self.episodes:
            is_shorter = shortest is None or len(episode.steps) < len(shortest.steps)
            if episode.steps[-1].terminated and is_shorter:
                shortest = episode
        if shortest is None:
            return None
        step = self.subject.play((TracePart(shortest.seed, (*shortest.actions, shortest.actions[-1])),))[-1]
        if step.error:
            return step.error
        goes = "ends again" if step.terminated else "goes on"
        return f"{goes}, and pays {decimal(step.paid)}"

    @cached_property
    def table(self) -> StateTable | None:
        """The environment as a table; None where it has none, for the reason in `why_not`."""
        try:
            return self._tabulated()
        except Untabulated as error:
            self.why_not = str(error)
        except Exception as error:
            self.why_not = f"{type(error).__name__}: {error}"
        return None

    def _tabulated(self) -> StateTable:
        for episode in self.episodes:
            for step in episode.steps:
                if step.error or math.isnan(step.paid):
                    raise Untabulated("it raises exceptions, or rewards are no numbers")
        table = by_probabilities(self.subject, self.horizon)
        if table is not None:
            try:
                compare(table, self.subject, self.in_time(self.episodes), None)
                if table.by_time is None:
                    return table
                s, a, trace = table.by_time
                self.wrong_P = f"`P` has another reward or end for s = {s}, a = {a}", trace
            except Untabulated as error:
                self.wrong_P = f"`P` has another next state, {error}", None
        self._check_recurrence()
        return self._searched()

    def _searched(self) -> StateTable:
        """Return the table of the smallest states that suffice: without sums and histories, without counters, or whole."""
        limits = frozenset(place for place in self.counters if place[-1] == "_elapsed_steps")
        tries = [(totals(self.snapshots), math.inf), (self.counters, math.inf), (limits, self.horizon or math.inf)]
        by_time = None
        for ignored, deepest in dict(tries).items():
            try:
                search = TableSearch(self.subject, self.horizon, ignored, self.counters, self.until(0.2), deepest)
                table = search.run()
                compare(table, self.subject, self.in_time(self.episodes), ignored)
            except Untabulated as error:
                reason = error
                continue
            if table.by_time is None:
                return table
            by_time = table
            if ignored == self.counters:
                break
        if by_time is None:
            raise reason
        return by_time

    def _check_recurrence(self) -> None:
        """Refuse environments whose states seldom recur in episodes: they would have too many."""
        ignored = totals(self.snapshots)
        keys = []
        for seen in self.snapshots:
            keys += [each.key(ignored) for each in seen]
        half = len(keys) // 2
        if half > 50 and len(set(keys[half:]) - set(keys[:half])) > 0.9 * (len(keys) - half):
            raise Untabulated("its states seldom recur")

    @cached_property
    def solved(self) -> TableValues | None:
        """The values of the table."""
        if self.table is None:
            return None
        try:
            model = self.table.model(self.horizon or MOST_STEPS)
            solver = Solvers(model).in_floats
            shape = (model.n_actions, model.n_states)
            constant = []
            for a in range(model.n_actions):
                pi = np.zeros(shape)
                pi[a] = 1
                constant.append(solver.value(Given(stationary(pi))).value)
            return TableValues(
                solver.best().value, solver.worst().value, solver.value(Uniform()).value, tuple(constant)
            )
        except SpecError as error:
            self.why_not = error.diagnostics[0].message
            return None

    @cached_property
    def checked(self) -> list[float]:
        """Returns of the best policy of a table with estimated chance, in the environment itself."""
        assert self.table is not None
        plan = optimal_plan(self.table.model(self.horizon or MOST_STEPS))
        returns: list[float] = []
        end = self.until(0.1)
        while not end.is_over and len(returns) < MOST_RETURNS:
            instance = self.subject.make()
            step = instance.reset(len(returns))
            total = 0.0
            for t in range(self.horizon or MOST_STEPS):
                s = self.table.states.get(snapshot(instance.env).key(self.table.ignored), 0)
                step = instance.step(self.table.actions[int(plan(t)[:, s].argmax())])
                total += step.paid
                if step.is_last:
                    break
            returns.append(total)
        return returns

    @cached_property
    def acting(self) -> list[int]:
        """The states in which some episode acts."""
        assert self.table is not None
        return np.flatnonzero(self.table.model(self.horizon).acting).tolist()

    @cached_property
    def entered(self) -> int:
        """The number of states that some episode is ever in."""
        assert self.table is not None
        return int(self.table.model(self.horizon).entered.sum())

    @cached_property
    def rows(self) -> Rows:
        """The rows of the table; where probabilities are estimated, only which outcomes are possible."""
        assert self.table is not None
        if not self.table.drawn:
            return self.table.rows
        rows = []
        for by_action in self.table.rows:
            rows.append([dict.fromkeys(outcomes, 1) for outcomes in by_action])
        return rows

    @cached_property
    def classes(self) -> list[list[int]] | None:
        """The classes of bisimulation, level by level; None where some state in which episodes act was not explored."""
        if self.table is None or not all(self.table.rows[s] for s in self.acting):
            return None
        return levels(self.rows, self.table.observations)

    def equal_actions(self) -> list[list[Any]]:
        """Return groups of actions that have the same outcomes in every state."""
        if self.table is None or self.classes is None:
            return []
        groups: dict[Hashable, list[Any]] = defaultdict(list)
        level = len(self.classes) - 1
        by_state = [signature(self.rows, self.classes, level, s) for s in self.acting]
        for a, action in enumerate(self.table.actions):
            groups[tuple(each[a] for each in by_state)].append(action)
        return [group for group in groups.values() if len(group) > 1]
