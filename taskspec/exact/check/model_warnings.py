"""Warnings about states, rewards, actions and experts: what episodes can do, mostly by the exact model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.base.named import all_names
from taskspec.exact.check.spec_warnings import SAME, Doubt, LintContext
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model, differs
from taskspec.exact.model.space import plain, words
from taskspec.exact.rollout.rollout import at_random, is_bounded
from taskspec.exact.rules.claim_verdicts import state_left
from taskspec.exact.scores.difficulty import pomdp_bounds
from taskspec.exact.scores.returns import Results, Return
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.types import Role
from taskspec.language.task.build import build
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.parts import Component, Soft, by_name
from taskspec.language.task.questions import components_followed, components_read, is_random
from taskspec.language.task.task import Task

LONGER = 1000  # steps beyond the horizon that are searched for other rewards
FEW = 32  # values of an action up to which all pairs are compared
ROUNDING = 1e-12


def unreachable(context: LintContext) -> Iterator[Doubt]:
    """Yield values of a component that occur in no episode, however long, of this task or of one that shares its roles."""
    model = context.lasting_model
    is_own = model.task is context.task
    section: tuple[str, ...] = ("abstraction", "state")
    models = [model]
    if is_own:
        section = ("state",)
        models += _partners(context.task)
    entered = [m.states.decode(m.codes[m.connected]) for m in models]
    for c in model.task.state:
        columns = []
        for values in entered:
            value = values[Role.STATE, c.name]
            columns.append(value.reshape(c.type.size, value.shape[-1]))
        seen = np.concatenate(columns, 1)
        missing = []
        if c.type.is_scalar or not is_own:  # on a map, the outer cells are often walls
            missing = _missing_values(c, seen)
        if missing:
            values_in_words = ", ".join(missing[:6]) + ", ..." * (len(missing) > 6)
            subject = f"{c.name} = {values_in_words}"
            if not c.type.is_scalar:
                subject = f"an element {values_in_words} in {c.name}"
            yield Doubt(context.key(*section, c.name), f"no episode visits a state with {subject}")


def _missing_values(c: Component, seen: Array) -> list[str]:
    """Values that a component never has, in words; for a vector only those at the ends of its range."""
    if c.most - c.least >= 100_000 or not seen.size:
        return []
    every = np.arange(int(c.least), int(c.most) + 1)
    if not c.type.is_scalar:
        if len(set(c.low)) > 1 or len(set(c.high)) > 1:
            return []
        every = every[(every < seen.min()) | (every > seen.max())]
    missing = np.setdiff1d(every, seen.astype(np.int64))
    return [words(plain(c, np.asarray(value))) for value in missing[:7]]


def _partners(task: Task) -> Iterator[Model]:
    roles = task.spec.roles
    if roles is None:
        return
    given = {p.name: p.value for p in task.parameters if p.value != p.default}
    for variant in dict.fromkeys((roles.expert, roles.learner)):
        if variant in (task.name, task.source.variant):
            continue
        try:
            yield extract(build(task.source.document, str(variant), given, task.source.suite), reachable=False)
        except SpecError:
            continue


def unread(context: LintContext) -> Iterator[Doubt]:
    """Yield a component on which neither rewards nor ends depend, which is not shown, or is drawn all the same."""
    task = context.task
    is_state = task.observation.is_state
    nexts = by_name(task.state, task.process.next)
    paid = (task.process.reward, task.process.terminal, *task.process.measures.values())
    used = components_followed(paid, nexts) | components_followed(task.mask, nexts, of_step=False)
    if not is_state:
        used |= components_followed(task.observation.nodes, nexts)
    for c, first, following in zip(task.state, task.process.initial, task.process.next, strict=True):
        if c.name in used or c.low == c.high:
            continue
        if not is_state:
            message = f"neither rewards nor ends depend on '{c.name}', and it is not observed"
            yield Doubt(context.key("state", c.name), message)
        elif is_random([first, following]):
            message = f"'{c.name}' is drawn, but neither rewards nor endings depend on it"
            yield Doubt(context.key("state", c.name), message)


def forgotten(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the expert's memory that no action of it depends on."""
    task = context.task
    memory = task.annotations.memory
    if memory is None:
        return
    nexts = {}
    for c, node in zip(memory.components, memory.next, strict=True):
        if c.type.size:
            nexts[c.name] = node
    used = components_followed(task.annotations.expert_nodes, nexts, of_step=False)
    for name in all_names(memory.declared):
        if name in nexts and name not in used:
            yield Doubt(context.key("memory", name), f"no action of the expert depends on '{name}'")


def later_rewards(context: LintContext) -> Iterator[Doubt]:
    """Yield the horizon where it ends episodes before rewards differ."""
    later = _later_reward(context)
    if later is not None and context.paid is not None:
        value = words(context.paid[0])
        message = f"within {context.task.horizon} steps every reward is {value}; longer episodes have others"
        hint = f"the first of them is paid in step {later}"
        yield Doubt(context.merged.span(("horizon",)), message, hint)


