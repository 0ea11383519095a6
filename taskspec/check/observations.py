"""Warnings about observations that show too much or too little, and about symmetries and abstractions without use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.check.context import Doubt, LintContext
from taskspec.check.names import mentioned
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Const, Node, Read, Role, draws, reads
from taskspec.lang.types import Kind
from taskspec.lang.variates import WordLayout, batch_sampler
from taskspec.model.model import Model
from taskspec.model.space import plain, words
from taskspec.modifiers import modify
from taskspec.rollout.rollout import Choose, State, by_expert, reads_of
from taskspec.rollout.simulate import simulate
from taskspec.scores.returns import normalised
from taskspec.solve import solve
from taskspec.task.task import Component, Task


def leak(context: LintContext) -> Iterator[Doubt]:
    """Yield the reward is written into the next observation."""
    task = context.task
    if task.observation.is_state:
        return
    reward = _bare(task.reward)
    if draws([reward]):
        return  # what chance paid can only be known by being shown
    for c, node in zip(task.observation.components, task.next_observation, strict=True):
        if _bare(node) is reward and reads([node]):
            place = task.surface.sections["observation"].get(c.name)
            yield Doubt(place and place.place, f"'{c.name}' is the reward of the step before")


def _bare(node: Node) -> Node:
    while isinstance(node, Apply) and node.op in ("to_real", "to_int"):
        node = node.args[0]
    return node


def hidden_goal(context: LintContext) -> Iterator[Doubt]:
    """First states that look the same and have no best action in common."""
    model = context.model
    task = context.task
    if model is None or task.observation.is_state:
        return
    first = np.flatnonzero(model.start > 0)
    seen = _first_looks(model, first)
    if seen is None or len(np.unique(seen, axis=0)) == len(first):
        return
    if context.results.optimal is None:
        return
    good = solve.first_choices(model)[:, first]
    _, group = np.unique(seen, axis=0, return_inverse=True)
    group = group.reshape(-1)
    for number in range(int(group.max()) + 1):
        members = np.flatnonzero(group == number)
        if not good[:, members].all(axis=1).any():
            one, other = (model.state_name(int(first[m])) for m in _conflict(good, members))
            message = f"episodes begin in {one} and in {other}; both look the same to the agent, and no action is best in both"
            yield Doubt(context.merged.span(("observation",)), message)
            return


def _conflict(good: Array, members: Array) -> tuple[int, int]:
    """Return two members without a common best action, or else the first two."""
    for i, a in enumerate(members):
        for b in members[i + 1 :]:
            if not (good[:, a] & good[:, b]).any():
                return int(a), int(b)
    return int(members[0]), int(members[1])


def _first_looks(model: Model, first: Array) -> Array | None:
    """Return the observations of first states (N, elements); None if they have noise on the state."""
    rows = []
    given = {k: v[..., first] if v.shape[-1] > 1 else v for k, v in model.reads(0).items()}
    for node in model.task.observation.nodes:
        if draws([node]):
            if reads([node]):
                return None
            continue  # noise alone carries no information
        (value,) = evaluate([node], given)
        rows.append(np.broadcast_to(value, (*value.shape[:-1], len(first))).reshape(-1, len(first)))
    return np.concatenate(rows).T.astype(np.float64) if rows else np.zeros((len(first), 1))


# -- what is seen of the state --------------------------------------------------------------------


def constant(context: LintContext) -> Iterator[Doubt]:
    """Yield a part of the observation that is always the same."""
    for c, node in _shown(context):
        value = _only_value(node, context.model)
        if value is not None:
            yield Doubt(
                context.key("observation", c.name), f"'{c.name}' is {words(plain(c, value))} in every observation"
            )


def duplicate(context: LintContext) -> Iterator[Doubt]:
    """Yield two parts of the observation that show the same."""
    known: dict[object, str] = {}
    for c, node in _shown(context):
        values = _values(node, context.model)
        if isinstance(_bare(node), Const) or (values is not None and _is_constant(values)):
            continue
        key = id(_bare(node)) if values is None else (values.shape, values.astype(np.float64).tobytes())
        first = known.setdefault(key, c.name)
        if first != c.name:
            yield Doubt(context.key("observation", c.name), f"'{c.name}' is the same as '{first}'")


def hidden(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the state that the reward depends on and the observation says nothing about."""
    task = context.task
    if task.observation.is_state or "W509" in context.codes:
        return
    shown = mentioned(task, "observation")
    paid = mentioned(task, "reward")
    for c in task.state:
        if c.name in paid and c.name not in shown and c.low != c.high and _varies(context, c):
            message = f"the reward depends on '{c.name}', which the observation does not show"
            yield Doubt(context.key("observation"), message)


def _varies(context: LintContext, c: Component) -> bool:
    """Return whether a component of the state may have several values in states in which episodes act."""
    model = context.model
    if model is None or model.task is not context.task or not model.acting.any():
        return True
    values = model.states.decode(model.codes[model.acting])[Role.STATE, c.name]
    return bool((values != values[..., :1]).any())


