"""Warnings about rewards, actions and experts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from taskspec.check.context import SAME, Doubt, LintContext
from taskspec.lang import syntax as s
from taskspec.lang.ir import Node, Read, Role, reads, rewrite, walk
from taskspec.model.model import Model
from taskspec.model.reach import differs, groups
from taskspec.model.space import shown, words
from taskspec.rollout.rollout import at_random, is_bounded
from taskspec.scores.partial_observability import pomdp_bounds
from taskspec.scores.returns import Return
from taskspec.task.task import Component, Soft, Task

# -- rewards --------------------------------------------------------------------------------------

LONGER = 1000
"""Steps beyond the horizon that are searched for other rewards."""


def later_rewards(context: LintContext) -> Iterator[Doubt]:
    """Yield the horizon ends episodes before rewards differ."""
    if not context.is_constant or context.paid is None:
        return
    value = words(context.paid[0])
    later = _later_reward(context, context.paid[0])
    if later is not None:
        message = f"within {context.task.horizon} steps every reward is {value}; longer episodes have others"
        hint = f"the first of them is paid in step {later}"
        yield Doubt(context.merged.span(("horizon",)), message, hint)


def same_reward(context: LintContext) -> Iterator[Doubt]:
    """Yield all rewards are the same, however long the episode."""
    if context.is_constant and context.paid is not None and _later_reward(context, context.paid[0]) is None:
        message = f"every possible step has reward {words(context.paid[0])}"
        yield Doubt(context.merged.span(("reward",)), message)


def _later_reward(context: LintContext, before: float) -> int | None:
    """Return the first step in which a longer episode could have another reward."""
    model = context.results.model
    if model is None or model.horizon is None or model.is_timed:
        return None
    level = model.start > 0
    seen = np.zeros(model.n_states, np.bool_)
    rewards = model.step(0).R.reshape(model.n_actions, -1)
    for t in range(model.horizon + LONGER):
        if not (level & ~seen).any():
            return None
        if np.ptp(np.append(rewards[:, level].reshape(-1), before)) > SAME:
            return t + 1
        seen |= level
        level = model.successors(model.step(0).P, level)
    return None


def indifferent(context: LintContext) -> Iterator[Doubt]:
    """Yield the best return is that of random actions."""
    if context.is_constant:
        return
    optimal = context.results.optimal
    random = None if optimal is None else context.results.random  # simulated only if the best return is known
    if optimal is None or random is None:
        return
    if abs(optimal.value - random.value) <= SAME * max(1.0, abs(optimal.value)):
        message = f"random actions are as good as the best: both return {words(optimal.value)}"
        yield Doubt(context.merged.span(("reward",)), message)


# -- actions --------------------------------------------------------------------------------------


def inert(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the action that changes nothing."""
    read = reads((*context.task.next, context.task.reward, context.task.terminal))
    for c in context.task.action:
        if c.is_finite and c.counts == (1,) * c.type.size:
            continue
        if (Role.ACTION, c.name) not in read:
            yield Doubt(context.key("action", c.name), f"the action '{c.name}' is read nowhere")
        elif context.model is not None and context.model.acting.any() and differs(context.model, c.name)[0] is False:
            message = f"the action '{c.name}' changes neither the next state nor the reward, in any state"
            yield Doubt(context.key("action", c.name), message)


FEW = 32
"""Values of an action up to which all pairs are compared."""
MOST = 200_000
"""Operations that are worked out, once for each value."""
ROUNDING = 1e-12


def twins(context: LintContext) -> Iterator[Doubt]:
    """Yield two values of an action that do the same in every state."""
    for c in context.task.action:
        count = c.counts[0] if c.is_finite and c.type.is_scalar else 0
        if not 2 < count <= FEW:
            continue  # of two values that are the same, W505 speaks
        if context.model is None and len(list(walk(_step(context.task)))) * count > MOST:
            continue
        same = _by_model(context.model, c) if context.model is not None else _by_form(context.task, c)
        found = _classes(count, same)
        for alike in found if len(found) > 1 else ():  # if all do the same, so W505 says
            names = [shown(c, np.asarray(int(c.low[0]) + number)) for number in alike]
            if len(names) > 1:
                message = f"{c.name} = {', '.join(names[:-1])} and {names[-1]} do the same in every state"
                yield Doubt(context.key("action", c.name), message)


