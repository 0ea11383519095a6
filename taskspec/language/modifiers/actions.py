"""Modifiers of actions (repeated, replaced at random, permuted) and of episodes (their length, end and discount)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from taskspec.base.limits import Limits
from taskspec.language import draws
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import DISTS
from taskspec.language.expressions.ir import Const, Node, reads
from taskspec.language.expressions.types import BOOL, Kind, Role
from taskspec.language.modifiers import core
from taskspec.language.modifiers.entry import Arguments, Inapplicable, ModifierArgument, ModifierEntry, always, as_well
from taskspec.language.task.parts import Component, by_name
from taskspec.language.task.reach import Observed, reach, saturated
from taskspec.language.task.task import Task


def _sticky(b: Builder, task: Task, given: Arguments) -> Task:
    name, *names_kept = core.fresh(["acted", *(f"last_{c.name}" for c in task.action)], core.names_in(task))
    begun = b.read(Role.STATE, name, BOOL, 0, 1)
    kept = []
    for c, last_name in zip(task.action, names_kept, strict=True):
        kept.append(replace(c, name=last_name, symbol=None, doc=f"`{c.name}` as it was executed last"))
    with b.written(apart=True) as drawn:
        repeated = DISTS["Bernoulli"].build(b, {"p": b.scalar(given["probability"])}, ())
    again = b.apply("and", begun, repeated)
    executed = {}
    added = []
    for c, old in zip(task.action, kept, strict=True):
        executed[c.name] = b.apply("where", again, core.present(b, old), core.present(b, c, Role.ACTION))
        added.append(core.AddedState(old, core.inside(b, c), executed[c.name]))
    flag = Component(name, BOOL, (0,), (1,), doc="whether an action was taken before")
    begins = core.AddedState(flag, b.scalar(False), b.scalar(True))
    return core.drawing(core.with_state(core.acting(b, task, executed), [*added, begins]), drawn)


def _random(b: Builder, task: Task, given: Arguments) -> Task:
    for c in task.action:
        if not all(map(math.isfinite, (*c.low, *c.high))):
            raise Inapplicable(f"actions must be bounded, and '{c.name}' has none")
    with b.written(apart=True) as drawn:
        slipped = DISTS["Bernoulli"].build(b, {"p": b.scalar(given["probability"])}, ())
        values = {c.name: _any(b, c) for c in task.action}
    executed = {}
    for c in task.action:
        executed[c.name] = b.apply("where", slipped, values[c.name], core.present(b, c, Role.ACTION))
    return core.drawing(core.acting(b, task, executed), drawn)


def _any(b: Builder, c: Component) -> Node:
    if c.type.kind is Kind.BOOL:
        return DISTS["Bernoulli"].build(b, {"p": b.scalar(0.5)}, c.type.shape)
    given = {"low": b.constant(c.low, c.type), "high": b.constant(c.high, c.type)}
    dist = "UniformInt"
    if c.type.kind is Kind.REAL:
        dist = "Uniform"
    return DISTS[dist].build(b, given, c.type.shape)


def _permuted(b: Builder, task: Task, given: Arguments) -> Task:
    count = core.combinations(task.action, "the actions")
    states = 1
    if given["per_state"]:
        states = core.combinations(task.state, "the states", max(1, core.MOST // count))
    table = permutations(given["seed"], states, count)
    if states > 1:
        row = core.joint(b, task.state, [core.present(b, c) for c in task.state])
    else:
        row = b.scalar(0)
    start = b.apply("mul", row, b.scalar(count))

    def through(codes: np.ndarray[tuple[int, ...], np.dtype[np.int64]], actions: list[Node]) -> list[Node]:
        at = b.apply("add", start, core.joint(b, task.action, actions))
        return core.apart(b, task.action, codes.reshape(-1).tolist(), at)

    meant = through(table, [core.present(b, c, Role.ACTION) for c in task.action])
    expert = task.annotations.expert
    if isinstance(expert, tuple):
        expert = tuple(through(np.argsort(table, axis=1), list(expert)))
    plain = tuple(replace(c, domain=None) for c in task.action)  # a label would say what an action no longer does
    changed = replace(task, action=plain).with_annotations(expert=expert)
    return core.meaning(b, changed, by_name(task.action, meant))


def permutations(seed: int, rows: int, count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Random permutations (rows, count) by a seed, the same everywhere; a single one changes something."""
    orders = np.argsort(draws.block(seed, draws.RESET, 0, rows, count), axis=1, kind="stable").astype(np.int64)
    if rows == 1 and count > 1 and bool((orders[0] == np.arange(count)).all()):
        return np.roll(orders, 1, axis=1)
    return orders


def _says_permuted(task: Task, given: Arguments) -> str:
    where = "in all states alike"
    if given["per_state"]:
        where = "in each state anew"
    return f"what the actions do is permuted by the seed {given['seed']}, {where}"


