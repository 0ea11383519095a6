"""Symmetries: what they keep, what tells a twin from its task, and that nothing else is called proved."""

import pickle
from collections.abc import Callable
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exact import Results, score
from taskspec.exact.abstraction.abstraction import verify_symmetry
from taskspec.language.registry import task_ids
from taskspec.language.task.task import Task
from tests.programs.test_trajectories import walk_together
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.for_each import for_each
from tests.shared.invariants import broken
from tests.shared.sparse import sparse

Array = np.ndarray[Any, Any]
SMALL: dict[str, dict[str, Any]] = {
    "LargestSum": {"L": 4}, "NoisyObs": {"L": 3, "M": 3}, "NoisyObsSeals": {"L": 3, "M": 3}, "Sort": {"L": 3},
    "SortSeals": {"L": 3}, "ProcGoal": {"B": 2, "D": 2}, "ProcGoalSeals": {"B": 2, "D": 2},
}  # fmt: skip


@cache
def task_of(task_id: str) -> Task:
    name = task_id.partition("/")[2].partition("-")[0]
    return taskspec.load(task_id, **SMALL.get(name, {}))


STRUCTURED = ("LargestSum", "NoisyObs", "Parabola", "ProcGoal", "Sort")
DECLARED = [
    (f"derail/{name}{variant}-v0", symmetry.name)
    for name, variant in product(STRUCTURED, ("", "Seals"))
    for symmetry in taskspec.load(f"derail/{name}{variant}-v0").annotations.symmetries
]
ORIGINALS = [pair for pair in DECLARED if "Seals" not in pair[0]]


def twin_of(task_id: str, name: str) -> Task:
    return taskspec.modify(task_of(task_id), f"symmetry={name}")


def test_every_task_with_structure_declares_a_symmetry_and_so_does_its_variant() -> None:
    for task_id in task_ids():
        has_structure = task_id.partition("/")[2].partition("-")[0].removesuffix("Seals") in STRUCTURED
        if task_id.startswith("derail/"):
            assert bool(taskspec.load(task_id).annotations.symmetries) == has_structure, task_id


# -- twins, everywhere alike --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("task_id", "name"), sparse(DECLARED, 3))
def test_a_twin_is_a_task(task_id: str, name: str) -> None:
    twin = twin_of(task_id, name)
    assert not list(broken(twin))
    assert pickle.loads(pickle.dumps(twin)) == twin != task_of(task_id)
    assert twin == taskspec.load(twin.instance_id)
    walk_together(taskspec.make(twin), 11, 25)
    Agreement(twin, "numpy", 3, "NextStep", one=ReferenceEnv, states=True).run(12)


@pytest.mark.parametrize("backend", ["numba", "jax"])
@pytest.mark.parametrize(("task_id", "name"), sparse(ORIGINALS, 4))
def test_backends_agree_on_twins(task_id: str, name: str, backend: Any) -> None:
    pytest.importorskip(backend)
    Agreement(twin_of(task_id, name), backend, 3, "SameStep", one=ReferenceEnv, states=True).run(12)


# -- returns ------------------------------------------------------------------------------------------------------

