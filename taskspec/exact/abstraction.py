"""Tasks solved through a finite stand-in, and the test by simulation that the stand-in is faithful.

An abstraction maps every state to one of a finite task with the same actions. It is faithful when
rewards, ends and the distribution of the next mapped state depend on the mapped state alone; then
values, and returns of policies of the mapped state, are those of the task itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.diagnostics import Diagnostic
from taskspec.exact.outcomes import branches, is_finite
from taskspec.exact.places import Section
from taskspec.exact.rollout import Rollout, at_random, reads_of
from taskspec.exact.space import shown
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Node, Role, draws
from taskspec.spec.build import build_abstract
from taskspec.spec.task import Task

Array = np.ndarray[Any, Any]
State = Mapping[str, Array]
LANES = 512
SIGMAS = 6.0


@dataclass(frozen=True)
class Abstraction:
    """A task, its finite stand-in, and the nodes that map a state to the stand-in's, in order of its components."""

    task: Task
    stand_in: Task
    nodes: tuple[Node, ...]

    def map(self, state: State) -> dict[str, Array]:
        """The mapped state, (*shape, lanes)."""
        lanes = next(iter(state.values())).shape[-1]
        values = evaluate(self.nodes, reads_of(state, {}, 0))
        names = (c.name for c in self.stand_in.state)
        return {n: np.broadcast_to(v, (*v.shape[:-1], lanes)) for n, v in zip(names, values, strict=True)}


def abstraction(task: Task) -> Abstraction | None:
    """The abstraction that a task declares, or None."""
    written = task.surface.sections.get("abstraction")
    stand_in = build_abstract(task) if written else None
    if stand_in is None or not isinstance(written, dict):
        return None
    section = Section(task, "abstraction")
    nodes = [section.number(written[c.name]) if c.name in written else None for c in stand_in.state]
    found = tuple(n for n in nodes if n is not None)
    return Abstraction(task, stand_in, found) if len(found) == len(nodes) else None


def unfaithful(found: Abstraction, seed: int = 0) -> Diagnostic | None:
    """What simulated episodes with random actions show against an abstraction, or None.

    Rewards and ends of the stand-in must agree at every step, and the mapped next state must be one
    that it can reach. Start frequencies may be off by six standard errors.
    """
    problem = _endless(found.stand_in) or _start_problem(found, seed) or _step_problem(found, seed)
    if problem is None:
        return None
    expr = next(iter(found.task.surface.sections["abstraction"].values()))
    return Diagnostic("E604", expr.place.span, f"the abstraction is not faithful: {problem}")


def _endless(task: Task) -> str | None:
    """What of a stand-in has endlessly many outcomes, so that none can be found among them."""
    for draw in draws((*task.initial, *task.next, task.reward, task.terminal)):
        if not is_finite(draw):
            return f"it draws from a {draw.base} distribution, which has infinitely many outcomes"
    return None


def _start_problem(found: Abstraction, seed: int) -> str | None:
    lanes = 4096
    mapped = found.map(Rollout(found.task, lanes, seed).start())
    rows = _rows(mapped)
    values, counts = np.unique(rows, axis=0, return_counts=True)
    expected = _start_distribution(found.stand_in)
    for row, count in zip(values, counts, strict=True):
        p = expected.get(tuple(row.tolist()), 0.0)
        spread = np.sqrt(lanes * p * (1 - p)) * SIGMAS + 1e-9
        if abs(count - lanes * p) > spread + (SIGMAS if p else 0):
            state = _describe(found.stand_in, row)
            return f"{count} of {lanes} episodes start in {state}, where {lanes * p:.0f} are expected"
    return None


def _start_distribution(task: Task) -> dict[tuple[Any, ...], float]:
    total: dict[tuple[Any, ...], float] = {}
    for branch in branches(draws(task.initial), {}, 1):
        values = evaluate(task.initial, {}, branch.sample)
        n = 1 if branch.origin is None else len(branch.origin)
        names = (c.name for c in task.state)
        state = {k: np.broadcast_to(v, (*v.shape[:-1], n)) for k, v in zip(names, values, strict=True)}
        for row, weight in zip(_rows(state), np.broadcast_to(branch.weight, (n,)), strict=True):
            key = tuple(row.tolist())
            total[key] = total.get(key, 0.0) + float(weight)
    return total


def _rows(state: State) -> Array:
    """All elements of a state as numbers, (lanes, elements)."""
    return np.concatenate([v.reshape(-1, v.shape[-1]).astype(np.int64) for v in state.values()]).T


def _describe(task: Task, row: Array) -> str:
    words, at = [], 0
    for c in task.state:
        value = row[at : at + c.type.size].reshape(c.type.shape)
        words.append(f"{c.name} = {shown(c, value)}")
        at += c.type.size
    return ", ".join(words)


def _step_problem(found: Abstraction, seed: int) -> str | None:
    rollout, rng = Rollout(found.task, LANES, seed), np.random.default_rng(seed)
    choose, state = at_random(found.task), rollout.start()
    for t in range(min(found.task.horizon or 50, 50)):
        action = choose(state, t, rng)
        moved = rollout.step(state, action, t)
        problem = _compare(found, t, found.map(state), action, found.map(moved.state), moved.reward, moved.terminal)
        if problem is not None:
            return problem
        state = {n: np.where(moved.terminal, state[n], moved.state[n]) for n in state}
    return None


def _compare(
    found: Abstraction, t: int, here: State, action: State, there: State, reward: Array, terminal: Array
) -> str | None:
    """Whether some outcome of the stand-in agrees with what happened, in every lane."""
    task = found.stand_in
    roots = (*task.next, task.reward, task.terminal)
    reads = reads_of(here, action, t)
    lanes = len(reward)
    agrees = np.zeros(lanes, np.bool_)
    for branch in branches(draws(roots), reads, lanes):
        *following, paid, ended = evaluate(roots, branch.place(reads), branch.sample)
        at = np.arange(lanes) if branch.origin is None else branch.origin
        same = np.isclose(paid, reward[at], rtol=1e-9, atol=1e-9) & (ended == terminal[at])
        for c, value in zip(task.state, following, strict=True):
            same = same & (value == there[c.name][..., at]).reshape(-1, len(at)).all(axis=0)
        agrees[at[same]] = True
    if agrees.all():
        return None
    lane = int(np.flatnonzero(~agrees)[0])
    row = _rows({c.name: here[c.name] for c in task.state})[lane]
    did = ", ".join(f"{c.name} = {shown(c, action[c.name][..., lane])}" for c in task.action)
    return f"from {_describe(task, row)} with {did} it gives another reward, end or next state than the task does"


__all__ = ["Abstraction", "Role", "abstraction", "unfaithful"]
