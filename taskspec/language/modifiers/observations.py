"""Modifiers of observations: what is seen is renamed, hidden, noisy, or among what means nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from taskspec.base.diagnostics import suggest
from taskspec.base.named import all_names
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import DISTS
from taskspec.language.expressions.types import INT, Kind, Role, Type
from taskspec.language.modifiers import core
from taskspec.language.modifiers.actions import SEED, permutations
from taskspec.language.modifiers.entry import (
    STD,
    Arguments,
    Inapplicable,
    ModifierArgument,
    ModifierEntry,
    always,
    unaffected,
)
from taskspec.language.task.parts import FINITE_SPACES, Component, Observation, by_name
from taskspec.language.task.task import Task


def _relabelled(b: Builder, task: Task, given: Arguments) -> Task:
    seen = task.observation
    count = core.combinations(seen.components, "what is observed")
    labels = permutations(given["seed"], 1, count)[0]
    label = core.looked_up(b, labels.tolist(), core.joint(b, seen.components, seen.nodes))
    (name,) = core.fresh(["label"], core.names_in(task))
    c = Component(name, INT, (0,), (count - 1,), doc="a number for what is observed")
    shown = b.read(Role.NEXT, name, INT, 0, count - 1)
    behind = core.apart(b, seen.components, np.argsort(labels).tolist(), shown)
    meant = by_name(seen.components, behind)
    return core.observing(b, task, [c], [label], "discrete", {}, meant)


def _distractors(b: Builder, task: Task, given: Arguments) -> Task:
    seen = task.observation
    shape = (given["count"],)
    arguments = {"normal": {"mean": 0, "std": 1}, "uniform": {"low": -1, "high": 1}}[given["kind"]]
    with b.written(apart=True) as drawn:
        dist = DISTS[given["kind"].capitalize()]
        node = dist.build(b, {name: b.scalar(v) for name, v in arguments.items()}, shape)
    if given["kind"] == "uniform":
        low, high = (-1.0, 1.0)
    else:
        low, high = (-math.inf, math.inf)
    (name,) = core.fresh(["distractor"], core.names_in(task))
    c = Component(
        name, Type(Kind.REAL, shape), (low,) * shape[0], (high,) * shape[0],
        doc="numbers that mean nothing",
    )  # fmt: skip
    return core.observing(
        b, task, [*seen.components, c], [*seen.nodes, b.cast(node, Kind.REAL)], core.real_space(task), drawn
    )


def _noise(b: Builder, task: Task, given: Arguments) -> Task:
    seen = task.observation
    with b.written(apart=True) as drawn:
        nodes = [core.noisy(b, node, given["std"]) for node in seen.nodes]
    components = []
    for c in seen.components:
        size = c.type.size
        type_ = Type(Kind.REAL, c.type.shape)
        components.append(replace(c, type=type_, domain=None, low=(-math.inf,) * size, high=(math.inf,) * size))
    return core.observing(b, task, components, nodes, core.real_space(task), drawn)


def _dropout(b: Builder, task: Task, given: Arguments) -> Task:
    seen = task.observation
    with b.written(apart=True) as drawn:
        p = b.scalar(given["probability"])
        gone = [DISTS["Bernoulli"].build(b, {"p": p}, n.type.shape) for n in seen.nodes]
    nodes = []
    for lost, n in zip(gone, seen.nodes, strict=True):
        nothing = b.stretch(b.const(0, Type(n.type.kind)), n.type.shape)
        nodes.append(b.apply("where", lost, nothing, n))
    components = []
    for c in seen.components:
        low = tuple(min(v, 0) for v in c.low)
        high = tuple(max(v, 0) for v in c.high)
        components.append(replace(c, low=low, high=high))
    return core.observing(b, task, components, nodes, seen.space, drawn)


def _hidden(b: Builder, task: Task, given: Arguments) -> Task:
    seen = task.observation
    name = given["name"]
    names = all_names(seen.components)
    if name not in names:
        raise Inapplicable(
            f"'{name}' is not observed", suggest(name, names) or f"what is observed is {', '.join(names)}"
        )
    if len(names) == 1:
        raise Inapplicable(f"'{name}' is the only observed component")
    kept = []
    for c, n in zip(seen.components, seen.nodes, strict=True):
        if c.name != name:
            kept.append((c, n))
    components, nodes = zip(*kept, strict=True)
    return core.observing(b, task, components, nodes, seen.space, {})


def _timed(b: Builder, task: Task, given: Arguments) -> Task:
    if task.observe_time:
        return task
    seen = task.observation
    if task.horizon is None and seen.space in FINITE_SPACES:
        raise Inapplicable(f"without a horizon the time does not fit into a `{seen.space}` observation")
    high = math.inf
    if task.horizon is not None:
        high = float(task.horizon)
    time = b.read(Role.TIME, "t", INT, 0, high)
    (name,) = core.fresh(["t"], core.names_in(task))
    clock = Component(name, INT, (0,), (high,), doc="steps taken")
    space = "multi_discrete" if seen.space == "discrete" else seen.space
    return replace(task, observation=Observation((*seen.components, clock), (*seen.nodes, time), space))


_COUNT = ModifierArgument("count", "int", "how many", low=1, high=100_000, sample=lambda task: 3)
_KIND = ModifierArgument("kind", "word", "standard normal numbers, or uniform ones from -1 to 1", "normal",
                         words=("normal", "uniform"))  # fmt: skip
_entry = partial(ModifierEntry, keeps="every policy's return", abstraction=unaffected)
_LAWS = {"normal": r"\mathcal{N}(0, 1)", "uniform": r"\operatorname{Unif}(-1, 1)"}
TABLE = (
    _entry(
        "relabelled", (SEED,), "Each observation becomes one number, assigned at random, which tells nothing about similarity.",
        _relabelled,
        lambda task, given: f"what is observed is one of ${core.combinations(task.observation.components, '')}$ numbers, which "
        f"are dealt out by the seed {given['seed']}",
        observed=always, needs="finite observations",
    ),
    _entry(
        "distractors", (_COUNT, _KIND), "Meaningless numbers are observed as well, drawn again in every step.",
        _distractors,
        lambda task, given: f"${given['count']}$ more numbers are observed, independently drawn from ${_LAWS[given['kind']]}$ "
        "in every step",
        observed=always,
    ),
    _entry(
        "observation_noise", (STD,), "Normal noise is added to every number observed.",
        _noise,
        lambda task, given: rf"noise from $\mathcal{{N}}(0, {given['std']:g}^2)$ is added to every number observed",
    ),
    _entry(
        "dropout", (
            ModifierArgument("probability", "real", "how likely each number is 0", low=0, high=1, sample=lambda task: 0.25),
        ),
        "Each number observed is 0 with this probability.",
        _dropout,
        lambda task, given: f"each number observed is 0 with probability ${given['probability']:g}$, independently",
    ),
    _entry(
        "hidden", (
            ModifierArgument("name", "word", "which component of the observation",
                             sample=lambda task: task.observation.components[0].name),
        ),
        "A component of the observation is left out.",
        _hidden, lambda task, given: f"`{given['name']}` is not observed",
        needs="another component that is observed",
    ),
    _entry(
        "time_observed", (), "The number of steps taken is added to the observation.",
        _timed, lambda task, given: "the number of steps taken is observed as well",
        claims=True, needs="a horizon, where observations are declared finite",
    ),
)  # fmt: skip