def _classes(count: int, same: Callable[[int, int], bool]) -> list[list[int]]:
    """Return the numbers below `count`, those that are the same together."""
    found: list[list[int]] = []
    for number in range(count):
        known = next((alike for alike in found if same(alike[0], number)), None)
        if known is None:
            found.append([number])
        else:
            known.append(number)
    return found


def _step(task: Task) -> tuple[Node, ...]:
    return (*task.next, task.reward, task.terminal)


def _by_form(task: Task, c: Component) -> Callable[[int, int], bool]:
    """Compares what is left of a step once the value is known: equal forms are one node."""
    b = task.new_builder()
    roots = _step(task)

    def chosen(value: int) -> tuple[Node, ...]:
        def leaf(node: Node) -> Node | None:
            is_it = isinstance(node, Read) and (node.role, node.name) == (Role.ACTION, c.name)
            return b.scalar(value) if is_it else None

        return rewrite(roots, leaf, b.remake)

    forms = [chosen(int(c.low[0]) + number) for number in range(c.counts[0])]
    return lambda one, other: all(a is b for a, b in zip(forms[one], forms[other], strict=True))


def _by_model(model: Model, c: Component) -> Callable[[int, int], bool]:
    """Compares all that the values do in the states in which episodes act."""
    table = groups(model, c.name)
    acting = np.flatnonzero(model.acting)

    def rows(number: int) -> Any:
        return (table[:, number][:, None] * model.n_states + acting[None, :]).reshape(-1)

    def same(one: int, other: int) -> bool:
        a = rows(one)
        b = rows(other)
        return all(_is_zero(found) for step in _steps(model) for found in _gaps(step, a, b))

    return same


def _steps(model: Model) -> list[Any]:
    return list({id(step): step for step in model.steps}.values())


def _gaps(step: Any, a: Any, b: Any) -> Iterator[Any]:
    yield step.R[a] - step.R[b]
    for matrix in (step.P, step.P_end):
        if matrix is not None:
            yield (matrix[a] - matrix[b]).data


def _is_zero(found: Any) -> bool:
    return not len(found) or bool(np.abs(found).max() <= ROUNDING)


# -- experts --------------------------------------------------------------------------------------


def expert(context: LintContext) -> Iterator[Doubt]:
    """Yield an expert below the optimum, or no better than random actions where that is all there is to compare with."""
    found = context.results.expert
    optimal = context.results.optimal
    if found is None or isinstance(context.task.expert, Soft) or _says_so(context.task):
        return
    if optimal is None:
        yield from _no_better(context, found)
        return
    best = optimal.value
    whose = ""
    if context.task.memory is not None and (seen := pomdp_bounds(context.results)) is not None:
        if seen.remembering is None:
            whose = ", which knows the state"
        else:
            best = seen.remembering.value
            whose = " of those who remember what they see"
    gap = best - found.value
    if gap > SAME * max(1.0, abs(best)):
        message = f"the expert returns {_shown(found)}, which is {gap:.6g} below the optimum of {best:.10g}{whose}"
        yield Doubt(context.key("expert"), message)


def _no_better(context: LintContext, found: Return) -> Iterator[Doubt]:
    """Compare an expert with random actions by simulation."""
    results = context.results
    random = results.random if is_bounded(context.task) else results.estimated(at_random(context.task), 200)
    if random is not None and random.value >= found.value:
        message = f"the expert returns {_shown(found)} on average, and random actions {_shown(random)}"
        notes = [f"from {found.episodes:,} and {random.episodes:,} episodes"]
        yield Doubt(context.key("expert"), message, None, notes)


def _shown(value: Return) -> str:
    return f"{value.value:.10g}"


def _says_so(task: Task) -> bool:
    return any(_compares_expert(claim.expr) for claim in task.claims)


def _compares_expert(expr: s.Expr) -> bool:
    if isinstance(expr, s.Logical):
        return any(_compares_expert(part) for part in expr.operands)
    if not isinstance(expr, s.Compare):
        return False
    names = {n.id for n in s.names(expr) if isinstance(n, s.Name)}
    return {"expert_return", "optimal_return"} <= names and any(op in ("<", ">", "!=") for op, _ in expr.rest)