_P = ModifierArgument("probability", "real", "how likely it is in each step", low=0, high=1, sample=lambda task: 0.25)
SEED = ModifierArgument("seed", "int", "which permutation", 0, low=0, high=2**32 - 1)
TABLE = (
    ModifierEntry(
        "sticky", (_P,), "With this probability the previously executed action is repeated (Machado et al., 2018).",
        _sticky,
        lambda task, given: f"with probability ${given['probability']:g}$ the action executed in the step before is executed "
        "again, in place of the one chosen; the state keeps that action, which is not observed",
    ),
    ModifierEntry(
        "random_actions", (_P,), "With this probability a uniformly random action is executed in place of the one chosen.",
        _random,
        lambda task, given: f"with probability ${given['probability']:g}$ a uniformly random action is executed in place of "
        "the one chosen",
        needs="bounded actions", abstraction=as_well,
    ),
    ModifierEntry(
        "permuted_actions", (
            SEED, ModifierArgument("per_state", "bool", "whether each state has a permutation of its own", False),
        ),
        "The effects of the actions are permuted at random: once for all states, or separately in each state.",
        _permuted, _says_permuted, keeps="all returns",
        observed=lambda task, given: not given["per_state"] or core.shows_the_state(task),
        observed_condition="each state has no permutation of its own, or no two states look alike",
        abstraction=lambda given: "lost" if given["per_state"] else "modified as well",
        needs="finite actions; finite states as well where each has its own",
    ),
)  # fmt: skip


# Modifiers of episodes.


def _absorbing(b: Builder, task: Task, given: Arguments) -> Task:
    """Terminal states are kept until the horizon, and pay the absorbing reward."""
    if task.ending == "absorb":
        return task
    (name,) = core.fresh(["absorbed"], core.names_in(task))
    over = b.read(Role.STATE, name, BOOL, 0, 1)

    def held(nodes: tuple[Node, ...]) -> tuple[Node, ...]:
        reads = (core.present(b, c) for c in task.state)
        stretched = []
        for read, node in zip(reads, nodes, strict=True):
            stretched.append(b.apply("where", over, read, node))
        return tuple(stretched)

    flag = Component(name, BOOL, (0,), (1,), doc="whether the episode has ended")
    changed = task.with_process(
        next=held(task.process.next),
        raw_next=held(task.process.raw_next),
        terminal=b.scalar(False),
        measures={name: b.apply("where", over, b.scalar(0.0), node) for name, node in task.process.measures.items()},
    )
    if task.process.legal is not None:
        changed = changed.with_process(legal=b.apply("or", over, task.process.legal))
    changed = core.paying(b, changed, b.apply("where", over, task.process.absorbing_reward, task.process.reward))
    ended = core.with_state(
        changed, [core.AddedState(flag, b.scalar(False), b.apply("or", over, task.process.terminal))]
    )
    return replace(ended, observation=task.observation)  # an absorbed state is observed as what it is


def absorbing_pays_nothing(task: Task, given: Arguments) -> bool:
    paid = task.process.absorbing_reward
    return isinstance(paid, Const) and paid.value == 0


def _horizon(b: Builder, task: Task, given: Arguments) -> Task:
    steps = given["steps"]
    longer = task.horizon is not None and steps > task.horizon
    if core.reads_time(task) and (longer or task.modifiers or task.horizon is None):
        hint = "a parameter of the task may decide it"
        if task.modifiers:
            hint = "give the horizon before other modifiers"
        raise Inapplicable("it depends on the time, and so on its horizon", hint)
    if longer:
        return _longer(b, task, steps)
    return replace(task, horizon=steps)


def _longer(b: Builder, task: Task, steps: int) -> Task:
    """Ints without ends may get further than before, and what is observed of them too."""
    following = tuple(saturated(b, task.state, task.process.initial, task.process.next, steps))
    reached = reach(task.state, task.process.initial, following, steps)
    seen = Observed(b, task.state, reached)
    endless = set()
    for c in task.state:
        if not all(map(math.isfinite, (*c.low, *c.high))):
            endless.add(c.name)
    components = []
    for c, node in zip(task.observation.components, task.observation.nodes, strict=True):
        names = set()
        for role, name in reads([node]):
            if role is Role.STATE:
                names.add(name)
        if endless & names:
            edges = seen.edges(node)
            low = tuple(min(v, edge[0]) for v, edge in zip(c.low, edges, strict=True))
            c = replace(c, low=low, high=tuple(max(v, edge[1]) for v, edge in zip(c.high, edges, strict=True)))
        components.append(c)
    observation = replace(task.observation, components=tuple(components))
    return replace(task, horizon=steps, observation=observation).with_process(next=following)


def _says_horizon(task: Task, given: Arguments) -> str:
    before = f"of ${task.horizon}$ steps"
    if task.horizon is None:
        before = "without a time limit"
    return f"the horizon is ${given['steps']}$, in place of one {before}"


EPISODE_TABLE = (
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
        keeps="every policy's return", when=absorbing_pays_nothing, observed=always,
        condition="the absorbing reward is 0",
        claims=True,
    ),
)  # fmt: skip
