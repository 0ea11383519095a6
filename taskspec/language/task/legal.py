"""Legal actions: the condition that a spec writes, and which actions it allows in given states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.language import draws
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.ir import Node, walk
from taskspec.language.expressions.scope import Poisoned
from taskspec.language.expressions.types import Kind, Role
from taskspec.language.task.context import Context
from taskspec.language.task.names import Names
from taskspec.language.task.spaces import action_layout
from taskspec.language.task.task import Task


def legal_condition(context: Context, names: Names) -> Node | None:
    """Read the condition for an action to be legal; None where all actions are, or it is broken (reported)."""
    if "legal" not in context.data:
        return None
    expr = context.exprs["legal"]
    is_single = action_layout(context.action, False).form == "discrete"
    if not is_single:
        message = "`legal` needs an action of one component with finitely many values"
        context.report_key("E214", ("legal",), message, "number the combinations, as one int or one choice")
    if context.data.get("abstraction"):
        context.report_key("E214", ("legal",), "`legal` cannot be combined with an `abstraction`")
    if expr is None or not is_single:
        return None
    try:
        node = context.checker.condition(expr, names.scope("legal"))
    except Poisoned:
        return None
    size = context.action[0].counts[0] * sum(1 for _ in walk([node]))
    most = limits().operations
    if size > most:
        message = (
            f"`legal` takes {count(size)} operations, as it is written out for every action; the limit is {most:,}"
        )
        context.report_key("E314", ("legal",), message, how_to_raise("operations", size))
    return node


def with_all_actions(task: Task) -> Task:
    """Make all actions legal, with the effect that the equations give."""
    if task.process.legal is None:
        return task
    source = replace(task.source, content_hash=f"{task.content_hash} with all actions")
    return replace(task.with_process(legal=None), source=source)


def action_mask(task: Task, states: Mapping[str, Array]) -> Array:
    """Legal actions in some states by component, (*shape, N): bool (n, N), for a task with `legal`."""
    lanes = next(iter(states.values())).shape[-1]
    (mask,) = evaluate(task.mask, {(Role.STATE, name): value for name, value in states.items()})
    return np.broadcast_to(mask, (*task.mask[0].type.shape, lanes))


def choices(task: Task, states: Mapping[str, Array]) -> Array:
    """Actions (n, N) that policies choose from: the legal ones; where there is none, all."""
    mask = action_mask(task, states)
    return mask | ~mask.any(axis=0)


def legal_at_random(task: Task, states: Mapping[str, Array], words: Array) -> dict[str, Array]:
    """Draw uniformly random legal actions by component, (N,), from random words, uint32 (N,)."""
    (c,) = task.action
    legal = choices(task, states)
    place = draws.indices(words, legal.sum(axis=0))
    index = (legal.cumsum(axis=0) > place).argmax(axis=0)
    if c.type.kind is Kind.BOOL:
        return {c.name: index.astype(np.bool_)}
    return {c.name: int(c.least) + index}


def restricted(probabilities: Array, legal: Array) -> Array:
    """Condition probabilities (..., A) on legal actions; uniform where no legal action was probable."""
    kept = np.where(legal, probabilities, 0.0)
    kept = np.where(kept.any(axis=-1, keepdims=True), kept, legal)
    return np.asarray(kept / kept.sum(axis=-1, keepdims=True))
