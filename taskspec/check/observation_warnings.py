"""Warnings about observations that show too much or too little, and about symmetries and abstractions without use."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.check.text_warnings import mentioned
from taskspec.check.warning_context import Doubt, LintContext
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Const, Node, Read, Role, draws, reads
from taskspec.lang.types import Kind
from taskspec.lang.variates import WordLayout, batch_sampler
from taskspec.model.model import Model
from taskspec.model.space import plain, words
from taskspec.model.transitions import picked
from taskspec.modifiers import modify
from taskspec.rollout.rollout import Choose, State, by_expert, reads_of, simulate
from taskspec.scores.returns import normalised
from taskspec.solve.plans import optimal_plan
from taskspec.task.parts import Component
from taskspec.task.task import Task


def leak(context: LintContext) -> Iterator[Doubt]:
    """Yield a part of the next observation that is the reward."""
    task = context.task
    if task.observation.is_state:
        return
    reward = _bare(task.process.reward)
    if draws([reward]):
        return  # what chance paid can only be known by being shown
    for c, node in zip(task.observation.components, task.next_observation, strict=True):
        if _bare(node) is reward and reads([node]):
            place = task.source.surface.sections["observation"].get(c.name)
            yield Doubt(place and place.place, f"'{c.name}' is the reward of the step before")


def _bare(node: Node) -> Node:
    while isinstance(node, Apply) and node.op in ("to_real", "to_int"):
        node = node.args[0]
    return node


def hidden_goal(context: LintContext) -> Iterator[Doubt]:
    """Yield the observation if first states look the same and have no best action in common."""
    model = context.model
    if model is None or context.task.observation.is_state:
        return
    first = np.flatnonzero(model.start > 0)
    seen = _first_observations(model, first)
    if seen is None or len(np.unique(seen, axis=0)) == len(first) or context.results.optimal is None:
        return
    best = optimal_plan(model)(0)[:, first] > 0
    _, groups = np.unique(seen, axis=0, return_inverse=True)
    for group in range(int(groups.max()) + 1):
        members = np.flatnonzero(groups.reshape(-1) == group)
        if not best[:, members].all(axis=1).any():
            pairs = itertools.combinations(members.tolist(), 2)
            apart = (pair for pair in pairs if not (best[:, pair[0]] & best[:, pair[1]]).any())
            one, other = (model.state_name(int(first[m])) for m in next(apart, members[:2].tolist()))
            message = f"episodes begin in {one} and in {other}; both look the same to the agent, and no action is best in both"
            yield Doubt(context.merged.span(("observation",)), message)
            return


def _first_observations(model: Model, first: Array) -> Array | None:
    """Return the observations of first states (N, elements); None if they have noise on the state."""
    rows = [np.zeros((1, len(first)))]
    given = picked(model.reads(0), first)
    for node in model.task.observation.nodes:
        if draws([node]) and reads([node]):
            return None
        if not draws([node]):  # noise alone carries no information
            (value,) = evaluate([node], given)
            rows.append(np.broadcast_to(value, (*value.shape[:-1], len(first))).reshape(-1, len(first)))
    return np.concatenate(rows).T.astype(np.float64)


def constant(context: LintContext) -> Iterator[Doubt]:
    """Yield a part of the observation that is always the same."""
    for c, node in _shown(context):
        values = _values(node, context.model)
        if values is not None and _is_constant(values):
            value = words(plain(c, values[..., 0]))
            yield Doubt(context.key("observation", c.name), f"'{c.name}' is {value} in every observation")


def duplicate(context: LintContext) -> Iterator[Doubt]:
    """Yield two parts of the observation that show the same."""
    known: dict[object, str] = {}
    for c, node in _shown(context):
        values = _values(node, context.model)
        key: object = id(_bare(node))
        if values is not None:
            if _is_constant(values):
                continue
            key = (values.shape, values.astype(np.float64).tobytes())
        first = known.setdefault(key, c.name)
        if first != c.name:
            yield Doubt(context.key("observation", c.name), f"'{c.name}' is the same as '{first}'")


def _shown(context: LintContext) -> list[tuple[Component, Node]]:
    """Return the observation as written in the spec, without parts that have no elements."""
    seen = context.task.observation
    if seen.is_state:
        return []
    return [(c, node) for c, node in zip(seen.components, seen.nodes, strict=True) if c.type.size]


def _values(node: Node, model: Model | None) -> Array | None:
    """Return the values (..., N) of a node in all states that episodes enter; None if some are not known."""
    if isinstance(_bare(node), Const):
        return evaluate([node], {})[0]
    if model is None or draws([node]) or (Role.TIME, "t") in reads([node]):
        return None
    return evaluate([node], picked(model.reads(0), model.entered))[0]


def _is_constant(values: Array) -> bool:
    return bool((values == values[..., :1]).all())


def hidden(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the state that the reward depends on and the observation says nothing about."""
    task = context.task
    model = context.model
    if task.observation.is_state or "W509" in context.codes:
        return
    known = {}
    if model is not None and model.acting.any():
        known = model.states.decode(model.codes[model.acting])
    paid = mentioned(task, "reward") - mentioned(task, "observation")
    for c in task.state:
        values = known.get((Role.STATE, c.name))
        varies = values is None or not _is_constant(values)
        if c.name in paid and c.low != c.high and varies:
            message = f"the reward depends on '{c.name}', which the observation does not show"
            yield Doubt(context.key("observation"), message)