def same_reward(context: LintContext) -> Iterator[Doubt]:
    """Yield the reward if it is always the same, however long the episode."""
    if context.is_constant and context.paid is not None and _later_reward(context) is None:
        message = f"every possible step has reward {words(context.paid[0])}"
        yield Doubt(context.merged.span(("reward",)), message, state_left(context.task))


def _later_reward(context: LintContext) -> int | None:
    """Return the first step in which a longer episode could have another reward, where all are the same up to the horizon."""
    known = context.results.known_model
    if not context.is_constant or context.paid is None or known.horizon is None or known.is_timed:
        return None
    model = context.lasting_model
    level = model.start > 0
    seen = np.zeros(model.n_states, np.bool_)
    rewards = model.step(0).R.reshape(model.n_actions, -1)
    for t in range(known.horizon + LONGER):
        if not (level & ~seen).any():
            return None
        if np.ptp(np.append(rewards[:, level].reshape(-1), context.paid[0])) > SAME:
            return t + 1
        seen |= level
        level = model.successors(model.step(0).P, level)
    return None


def indifferent(context: LintContext) -> Iterator[Doubt]:
    """Yield the reward if random actions earn the best return."""
    if context.is_constant or context.results.optimal is None:
        return
    optimal = context.results.optimal
    random = context.results.random  # simulated only if the best return is known
    if random is not None and abs(optimal.value - random.value) <= SAME * max(1.0, abs(optimal.value)):
        message = f"random actions are as good as the best: both return {words(optimal.value)}"
        yield Doubt(context.merged.span(("reward",)), message, state_left(context.task))


def inert(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the action that changes nothing."""
    task = context.task
    read = components_read(task.process.step_roots, Role.ACTION)
    for c in task.action:
        if c.is_finite and c.counts == (1,) * c.type.size:
            continue
        if c.name not in read:
            yield Doubt(context.key("action", c.name), f"the action '{c.name}' is read nowhere")
            continue
        model = context.results.known_model
        if model.task is task and model.acting.any() and differs(model, c.name)[0] is False:
            message = f"the action '{c.name}' changes neither the next state nor the reward, in any state"
            yield Doubt(context.key("action", c.name), message)


def illegal(context: LintContext) -> Iterator[Doubt]:
    """Yield the condition for legal actions where a policy that ignores it can earn more."""
    task = context.task
    if not task.mask:
        return
    best = _best(context.results)
    free = _best(Results(with_all_actions(task), limit=context.results.limit))
    if best is not None and free is not None and free.value > best.value + SAME * max(1.0, abs(best.value)):
        message = f"illegal actions pay: the best policy returns {words(free.value)}, and {words(best.value)} with legal actions"
        yield Doubt(context.key("legal"), message, "let them change nothing, or end the episode, or cost something")


def _best(results: Results) -> Return | None:
    """Return the best return of an exact model, which has to be there; None where it is not known to be finite."""
    _ = results.known_model
    return results.optimal


def expert(context: LintContext) -> Iterator[Doubt]:
    """Yield an expert below the optimum, or no better than random actions where that is all there is to compare with."""
    results = context.results
    performance = results.expert
    task = context.task
    annotations = task.annotations
    if performance is None or isinstance(annotations.expert, Soft):
        return
    if any(_compares_expert(claim.expr) for claim in annotations.claims):
        return
    value = f"the expert returns {performance.value:.10g}"
    optimal = results.optimal
    if optimal is None:
        if is_bounded(task):
            random = results.random
        else:
            random = results.estimated(at_random(task), 200)
        if random is not None and random.value >= performance.value:
            message = f"{value} on average, and random actions {random.value:.10g}"
            notes = [f"from {performance.episodes:,} and {random.episodes:,} episodes"]
            yield Doubt(context.key("expert"), message, None, notes)
        return
    best = optimal.value
    whose = ""
    if task.annotations.memory is not None and (seen := pomdp_bounds(results)) is not None:
        whose = ", which knows the state"
        if seen.remembering is not None:
            best = seen.remembering.value
            whose = " of those who remember what they see"
    gap = best - performance.value
    if gap > SAME * max(1.0, abs(best)):
        yield Doubt(context.key("expert"), f"{value}, which is {gap:.6g} below the optimum of {best:.10g}{whose}")


def _compares_expert(expr: s.Expr) -> bool:
    if isinstance(expr, s.Logical):
        return any(map(_compares_expert, expr.operands))
    if not isinstance(expr, s.Compare):
        return False
    names = {n.id for n in s.names(expr) if isinstance(n, s.Name)}
    return {"expert_return", "optimal_return"} <= names and any(op in ("<", ">", "!=") for op, _ in expr.rest)