def _shown(context: LintContext) -> list[tuple[Component, Node]]:
    """Return the observation as written in the spec, without parts that have no elements."""
    seen = context.task.observation
    return [] if seen.is_state else [(c, n) for c, n in zip(seen.components, seen.nodes, strict=True) if c.type.size]


def _only_value(node: Node, model: Model | None) -> Array | None:
    """Return the value of a node that has no other in states that episodes enter, or None."""
    if isinstance(node, Const):
        return np.asarray(evaluate([node], {})[0][..., 0])
    values = _values(node, model)
    return values[..., 0] if values is not None and _is_constant(values) else None


def _values(node: Node, model: Model | None) -> Array | None:
    """Return the values (..., N) of a node in all states that episodes enter; None if some are not known."""
    if model is None or draws([node]) or (Role.TIME, "t") in reads([node]):
        return None
    entered = {k: v[..., model.entered] if v.shape[-1] > 1 else v for k, v in model.reads(0).items()}
    (values,) = evaluate([node], entered)
    return values


def _is_constant(values: Array) -> bool:
    return bool((values == values[..., :1]).all())


# -- symmetries -----------------------------------------------------------------------------------

SOLVED = 0.9
"""The score from which a twin counts as solved."""
EPISODES = 200


def idle_symmetry(context: LintContext) -> Iterator[Doubt]:
    """Yield the expert of the task as printed does in a twin about as well as in the task."""
    task = context.task
    places = dict(_places(task))
    if not task.symmetries or not isinstance(task.expert, tuple) or task.memory is not None or task.modifiers:
        return
    if {name for role, name in reads(task.expert) if role is Role.STATE} - places.keys():
        return  # the expert knows more than it sees
    expert, random = (context.results.sample(which, EPISODES) for which in ("expert", "random"))
    for symmetry in task.symmetries if expert is not None and random is not None else ():
        try:
            twin = modify(task, {"symmetry": symmetry.name})
            found = float(simulate(twin, _as_printed(task, twin, places), EPISODES).mean())
        except SpecError:
            continue  # it is no symmetry, and reported as that
        assert expert is not None and random is not None
        score = normalised(found, random.value, expert.value, None)
        if score >= SOLVED:
            message = f"in the twin by '{symmetry.name}' the expert of the task as it is printed scores {score:.2f}"
            hint = (
                "leave out the map of the action, or the other one"
                if symmetry.observation and symmetry.action
                else None
            )
            yield Doubt(context.key("symmetries", symmetry.name), message, hint)


def _places(task: Task) -> Iterator[tuple[str, tuple[int, Component]]]:
    """Yield the positions of components of the state in the observation as one vector."""
    state = {c.name: c for c in task.state}
    at = 0
    for c, node in zip(task.observation.components, task.observation.nodes, strict=True):
        shown = _bare(node)
        if isinstance(shown, Read) and shown.role is Role.STATE:
            yield shown.name, (at, state[shown.name])
        at += c.type.size


def _as_printed(task: Task, twin: Task, places: Mapping[str, tuple[int, Component]]) -> Choose:
    """Return the expert of a task, acting on observations of the twin as if they were those of the task."""
    nodes = twin.observation.nodes
    expert = by_expert(task)
    layout = WordLayout.of(nodes)

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        words = rng.integers(0, 2**32, (layout.count, lanes), dtype=np.uint32)
        values = evaluate(nodes, reads_of(state, {}, t), batch_sampler(layout, words))
        rows = np.concatenate([np.broadcast_to(v, (*v.shape[:-1], lanes)).reshape(-1, lanes) for v in values])
        needed = max(at + c.type.size for at, c in places.values())
        rows = np.concatenate([rows, np.zeros((max(0, needed - len(rows)), lanes))])  # where a twin shows less
        return expert({n: _value(c, rows[at : at + c.type.size]) for n, (at, c) in places.items()}, t, rng)

    return choose


def _value(c: Component, rows: Array) -> Array:
    """Return elements (size, lanes) as a value of a component, moved into its range."""
    lanes = rows.shape[-1]
    if c.type.kind is not Kind.REAL:
        low, high = (np.array(ends).reshape(-1, 1) for ends in (c.low, c.high))
        rows = np.rint(np.clip(rows, low, high)).astype(np.bool_ if c.type.kind is Kind.BOOL else np.int64)
    return rows.reshape(*c.type.shape, lanes)


# -- abstractions ---------------------------------------------------------------------------------


def infinite_abstraction(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the stand-in that has infinitely many values, so that there is no exact model of it."""
    found = context.results.abstraction
    for c in () if found is None else found.stand_in.state:
        if not c.is_finite:
            message = f"'{c.name}' has infinitely many values, so the abstraction gives no exact results"
            yield Doubt(context.key("abstraction", "state", c.name), message, "declare an int with `low` and `high`")
