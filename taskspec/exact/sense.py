"""Sense: warnings about sound tasks that can hardly be what their authors meant. One function per code."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector, Diagnostic, Span, SpecError
from taskspec.exact import solve
from taskspec.exact.extract import extract
from taskspec.exact.inert import differs
from taskspec.exact.model import Model
from taskspec.exact.names import unused
from taskspec.exact.returns import Results, Return
from taskspec.exact.rollout import sampled_actions
from taskspec.exact.space import plain, words
from taskspec.lang import syntax as s
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Apply, Node, Role, draws, reads
from taskspec.spec.build import build
from taskspec.spec.merge import Merged, merge
from taskspec.spec.task import Component, Soft, Task

Array = np.ndarray[Any, Any]
SAME = 1e-9
LONGER = 1000
CERTAIN = 0.9999
SMALL = 3_000_000


@dataclass(frozen=True)
class Case:
    """A task with what is known of it; `model` only where the task itself (not a stand-in) has one of moderate size."""

    task: Task
    results: Results

    @cached_property
    def model(self) -> Model | None:
        model = self.results.model
        return model if model is not None and model.task is self.task and model.entries <= SMALL else None

    @cached_property
    def merged(self) -> Merged:
        return merge(self.task.document, self.task.variant)

    def key(self, *path: str) -> Span:
        return self.merged.key_span(path)

    @cached_property
    def rewards(self) -> Array:
        """Expected rewards (N,) of everything that can be done in any episode."""
        model = self.results.model
        if model is None:
            return np.zeros(0)
        found = []
        for t, level in model.levels() if model.is_timed else [(0, model.acting)]:
            found.append(model.step(t).reward.reshape(model.n_actions, -1)[:, level].reshape(-1))
        return np.concatenate(found) if found else np.zeros(0)

    @property
    def is_constant(self) -> bool:
        """Whether every step pays the same, and it makes no difference how many there are."""
        paid, model = self.rewards, self.results.model
        if model is None or not len(paid) or np.ptp(paid) > SAME:
            return False
        return all(step.ending is None for step in model.steps) or abs(float(paid[0])) <= SAME


def sense(task: Task, results: Results | None = None) -> tuple[Diagnostic, ...]:
    """Warnings about a task for its present parameters; what needs an exact model is passed over without one."""
    case = Case(task, results or Results(task))
    collector = Collector()
    for check in CHECKS:
        check(case, collector)
    return collector.diagnostics


# -- states and rewards ---------------------------------------------------------------------------


def unreachable(case: Case, collector: Collector) -> None:
    """W501: values of a component that occur in no episode, however long, of this task or of one that shares its roles."""
    model = case.model
    if model is None:
        return
    entered = [model.states.decode(m.codes[m.connected]) for m in (model, *_partners(case))]
    for c in model.task.state:
        seen = np.concatenate([e[Role.STATE, c.name].reshape(-1, e[Role.STATE, c.name].shape[-1]) for e in entered], 1)
        missing = _missing(c, seen)
        if missing:
            shown = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
            message = f"no episode is ever in a state with {c.name} = {shown}"
            collector.add("W501", case.key("state", c.name), message)


def _missing(c: Component, seen: Array) -> list[str]:
    """Values that a scalar component never takes, in words."""
    if not c.type.is_scalar or c.counts[0] > 100_000:
        return []
    every = np.arange(int(c.low[0]), int(c.high[0]) + 1)
    return [words(plain(c, np.asarray(v))) for v in np.setdiff1d(every, seen.astype(np.int64))[:7]]


def _partners(case: Case) -> Iterator[Model]:
    """The models of the variants in which expert and learner act."""
    roles = case.task.surface.data.get("roles") or {}
    for variant in dict.fromkeys(roles.values()):
        if variant in (case.task.name, case.task.variant):
            continue
        try:
            yield extract(build(case.task.document, str(variant), case.task.values, case.task.suite), reachable=False)
        except SpecError:
            continue


def rewards(case: Case, collector: Collector) -> None:
    """W502 and W503: rewards that are always the same."""
    if not case.is_constant:
        return
    value = words(float(case.rewards[0]))
    later = _later_reward(case)
    if later is None:
        collector.add("W503", case.merged.span(("reward",)), f"every step that can occur pays {value}")
        return
    message = f"within {case.task.horizon} steps every reward is {value}; in longer episodes others follow"
    hint = f"the first of them is paid in step {later}"
    collector.add("W502", case.merged.span(("horizon",)), message, hint)


def _later_reward(case: Case) -> int | None:
    """The first step in which a longer episode could be paid otherwise."""
    model = case.results.model
    if model is None or model.horizon is None or model.is_timed:
        return None
    level, seen = model.start > 0, np.zeros(model.n_states, np.bool_)
    paid = model.step(0).reward.reshape(model.n_actions, -1)
    for t in range(model.horizon + LONGER):
        if not (level & ~seen).any():
            return None
        if np.ptp(np.append(paid[:, level].reshape(-1), case.rewards[0])) > SAME:
            return t + 1
        seen |= level
        level = model.successors(model.step(0).going, level)
    return None


def indifferent(case: Case, collector: Collector) -> None:
    """W504: the best return is that of random actions."""
    optimal, random = case.results.optimal, case.results.random
    if optimal is None or random is None or case.is_constant:
        return
    if abs(optimal.value - random.value) <= SAME * max(1.0, abs(optimal.value)):
        message = f"random actions are as good as the best: both return {words(optimal.value)}"
        collector.add("W504", case.merged.span(("reward",)), message)


# -- actions and experts --------------------------------------------------------------------------


def inert(case: Case, collector: Collector) -> None:
    """W505: a component of the action that changes nothing."""
    read = reads((*case.task.next, case.task.reward, case.task.terminal))
    for c in case.task.action:
        if c.is_finite and c.counts == (1,) * c.type.size:
            continue
        if (Role.ACTION, c.name) not in read:
            collector.add("W505", case.key("action", c.name), f"the action '{c.name}' is read nowhere")
        elif case.model is not None and case.model.acting.any() and not differs(case.model, c.name)[0]:
            message = f"the action '{c.name}' changes neither the next state nor the reward, in any state"
            collector.add("W505", case.key("action", c.name), message)


def expert(case: Case, collector: Collector) -> None:
    """W507: an expert below the optimum, or below random actions where that is all there is to compare with."""
    found, optimal = case.results.expert, case.results.optimal
    if found is None or isinstance(case.task.expert, Soft) or _says_so(case.task):
        return
    if optimal is None:
        _below_random(case, found, collector)
        return
    gap = optimal.value - found.value
    if gap > SAME * max(1.0, abs(optimal.value)):
        message = f"the expert returns {_shown(found)}, which is {gap:.6g} below the optimum of {_shown(optimal)}"
        collector.add("W507", case.key("expert"), message)


def _below_random(case: Case, found: Return, collector: Collector) -> None:
    """By simulation: the intervals of the two returns must lie apart."""
    random = case.results.random or case.results.simulated(sampled_actions(case.task), 200)
    if random.interval(CERTAIN)[0] > found.interval(CERTAIN)[1]:
        message = f"the expert returns {_shown(found)} on average, and random actions {_shown(random)}"
        notes = [f"from {found.episodes:,} and {random.episodes:,} episodes"]
        collector.add("W507", case.key("expert"), message, None, notes)


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


def unused_names(case: Case, collector: Collector) -> None:
    """W506: parameters, constants, definitions and noise that nothing depends on."""
    for section, name in unused(case.task):
        what = {"parameters": "parameter", "constants": "constant", "definitions": "definition"}.get(section, "noise")
        collector.add("W506", case.key(section, name), f"nothing uses the {what} '{name}'")


# -- observations ---------------------------------------------------------------------------------


def leak(case: Case, collector: Collector) -> None:
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


def hidden_goal(case: Case, collector: Collector) -> None:
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
    good = solve.ties(solve.all_action_values(model)[0])[:, first]
    _, group = np.unique(seen, axis=0, return_inverse=True)
    group = group.reshape(-1)
    for number in range(int(group.max()) + 1):
        members = np.flatnonzero(group == number)
        if not good[:, members].all(axis=1).any():
            one, other = (model.state_name(int(first[m])) for m in _conflict(good, members))
            message = f"episodes begin in {one} and in {other}; the agent sees the same, and no action is best in both"
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


CHECKS: tuple[Callable[[Case, Collector], None], ...] = (
    unreachable, rewards, indifferent, inert, expert, unused_names, leak, hidden_goal,
)  # fmt: skip
