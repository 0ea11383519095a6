"""The difference in meaning between two tasks: none, one of names or of rewards alone, or a step at which they part.

Finite tasks are compared in all that episodes do, in rationals: first by the names of states and actions, then up to a renaming
by bisimulation. Two rewards ask for the same behaviour in every state and at every time if and only if the advantages of random
actions, Q - V, are proportional: then one is the other, scaled and shaped by a potential that is 0 at the end (A. Ng, D. Harada
and S. Russell, Policy invariance under reward transformations, ICML 1999). Other tasks are compared in episodes with the same
random words.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from operator import attrgetter
from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.base.display import decimal
from taskspec.exact.abstraction.abstraction import Rows, classes_from, levels
from taskspec.exact.model.probabilities import Inexact
from taskspec.exact.rollout.rollout import Rollout, State, at_random, is_bounded, reads_of
from taskspec.exact.solve.backward import backward
from taskspec.exact.solve.bounded import Bound
from taskspec.exact.solve.rational import Scaled
from taskspec.exact.solve.solve import Solver, Solvers
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import Refused
from taskspec.language.modifiers import modify
from taskspec.language.task.task import Task
from taskspec.show.record import space
from taskspec.tools.difference.first_difference import (
    MOST_OUTCOMES,
    FirstDifference,
    NamedSteps,
    few,
    first_difference,
    shown,
)
from taskspec.tools.exchange.freezing import pays_after_ends

Relation = Literal[
    "identical", "same task", "renamed", "scaled reward", "shaped reward", "same optimal policy", "different",
    "no difference found",
]  # fmt: skip
MOST_VALUES = 5_000_000
"""Action values of all times up to which policies are compared."""
MOST_RENAMINGS = 720
LANES = 256
MOST_STEPS = 200
EQUAL = 1e-9


@dataclass(frozen=True)
class TaskRelation:
    """The relation of two tasks.

    Attributes:
        words: the relation in a sentence.
        difference: the first difference by name; None where there is none, or states have other names.
        returns: the optimal return of each task.
        new_version: whether the version in the id must rise; None for tasks of different names.
    """

    relation: Relation
    words: str
    difference: FirstDifference | None = None
    returns: Mapping[str, float] | None = None
    new_version: bool | None = None


def compare(a: Task, b: Task) -> TaskRelation:
    """Compare two tasks in meaning: exactly if both are finite, otherwise in episodes with the same random words."""
    relation = _compared(a, b)
    is_same = relation.relation in ("identical", "same task")
    if is_same:
        other = _other_spaces(a, b) or _other_payments(a, b)
        if other:
            relation = replace(relation, words=f"{relation.words}; but {other}")
            is_same = False
    if a.name != b.name:
        return relation
    return replace(relation, new_version=not is_same)


def _compared(a: Task, b: Task) -> TaskRelation:
    if a.content_hash == b.content_hash and a.name == b.name:
        return TaskRelation("identical", "all sections that decide the behaviour are written in the same way")
    try:
        one = NamedSteps(a)
        other = NamedSteps(b)
    except SpecError as error:
        return _by_episodes(a, b, error.diagnostics[0].message)
    except (Inexact, Refused):
        return _by_episodes(a, b, "probabilities are no rational numbers")
    difference = first_difference(one, other)
    if difference is None:
        return TaskRelation("same task", "every step has the same outcomes")
    words = _renaming(one, other)
    if words is not None:
        return TaskRelation("renamed", words, difference)
    return _by_rewards(one, other, difference)


def _other_spaces(a: Task, b: Task) -> str:
    """Name the space that differs, in words; empty where none does."""
    if space(a.observation_layout) != space(b.observation_layout):
        return "the observation space is another one"
    if space(a.action_layout) != space(b.action_layout):
        return "the action space is another one"
    return ""


def _other_payments(a: Task, b: Task) -> str:
    """Name the measure, or else the absorbing reward, that differs where steps do not; empty where none does."""
    if a.process.measures.keys() != b.process.measures.keys():
        return "it has other measures"
    paying = []
    for name, measure in a.process.measures.items():
        pair = (a.with_process(reward=measure), b.with_process(reward=b.process.measures[name]))
        paying.append((f"the measure {name}", *pair))
    if pays_after_ends(a) or pays_after_ends(b):
        paying.append(("the absorbing reward", modify(a, "absorbing"), modify(b, "absorbing")))
    for name, one, other in paying:
        try:
            differs = first_difference(NamedSteps(one), NamedSteps(other)) is not None
        except (SpecError, Inexact, Refused):
            return f"{name} cannot be compared"
        if differs:
            return f"{name} is another one"
    return ""


# -- other names ------------------------------------------------------------------------------------------------------


def _renaming(one: NamedSteps, other: NamedSteps) -> str | None:
    """Search for a renaming of states and actions after which the tasks are the same, in words."""
    a = one.task
    b = other.task
    times = max(one.times, other.times)
    is_large = times * (len(one.names) + len(other.names)) > MOST_OUTCOMES
    if a.horizon != b.horizon or a.discount != b.discount or len(one.actions) != len(other.actions) or is_large:
        return None
    if a.mask or b.mask:
        return None
    n = len(one.names)
    labels: list[Hashable] = [0] * (n + len(other.names))
    if not (a.observation.is_state and b.observation.is_state):
        labels = [*one.observed(0), *other.observed(0)]
    orders = itertools.permutations(range(len(one.actions)))
    for order in itertools.islice(orders, MOST_RENAMINGS):
        if times == 1:
            classes = levels(_joined(one, other, order, 0), labels, a.horizon)[-1]
        else:
            backwards = (_joined(one, other, order, t) for t in reversed(range(times)))
            classes = classes_from(backwards, labels)
        if _merged(one.start, classes, 0) == _merged(other.start, classes, n):
            return _renamed(one, other, classes, order)
    return None


def _joined(one: NamedSteps, other: NamedSteps, order: Sequence[int], t: int) -> Rows:
    n = len(one.names)
    rows = list(one.rows(t))
    for by_action in other.rows(t):
        reordered = []
        for a in order:
            moved = {}
            for (to, reward, ends), p in by_action[a].items():
                moved[to + n, reward, ends] = p
            reordered.append(moved)
        rows.append(reordered)
    return rows


def _merged(start: Mapping[int, Fraction], classes: Sequence[int], shift: int) -> dict[int, Fraction]:
    by_class: dict[int, Fraction] = defaultdict(Fraction)
    for s, p in start.items():
        by_class[classes[s + shift]] += p
    return by_class


def _renamed(one: NamedSteps, other: NamedSteps, classes: Sequence[int], order: Sequence[int]) -> str:
    pairs = [(one.actions[a], other.actions[b]) for a, b in enumerate(order)]
    of_class = dict(zip(classes[len(one.names) :], other.names, strict=True))
    for s, name in enumerate(one.names):
        if classes[s] in of_class:
            pairs.append((name, of_class[classes[s]]))
    words = []
    for name, other_name in pairs:
        if name != other_name:
            words.append(f"{shown(name)} is {shown(other_name)}")
    if not words:
        return "only the order of the actions differs"
    return f"only names differ: {few(words, 6)}"


# -- other rewards ----------------------------------------------------------------------------------------------------


def _by_rewards(one: NamedSteps, other: NamedSteps, difference: FirstDifference) -> TaskRelation:
    """Compare rewards and optimal policies of tasks with the same states."""
    if one.index.keys() != other.index.keys() or one.actions != other.actions or one.task.horizon != other.task.horizon:
        return TaskRelation("different", "they differ in more than rewards", difference)
    where = np.array([other.index[name] for name in one.names])
    times = range(max(one.times, other.times))
    if difference.action is None or not all(_looks_alike(one, other, where, t) for t in times):
        words = "they start, end or are observed in another way, or other actions are legal"
        return TaskRelation("different", words, difference)
    solvers = (Solvers(one.model).of(), Solvers(other.model).of())
    returns = {"first": solvers[0].best().value, "second": solvers[1].best().value}
    size = (one.task.horizon or math.inf) * len(one.actions) * len(one.names)
    if size > MOST_VALUES:
        words = "they differ; without a horizon, or with many steps and states, policies are not compared"
        return TaskRelation("different", words, difference, returns)
    acting = _acting(one)
    if all(_moves(one, t) == _moves(other, t) for t in times):
        factor = _factor(_advantages(solvers, where, acting, is_random=True))
        if factor is not None:
            relation, words = _reward_words(one, other, where, float(factor))
            return TaskRelation(relation, words, difference, returns)
    if [set(where[states]) for states in acting] != list(map(set, _acting(other))):
        return TaskRelation("different", "other states are visited", difference, returns)
    pairs = _advantages(solvers, where, acting, is_random=False)
    if all(((mine >= -EQUAL) == (theirs >= -EQUAL)).all() for mine, theirs in pairs):
        words = "in every state and at every time, the same actions are optimal"
        return TaskRelation("same optimal policy", words, difference, returns)
    return TaskRelation("different", "other actions are optimal", difference, returns)


def _reward_words(one: NamedSteps, other: NamedSteps, where: Array, factor: float) -> tuple[Relation, str]:
    times = range(max(one.times, other.times))
    scale = ""
    if abs(factor - 1) > EQUAL:
        scale = f" times {decimal(factor, 9)}"
    if not all(_is_scaled(one, other, where, t, factor, EQUAL) for t in times):
        return "shaped reward", f"the reward is the same{scale}, shaped by a potential; the same actions are optimal"
    if not all(_is_scaled(one, other, where, t, factor, 0.0) for t in times):
        scale += f" up to {EQUAL:g}"
    return "scaled reward", f"the expected reward is the same{scale}"


def _looks_alike(one: NamedSteps, other: NamedSteps, where: Array, t: int) -> bool:
    seen = other.observed(t)
    return one.observed(t) == [seen[s] for s in where]


def _acting(x: NamedSteps) -> list[Array]:
    return [np.flatnonzero(level) for _, level in x.model.levels()]


def _moves(x: NamedSteps, t: int) -> dict[Hashable, dict[Hashable, Fraction]]:
    moves: dict[Hashable, dict[Hashable, Fraction]] = {}
    for s in np.flatnonzero(x.model.acting).tolist():
        for a in range(len(x.actions)):
            merged: dict[Hashable, Fraction] = defaultdict(Fraction)
            for (name, _, ends), p in x.named(t, s, a).items():
                merged[name, ends] += p
            moves[x.names[s], a] = merged
    return moves


def _advantages(
    solvers: Sequence[Solver], where: Array, acting: Sequence[Array], is_random: bool
) -> Iterator[tuple[Array, Array]]:
    first = _plan(solvers[0].numbers, is_random)
    second = _plan(solvers[1].numbers, is_random)
    for (t, q, v), (_, their_q, their_v) in zip(first, second, strict=True):
        if t < len(acting):
            ours = _plain(q) - _plain(v)
            theirs = _plain(their_q) - _plain(their_v)
            yield ours[:, acting[t]], theirs[:, where[acting[t]]]


def _plan(n: Any, is_random: bool) -> Iterator[tuple[int, Any, Any]]:
    def choose(t: int, q: Any) -> Any:
        if is_random:
            return n.follow(n.uniform, q)
        return n.top(q)

    return backward(n.backup, choose, n.zero(), n.horizon)


def _plain(x: Scaled | Bound) -> Array:
    if isinstance(x, Bound):
        return x.value
    return x.fractions()


def _factor(pairs: Iterable[tuple[Array, Array]]) -> Any:
    """Positive number that turns first arrays into second ones; None where there is none, 1 where all are 0."""
    factor: Any = None
    for mine, theirs in pairs:
        largest_value = max(abs(mine).max(initial=0), abs(theirs).max(initial=0))
        size = max(EQUAL, EQUAL * float(largest_value))
        largest = np.unravel_index(int(abs(mine).argmax()), mine.shape)
        if factor is None and abs(mine[largest]) > size:
            factor = theirs[largest] / mine[largest]
        if (factor is not None and factor <= 0) or (abs(theirs - (factor or 0) * mine) > size).any():
            return None
    if factor is None:
        return 1
    return factor


def _is_scaled(one: NamedSteps, other: NamedSteps, where: Array, t: int, factor: float, within: float) -> bool:
    shape = (len(one.actions), len(one.names))
    ours = one.model.step(t).R.reshape(shape)[:, one.model.acting]
    theirs = other.model.step(t).R.reshape(shape)[:, where[one.model.acting]]
    return bool(np.allclose(theirs, factor * ours, rtol=within, atol=within))


# -- tasks that are not finite ----------------------------------------------------------------------------------------


def _by_episodes(a: Task, b: Task, reason: str) -> TaskRelation:
    declared = attrgetter("name", "type", "low", "high")
    if list(map(declared, (*a.state, *a.action))) != list(map(declared, (*b.state, *b.action))):
        return TaskRelation("different", f"states or actions have other components or bounds; {reason}")
    if (a.horizon, a.discount) != (b.horizon, b.discount):
        return TaskRelation("different", f"the horizon or the discount is another one; {reason}")
    if not is_bounded(a):
        return TaskRelation("no difference found", f"nothing was compared, since actions have no bounds; {reason}")
    spaces = _other_spaces(a, b)
    if spaces:
        return TaskRelation("different", f"{spaces}; {reason}")
    watched = not (a.observation.is_random or b.observation.is_random)
    if not watched:
        reason += "; observations are drawn, and were not compared"
    one = Rollout(a, LANES)
    other = Rollout(b, LANES)
    state = one.start()
    other_state = other.start()
    seen = [_stacked(a, state, 0, watched), _stacked(b, other_state, 0, watched)]
    alive = np.ones(LANES, np.bool_)
    choose = at_random(a)
    rng = np.random.default_rng(0)
    actions: list[Mapping[str, Array]] = []
    steps = min(a.horizon or MOST_STEPS, MOST_STEPS)
    for t in range(steps + 1):
        wrong = np.flatnonzero(alive & (seen[0] != seen[1]).any(axis=0))
        if len(wrong):
            return _parted(a, actions, seen, int(wrong[0]), reason)
        if t == steps or not alive.any():
            break
        actions.append(choose(state, t, rng))
        step = one.step(state, actions[-1], t)
        other_step = other.step(other_state, actions[-1], t)
        state = step.state
        other_state = other_step.state
        seen = [
            _stacked(a, state, t + 1, watched, step.reward, step.terminal),
            _stacked(b, other_state, t + 1, watched, other_step.reward, other_step.terminal),
        ]
        alive &= ~step.terminal.astype(np.bool_)
    words = f"{LANES} episodes of random actions with the same random words are the same for {t} steps; {reason}"
    return TaskRelation("no difference found", words)


def _parted(
    task: Task, actions: Sequence[Mapping[str, Array]], seen: Sequence[Array], lane: int, reason: str
) -> TaskRelation:
    path = tuple(_taken(action, lane) for action in actions)
    values = [f"state, observation, reward, end: {_numbers(each[:, lane])}" for each in seen]
    drawn = ""
    if task.process.reset_draws or task.process.step_draws:
        drawn = "; they draw, so that other random words may explain it"
    words = f"episodes with the same random words part{drawn}; {reason}"
    return TaskRelation("different", words, FirstDifference(path, len(actions), None, None, *values))


def _taken(action: Mapping[str, Array], lane: int) -> str:
    return ", ".join(f"{name} = {_numbers(value[..., lane])}" for name, value in action.items())


def _stacked(task: Task, state: State, t: int, watched: bool, *others: Array) -> Array:
    parts = [*state.values(), *others]
    if watched:
        parts += evaluate(task.observation.nodes, reads_of(state, {}, t))
    rows = []
    for value in parts:
        lanes = np.broadcast_to(value, (*value.shape[:-1], LANES))
        rows.append(lanes.reshape(-1, LANES).astype(float))
    return np.vstack(rows)


def _numbers(values: Array) -> str:
    texts = []
    for value in np.ravel(values)[:8]:
        texts.append(decimal(float(value), 6))
    if len(texts) == 1:
        return texts[0]
    if np.size(values) > 8:
        texts.append("...")
    return f"[{', '.join(texts)}]"