Map = Callable[[Array], Array]
PRINTED: dict[str, tuple[Map, Map]] = {
    "mirror": (lambda o: o * [-1, 1, -1, 1], lambda a: a),
    "turned": (lambda o: o[[1, 0, 3, 2]] * [-1, 1, -1, 1], lambda a: a),
    "exchanged": (lambda o: np.concatenate([o[len(o) // 2 :], o[: len(o) // 2]]), lambda a: a),
    "among_noise": (lambda o: o[[2, 3, 0, 1, 4]], lambda a: a),
    "upside_down": (lambda o: o * [1, -1, -1, -1, -1], lambda a: a),
    "downwards": (lambda o: o[::-1], lambda a: 2 - np.asarray(a)),
}
"""What is seen of what the task shows, as one vector, and the action that stands for one of the task; for small tasks."""


@pytest.mark.parametrize(("task_id", "name"), DECLARED)
def test_what_the_twin_shows_and_what_its_actions_do(task_id: str, name: str) -> None:
    """Episodes of a task and of its twin, with actions that correspond: the same rewards, and what was said is seen."""
    seen, done = PRINTED[name]
    one = taskspec.make(task_of(task_id))
    other = taskspec.make(twin_of(task_id, name))
    first = one.reset(seed=3)[0]
    second = other.reset(seed=3)[0]
    one.action_space.seed(1)
    for _ in range(40):
        np.testing.assert_array_equal(np.ravel(second), np.asarray(seen(np.ravel(first)), np.float32))
        action = one.action_space.sample()
        first, *rest, _ = one.step(action)
        second, *others, _ = other.step(done(action))
        assert rest == others
        if any(rest[1:]):
            first = one.reset()[0]
            second = other.reset()[0]


@pytest.mark.parametrize(("task_id", "name"), DECLARED)
def test_every_return_is_kept(task_id: str, name: str) -> None:
    """Exact where the task has a model or a stand-in that is proved, of the same episodes elsewhere."""
    before = Results(task_of(task_id), 300)
    after = Results(twin_of(task_id, name), 300)
    finite = "LargestSum" not in task_id and "Parabola" not in task_id
    for which in ("optimal", "worst", "random", "expert") if finite else ("random", "expert"):
        one = getattr(before, which)
        other = getattr(after, which)
        assert one.status == other.status == ("exact" if finite else "estimated")
        assert other.value == pytest.approx(one.value, rel=1e-12)


@for_each(("task_id", "name"), DECLARED)
def test_all_shipped_symmetries_are_proved(task_id: str, name: str) -> None:
    task = task_of(task_id)
    symmetry = next(each for each in task.annotations.symmetries if each.name == name)
    assert verify_symmetry(task, symmetry).is_proved


# -- solutions that are written down ------------------------------------------------------------------------------


class Written:
    """A policy that reads places of the observation, as the page prints them."""

    def __init__(self, act: Callable[[Array], Any]) -> None:
        self.act = act

    def predict(self, observation: Any, *_: Any, **__: Any) -> tuple[Any, None]:
        if np.ndim(observation) == 1:
            return self.act(observation), None
        return np.array(list(map(self.act, observation))), None


UP, DOWN, LEFT, RIGHT, STAY = range(5)


def walk(dx: float, dy: float) -> int:
    for action, is_the_way in ((RIGHT, dx > 0), (UP, dy < 0), (LEFT, dx < 0), (DOWN, dy > 0)):
        if is_the_way:
            return action
    return STAY


def _swap(o: Array) -> Array:
    wrong = np.flatnonzero(o != np.sort(o))
    if not len(wrong):
        return np.array([0, 0])
    return np.array([wrong[0], np.argsort(o)[wrong[0]]])


def _follow(o: Array) -> Array:
    x, y, c2, c1, c0 = o
    x += 0.05
    return np.clip(np.array([c2 * x * x + c1 * x + c0 - y]), -1, 1)


SOLUTIONS: dict[str, Callable[[Array], Any]] = {
    "LargestSum": lambda o: int(o[: len(o) // 2].sum() > o[len(o) // 2 :].sum()),
    "NoisyObs": lambda o: walk(1 - o[0], 1 - o[1]),
    "Parabola": _follow,
    "ProcGoal": lambda o: walk(o[2] - o[0], o[3] - o[1]),
    "Sort": _swap,
}


@pytest.mark.parametrize(("task_id", "name"), ORIGINALS)
def test_what_solves_the_printed_task_fails_on_its_twin(task_id: str, name: str) -> None:
    policy = Written(SOLUTIONS[task_id.partition("/")[2].removesuffix("-v0")])
    assert score(task_of(task_id), policy, episodes=100).normalised >= 0.99
    assert score(twin_of(task_id, name), policy, episodes=100).normalised < 0.7
