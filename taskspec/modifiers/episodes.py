"""Modifiers of episodes: how long they are, how they end, and what later rewards are worth."""

from __future__ import annotations

import math
from dataclasses import replace

from taskspec.base.limits import Limits
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Node, Read, Role, walk
from taskspec.lang.types import BOOL
from taskspec.modifiers.core import AddedState, fresh, names_in, paying, present, reads_time, with_state
from taskspec.modifiers.entry import Arguments, Inapplicable, ModifierArgument, ModifierEntry, as_well
from taskspec.task.reach import Observed, reach, saturated
from taskspec.task.task import Component, Task


def _absorbing(b: Builder, task: Task, given: Arguments) -> Task:
    """Terminal states are kept until the horizon, and pay the absorbing reward."""
    if task.ending == "absorb":
        return task
    (name,) = fresh(["absorbed"], names_in(task))
    over = b.read(Role.STATE, name, BOOL, 0, 1)

    def held(nodes: tuple[Node, ...]) -> tuple[Node, ...]:
        reads = (present(b, c) for c in task.state)
        return tuple(b.apply("where", over, read, node) for read, node in zip(reads, nodes, strict=True))

    flag = Component(name, BOOL, (0,), (1,), doc="whether the episode has ended")
    changed = replace(task, next=held(task.next), raw_next=held(task.raw_next), terminal=b.scalar(False))
    changed = paying(b, changed, b.apply("where", over, task.absorbing_reward, task.reward))
    ended = with_state(changed, [AddedState(flag, b.scalar(False), b.apply("or", over, task.terminal))])
    return replace(ended, observation=task.observation)  # an absorbed state is observed as what it is


def _horizon(b: Builder, task: Task, given: Arguments) -> Task:
    steps = given["steps"]
    longer = task.horizon is not None and steps > task.horizon
    if reads_time(task) and (longer or task.modifiers or task.horizon is None):
        hint = "give the horizon before other modifiers" if task.modifiers else "a parameter of the task may decide it"
        raise Inapplicable("it depends on the time, and so on its horizon", hint)
    return _longer(b, task, steps) if longer else replace(task, horizon=steps)


def _longer(b: Builder, task: Task, steps: int) -> Task:
    """Ints without ends may get further than before, and what is observed of them too."""
    following = tuple(saturated(b, task.state, task.initial, task.next, steps))
    reached = reach(task.state, task.initial, following, steps)
    seen = Observed(b, task.state, reached)
    endless = {c.name for c in task.state if not all(map(math.isfinite, (*c.low, *c.high)))}
    components = tuple(
        _wider(c, seen.edges(n)) if _names(n) & endless else c
        for c, n in zip(task.observation.components, task.observation.nodes, strict=True)
    )
    return replace(task, horizon=steps, next=following, observation=replace(task.observation, components=components))


def _wider(c: Component, edges: list[tuple[float, float]]) -> Component:
    low = tuple(min(v, edge[0]) for v, edge in zip(c.low, edges, strict=True))
    return replace(c, low=low, high=tuple(max(v, edge[1]) for v, edge in zip(c.high, edges, strict=True)))


def _names(node: Node) -> set[str]:
    return {n.name for n in walk([node]) if isinstance(n, Read) and n.role is Role.STATE}


def _says_horizon(task: Task, given: Arguments) -> str:
    before = "without a time limit" if task.horizon is None else f"of ${task.horizon}$ steps"
    return f"the horizon is ${given['steps']}$, in place of one {before}"


TABLE = (
    ModifierEntry(
        "horizon", (
            ModifierArgument("steps", "int", "the horizon", low=1, high=Limits.horizon,
                             sample=lambda task: (task.horizon or 20) // 2 + 1),
        ),
        "Episodes are longer or shorter.",
        _horizon, _says_horizon, time_limit="changed", abstraction=as_well,
        needs="a task that does not depend on the time, unless it comes first and shortens episodes; it comes before modifiers "
        "that read when episodes end",
    ),
    ModifierEntry(
        "discount", (ModifierArgument("factor", "real", "the discount", low=0, high=1, sample=lambda task: 0.9),),
        "Later rewards are worth less in returns.",
        lambda b, task, given: replace(task, discount=float(given["factor"])),
        lambda task, given: rf"the discount is $\gamma = {given['factor']:g}$, in place of ${task.discount:g}$",
        abstraction=as_well,
    ),
    ModifierEntry(
        "absorbing", (), "Terminal states do not end the episode, but last until the horizon and pay the absorbing reward.",
        _absorbing,
        lambda task, given: "a terminal state lasts until the horizon, where it pays the absorbing reward, and ends no episode",
        claims=True,
    ),
)  # fmt: skip
