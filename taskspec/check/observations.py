"""Observations that show too much or too little."""

from __future__ import annotations

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, Span
from taskspec.check.case import Linted
from taskspec.check.names import mentioned
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Const, Node, Role, draws, reads
from taskspec.model.model import Model
from taskspec.model.space import plain, words
from taskspec.solve import solve
from taskspec.task.task import Component


def leak(case: Linted, collector: Collector) -> None:
    """W508: the reward is written into the next observation."""
    task = case.task
    if task.observation.is_state:
        return
    reward = _bare(task.reward)
    if draws([reward]):
        return  # what chance paid can only be known by being shown
    for c, node in zip(task.observation.components, task.next_observation, strict=True):
        if _bare(node) is reward and reads([node]):
            place = task.surface.sections["observation"].get(c.name)
            collector.add("W508", place and place.place, f"'{c.name}' is the reward of the step before")


def _bare(node: Node) -> Node:
    while isinstance(node, Apply) and node.op in ("to_real", "to_int"):
        node = node.args[0]
    return node


def hidden_goal(case: Linted, collector: Collector) -> None:
    """W509: first states that look the same and have no best action in common."""
    model, task = case.model, case.task
    if model is None or task.observation.is_state:
        return
    first = np.flatnonzero(model.start > 0)
    seen = _first_looks(model, first)
    if seen is None or len(np.unique(seen, axis=0)) == len(first):
        return
    if case.results.optimal is None:
        return
    good = solve.first_choices(model)[:, first]
    _, group = np.unique(seen, axis=0, return_inverse=True)
    group = group.reshape(-1)
    for number in range(int(group.max()) + 1):
        members = np.flatnonzero(group == number)
        if not good[:, members].all(axis=1).any():
            one, other = (model.state_name(int(first[m])) for m in _conflict(good, members))
            message = f"episodes begin in {one} and in {other}; both look the same to the agent, and no action is best in both"
            collector.add("W509", case.merged.span(("observation",)), message)
            return


def _conflict(good: Array, members: Array) -> tuple[int, int]:
    """Two members without a best action in common, or else the first two."""
    for i, a in enumerate(members):
        for b in members[i + 1 :]:
            if not (good[:, a] & good[:, b]).any():
                return int(a), int(b)
    return int(members[0]), int(members[1])


def _first_looks(model: Model, first: Array) -> Array | None:
    """What is seen of the first states (N, elements); None where noise on the state hides it."""
    rows = []
    given = {k: v[..., first] if v.shape[-1] > 1 else v for k, v in model.reads(0).items()}
    for node in model.task.observation.nodes:
        if draws([node]):
            if reads([node]):
                return None
            continue  # noise alone tells nothing
        (value,) = evaluate([node], given)
        rows.append(np.broadcast_to(value, (*value.shape[:-1], len(first))).reshape(-1, len(first)))
    return np.concatenate(rows).T.astype(np.float64) if rows else np.zeros((len(first), 1))


# -- what is seen of the state --------------------------------------------------------------------


def constant(case: Linted, collector: Collector) -> None:
    """W516: a part of the observation that is always the same."""
    for c, node in _shown(case):
        value = _only_value(node, case.model)
        if value is not None:
            collector.add("W516", _place(case, c.name), f"'{c.name}' is {words(plain(c, value))} in every observation")


def duplicate(case: Linted, collector: Collector) -> None:
    """W517: two parts of the observation that show the same."""
    known: dict[object, str] = {}
    for c, node in _shown(case):
        values = _values(node, case.model)
        if isinstance(_bare(node), Const) or (values is not None and _is_constant(values)):
            continue
        key = id(_bare(node)) if values is None else (values.shape, values.astype(np.float64).tobytes())
        first = known.setdefault(key, c.name)
        if first != c.name:
            collector.add("W517", _place(case, c.name), f"'{c.name}' is the same as '{first}'")


def hidden(case: Linted, collector: Collector) -> None:
    """W518: a component of the state that the reward depends on and the observation says nothing about."""
    task = case.task
    if task.observation.is_state or any(d.code == "W509" for d in collector.diagnostics):
        return
    told, paid = mentioned(task, "observation"), mentioned(task, "reward")
    for c in task.state:
        if c.name in paid and c.name not in told and c.low != c.high and _varies(case, c):
            message = f"the reward depends on '{c.name}', which the observation does not show"
            collector.add("W518", case.key("observation"), message)


def _varies(case: Linted, c: Component) -> bool:
    """Whether a component of the state has several values where episodes act, as far as is known."""
    model = case.model
    if model is None or model.task is not case.task or not model.acting.any():
        return True
    values = model.states.decode(model.codes[model.acting])[Role.STATE, c.name]
    return bool((values != values[..., :1]).any())


def _shown(case: Linted) -> list[tuple[Component, Node]]:
    """What the spec itself says is observed, but for what has no elements."""
    seen = case.task.observation
    return [] if seen.is_state else [(c, n) for c, n in zip(seen.components, seen.nodes, strict=True) if c.type.size]


def _only_value(node: Node, model: Model | None) -> Array | None:
    """The value of a node that has no other, in states that episodes enter."""
    if isinstance(node, Const):
        return np.asarray(evaluate([node], {})[0][..., 0])
    values = _values(node, model)
    return values[..., 0] if values is not None and _is_constant(values) else None


def _values(node: Node, model: Model | None) -> Array | None:
    """The values of a node in all states that episodes enter, (..., N); None where these are not known, or not all."""
    if model is None or draws([node]) or (Role.TIME, "t") in reads([node]):
        return None
    entered = {k: v[..., model.entered] if v.shape[-1] > 1 else v for k, v in model.reads(0).items()}
    (values,) = evaluate([node], entered)
    return values


def _is_constant(values: Array) -> bool:
    return bool((values == values[..., :1]).all())


def _place(case: Linted, name: str) -> Span:
    return case.key("observation", name)
