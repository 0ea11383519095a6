"""Warnings about observations that show too much or too little, and about abstractions without use."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from taskspec.base.arrays import Array
from taskspec.check.text_warnings import mentioned
from taskspec.check.warning_context import Doubt, LintContext
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Const, Node, Role, draws, reads
from taskspec.model.model import Model
from taskspec.model.space import plain, words
from taskspec.model.transitions import picked
from taskspec.solve.plans import optimal_plan
from taskspec.task.task import Component


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


def unproved_abstraction(context: LintContext) -> Iterator[Doubt]:
    """Yield an abstraction that gives no exact results, as it is infinite or cannot be proved."""
    found = context.results.abstraction
    if found is None:
        return
    for c in found.stand_in.state:
        if not c.is_finite:
            message = f"'{c.name}' has infinitely many values, so the abstraction gives no exact results"
            yield Doubt(context.key("abstraction", "state", c.name), message, "declare an int with `low` and `high`")
            return
    check = context.results.abstraction_check
    if check is not None and check.why_not is not None:
        message = f"the abstraction is not proved, so it gives no exact results: {check.why_not}"
        yield Doubt(context.key("abstraction"), message)
