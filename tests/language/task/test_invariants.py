"""The invariants of tasks: they hold for every spec of the repository, and each notices a task that breaks it."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.language.expressions.ir import Apply, Const, Draw, Read
from taskspec.language.expressions.types import BOOL, INT, REAL, Kind, Role, Type
from taskspec.language.source import read_text
from taskspec.language.task.build import build, build_abstract
from taskspec.language.task.parts import Figure, Symmetry
from taskspec.language.task.task import Task
from tests.shared.for_each import for_each
from tests.shared.invariants import OF_NODES, OF_TASKS, broken, checked

ROOT = Path(__file__).parents[3]
SPECS = sorted(
    p for folder in ("tasks", "tests/specs", "tests/appendix_as_printed") for p in (ROOT / folder).rglob("*.yaml")
)
SPEC = """
taskspec: 1
name: Walk
state: {s: {type: int, low: 0, high: 5}, x: {type: real, low: 0, high: 1, shape: [2]}}
action: {a: {type: bool}}
horizon: 9
initial: {s: 0, x: 0}
dynamics: {s': "min(s + a, 5) if Bernoulli(1/2) else s"}
reward: s' + x[0]
memory: {m: {type: int, low: 0, high: 5, initial: s, next: s'}}
expert: {a: m < 3}
"""


def tasks(path: Path) -> list[Task]:
    document = read_text(path.read_text(), path.name)
    found = []
    for variant in (None, *(document.data.get("variants") or {})):
        try:
            task = build(document, variant)
        except SpecError:
            continue  # printed with a mistake, or complete in its variants only
        found += [task, taskspec.modify(task, "absorbing"), build_abstract(task)]
        if task.horizon is not None:
            found.append(taskspec.modify(task, "time_observed"))
    return [t for t in found if t is not None]


@for_each("path", SPECS)
def test_every_task_keeps_them(path: Path) -> None:
    assert [rule for task in tasks(path) for rule in broken(task)] == []


def damaged(task: Task, **changes: object) -> Task:
    """Return a task with fields changed, wherever they are: in the task, its process or its annotations."""
    for name, value in changes.items():
        change = {name: value}
        if hasattr(task.process, name):
            task = task.with_process(**change)
        elif hasattr(task.annotations, name):
            task = task.with_annotations(**change)
        else:
            task = dataclasses.replace(task, **change)  # type: ignore[arg-type]
    return task


def remembering(task: Task, **changes: object) -> Task:
    assert task.annotations.memory is not None
    return damaged(task, memory=dataclasses.replace(task.annotations.memory, **changes))  # type: ignore[arg-type]


def read(role: Role, name: str, type: Type = INT) -> Read:
    return Read(role, name, type)


ACTION = read(Role.ACTION, "a", BOOL)
VARIABLE = read(Role.VARIABLE, "i")
COIN = Draw("bernoulli", (Const(0.5, REAL),), BOOL, 99)
DAMAGE: dict[str, Callable[[Task], Task]] = {
    "a constant has one scalar for each element": lambda t: damaged(t, reward=Const((1.0, 2.0), Type(Kind.REAL, (3,)))),
    "the scalars of a constant are of its kind": lambda t: damaged(t, reward=Const(1, REAL)),
    "an operator is in one of the two tables": lambda t: damaged(t, reward=Apply("cosh", (t.process.reward,), REAL)),
    "the type of an operation follows its rule": lambda t: damaged(t, reward=Apply("floor", (t.process.reward,), REAL)),
    "an operation without arguments does not exist": lambda t: damaged(t, reward=Apply("vector", (), REAL)),
    "static values are ints": lambda t: damaged(t, reward=Apply("element", (t.process.next[1],), REAL, (0.0,))),  # type: ignore[arg-type]
    "a draw is of a base variate, and of its kind": lambda t: damaged(t, reward=dataclasses.replace(COIN, type=REAL)),
    "variables of comprehensions and functions are expanded": lambda t: damaged(t, next=(VARIABLE, t.process.next[1])),
    "there is a state and an action": lambda t: damaged(t, action=()),
    "no two components have one name": lambda t: damaged(t, action=(t.state[0],)),
    "no two observed components have one name": lambda t: damaged(
        t, observation=dataclasses.replace(t.observation, components=2 * t.observation.components)
    ),
    "bounds have one number for each element, low first": lambda t: damaged(
        t, state=(dataclasses.replace(t.state[0], low=(6,)), t.state[1])
    ),
    "each state component has a first value of its type": lambda t: damaged(t, initial=t.process.initial[:1]),
    "each state component has a next value of its type": lambda t: damaged(t, next=t.process.next[::-1]),
    "each observed component has a value of its type": lambda t: damaged(
        t, observation=dataclasses.replace(t.observation, nodes=t.observation.nodes[:1])
    ),
    "each action component has an expert's value of its type": lambda t: damaged(t, expert=(t.process.reward,)),
    "the rewards are single reals": lambda t: damaged(t, reward=t.process.next[0]),
    "the end is a single condition": lambda t: damaged(t, terminal=t.process.next[0]),
    "first values read nothing": lambda t: damaged(t, initial=t.process.next),
    "a step reads state, action and time": lambda t: damaged(t, terminal=read(Role.NEXT, "s", BOOL)),
    "an observation reads state and time": lambda t: damaged(
        t, observation=dataclasses.replace(t.observation, nodes=(ACTION, t.observation.nodes[1]))
    ),
    "an expert reads state and time": lambda t: damaged(t, expert=(ACTION,)),
    "a figure reads what a step reads": lambda t: damaged(t, figure=Figure("bars", values=read(Role.NEXT, "s"))),
    "the absorbing reward reads state and time": lambda t: damaged(t, absorbing_reward=read(Role.ACTION, "a", REAL)),
    "the absorbing reward draws nothing": lambda t: damaged(t, absorbing_reward=Draw("normal", (), REAL, 98)),
    "each component of a memory has values of its type": lambda t: remembering(t, initial=(t.process.reward,)),
    "a memory reads what is seen, and later itself, action and time": lambda t: remembering(
        t, initial=(t.process.next[0],)
    ),
    "a memory draws nothing": lambda t: remembering(t, next=(COIN,)),
    "a symmetry maps what is seen, or the action, and draws nothing": lambda t: damaged(
        t, symmetries=(Symmetry("s", action=(t.process.next[0],)),)
    ),
    "what is read is a component": lambda t: damaged(t, terminal=read(Role.STATE, "nobody", BOOL)),
    "a site of a draw is one node": lambda t: damaged(t, terminal=COIN, expert=(dataclasses.replace(COIN),)),
    "equal operations are one node": lambda t: damaged(
        t, terminal=Apply("not", (ACTION,), BOOL), expert=(Apply("not", (ACTION,), BOOL),)
    ),
    "an index is certain to lie in its vector": lambda t: damaged(
        t, reward=Apply("index", (t.process.next[1], read(Role.STATE, "s")), REAL)
    ),
    "a draw of an index has one value to draw from at least": lambda t: damaged(
        t, initial=(Draw("index", (Const(0, INT),), INT, 97), t.process.initial[1])
    ),
    "a state int is certain to keep to its range": lambda t: damaged(
        t, next=(read(Role.STATE, "s"), t.process.next[1])
    ),
    "a horizon has a step at least": lambda t: damaged(t, horizon=0),
    "the discount is between 0 and 1": lambda t: damaged(t, discount=1.5),
}


@for_each("rule", [rule for rule, _ in (*OF_NODES, *OF_TASKS)])
def test_each_notices_a_task_that_breaks_it(rule: str) -> None:
    task = build(read_text(SPEC, "walk.yaml"))
    assert list(broken(task)) == []
    assert any(found.startswith(rule + ": ") for found in broken(DAMAGE[rule](task)))


def test_a_task_that_breaks_a_rule_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.shared.invariants.OF_TASKS", (("nothing is right", lambda task: False),))
    with pytest.raises(AssertionError, match="nothing is right"):
        checked(build)(read_text(SPEC, "walk"))