SOLVED = 0.9
"""The score from which a twin counts as solved."""
EPISODES = 200


def idle_symmetry(context: LintContext) -> Iterator[Doubt]:
    """Yield a symmetry if the expert of the task as printed does in the twin about as well as in the task."""
    task = context.task
    if (
        not task.annotations.symmetries
        or not isinstance(task.annotations.expert, tuple)
        or task.annotations.memory is not None
        or task.modifiers
    ):
        return
    places = _places(task)
    if {name for role, name in reads(task.annotations.expert) if role is Role.STATE} - places.keys():
        return  # the expert knows more than it sees
    expert = context.results.sample("expert", EPISODES)
    random = context.results.sample("random", EPISODES)
    if expert is None or random is None:
        return
    for symmetry in task.annotations.symmetries:
        try:
            twin = modify(task, {"symmetry": symmetry.name})
            found = float(simulate(twin, _as_printed(task, twin, places), EPISODES).mean())
        except SpecError:
            continue  # it is no symmetry, and reported as that
        score = normalised(found, random.value, expert.value, None)
        if score >= SOLVED:
            message = f"in the twin by '{symmetry.name}' the expert of the task as it is printed scores {score:.2f}"
            hint = None
            if symmetry.observation and symmetry.action:
                hint = "leave out the map of the action, or the other one"
            yield Doubt(context.key("symmetries", symmetry.name), message, hint)


def _places(task: Task) -> dict[str, tuple[int, Component]]:
    """Return the positions of components of the state in the observation as one vector."""
    state = {c.name: c for c in task.state}
    found = {}
    at = 0
    for c, node in zip(task.observation.components, task.observation.nodes, strict=True):
        shown = _bare(node)
        if isinstance(shown, Read) and shown.role is Role.STATE:
            found[shown.name] = (at, state[shown.name])
        at += c.type.size
    return found


def _as_printed(task: Task, twin: Task, places: Mapping[str, tuple[int, Component]]) -> Choose:
    """Return the expert of a task, acting on observations of the twin as if they were those of the task."""
    nodes = twin.observation.nodes
    expert = by_expert(task)
    layout = WordLayout.of(nodes)
    needed = max(at + c.type.size for at, c in places.values())

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        words = rng.integers(0, 2**32, (layout.count, lanes), dtype=np.uint32)
        values = evaluate(nodes, reads_of(state, {}, t), batch_sampler(layout, words))
        rows = [np.broadcast_to(v, (*v.shape[:-1], lanes)).reshape(-1, lanes) for v in values]
        seen = np.concatenate([*rows, np.zeros((needed, lanes))])  # where a twin shows less
        believed = {}
        for name, (at, c) in places.items():
            value = seen[at : at + c.type.size]
            if c.type.kind is not Kind.REAL:  # it is moved into its range
                low = np.array(c.low).reshape(-1, 1)
                high = np.array(c.high).reshape(-1, 1)
                value = np.rint(np.clip(value, low, high)).astype(np.bool_ if c.type.kind is Kind.BOOL else np.int64)
            believed[name] = value.reshape(*c.type.shape, lanes)
        return expert(believed, t, rng)

    return choose


def infinite_abstraction(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the stand-in that has infinitely many values, so that there is no exact model of it."""
    found = context.results.abstraction
    if found is None:
        return
    for c in found.stand_in.state:
        if not c.is_finite:
            message = f"'{c.name}' has infinitely many values, so the abstraction gives no exact results"
            yield Doubt(context.key("abstraction", "state", c.name), message, "declare an int with `low` and `high`")
