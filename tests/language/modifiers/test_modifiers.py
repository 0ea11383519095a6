"""Modifiers: every entry of the table, on every DERAIL task that it applies to, and what it says it keeps."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.exact import Results, score, soundness
from taskspec.exact.solve.plans import optimal_plan
from taskspec.language.modifiers import MODIFIERS, sentences
from taskspec.language.modifiers.entry import never
from taskspec.language.registry import task_ids
from taskspec.language.task.task import Task
from taskspec.programs.backend_table import BACKENDS
from tests.programs.test_trajectories import walk_together
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.for_each import for_each
from tests.shared.invariants import broken
from tests.shared.sparse import sparse

SMALL: dict[str, dict[str, Any]] = {
    "Branching": {"L": 3, "B": 2}, "NoisyObs": {"L": 3, "M": 2}, "Sort": {"L": 3}, "LargestSum": {"L": 4},
    "ProcGoal": {"N": 2},
}  # fmt: skip
"""Parameters that keep exact models small."""
IDS = [each for each in task_ids() if each.startswith("derail/") and "Seals" not in each]
NEVER = {
    ("LargestSum", "relabelled"), ("NoisyObs", "relabelled"), ("Parabola", "relabelled"), ("Sort", "relabelled"),
    ("ProcGoal", "relabelled"), ("Parabola", "permuted_actions"),
    ("Branching", "symmetry"), ("EarlyTermPos", "symmetry"), ("EarlyTermNeg", "symmetry"), ("InitShiftExpert", "symmetry"),
    ("InitShiftLearner", "symmetry"), ("RiskyPath", "symmetry"),
}  # fmt: skip


@cache
def small(task_id: str) -> Task:
    name = task_id.partition("/")[2].partition("-")[0]
    task = taskspec.load(task_id)
    known = {p.name for p in task.parameters}
    return taskspec.load(task_id, **{k: v for k, v in SMALL.get(name, {}).items() if k in known})


@cache
def modified(task_id: str, name: str) -> Task | None:
    """The task with a modifier, or None where it does not apply."""
    task = small(task_id)
    try:
        return taskspec.modify(task, {name: MODIFIERS[name].sample(task)})
    except SpecError as error:
        assert error.codes == ["E720"], error
        return None


@cache
def results(task: Task) -> Results:
    return Results(task)


PAIRS = [(task_id, name) for task_id in IDS for name in MODIFIERS]
GIVEN = [pair for pair in PAIRS if modified(*pair) is not None]
FINITE = [
    pair for pair in GIVEN if small(pair[0]).is_finite and (m := modified(*pair)) is not None and m.is_finite
]  # fmt: skip


def found(task_id: str, name: str) -> Task:
    task = modified(task_id, name)
    assert task is not None
    return task


def test_what_does_not_apply_is_what_needs_more_than_the_task_has() -> None:
    refused = {(i.partition("/")[2].removesuffix("-v0"), name) for i, name in PAIRS if (i, name) not in GIVEN}
    alone = {name for name, which in refused if which == "hidden"}
    assert {pair for pair in refused if pair[1] != "hidden"} == NEVER
    assert alone == {
        each.name for each in map(small, IDS) if len(each.observation.components) == 1
    }  # what is seen is one component


# -- one task, everywhere alike -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("task_id", "name"), sparse(GIVEN, 3))
def test_a_modified_task_is_a_task(task_id: str, name: str) -> None:
    """It keeps the rules of tasks, is sound, prints its modifier, travels, and is another than the task as written."""
    task = found(task_id, name)
    assert not list(broken(task))
    assert not soundness(task)
    assert str(task.modifiers[0]) in repr(task)
    assert taskspec.modify(small(task_id), str(task.modifiers[0])) == task
    assert pickle.loads(pickle.dumps(task)) == task != small(task_id)
    assert task.content_hash != small(task_id).content_hash
    assert task.unmodified is small(task_id)


@for_each(("one", "other"), list(pairwise([*MODIFIERS, *list(MODIFIERS)[:1]])))
def test_modifiers_stand_on_each_other(one: str, other: str) -> None:
    """Two neighbours of the table, either way round: a task of its own each time, and printed in order."""
    base = small("derail/RiskyPath-v0")
    orders = [
        [str(m.modifiers[0]) for m in (modified("derail/RiskyPath-v0", n) for n in names) if m is not None]
        for names in ((one, other), (other, one))
    ]
    tasks = []
    for order in orders:
        try:
            tasks.append(taskspec.modify(base, *order))
        except SpecError as error:  # a horizon stands under what depends on it, and labels are of what is finite
            assert error.codes == ["E720"]
            assert order[1].partition("=")[0] in ("horizon", "relabelled")
            continue
        assert not list(broken(tasks[-1]))
        assert [str(m) for m, _ in sentences(tasks[-1])] == order
        walk_together(taskspec.make(tasks[-1]), 5, 20)
    assert len(set(tasks)) == len({tuple(order) for order in orders[: len(tasks)]})


@pytest.mark.parametrize(("task_id", "name"), sparse(GIVEN, 3))
def test_generated_code_and_numpy_agree_with_the_reference_interpreter(task_id: str, name: str) -> None:
    walk_together(taskspec.make(found(task_id, name)), 11, 30)
    Agreement(found(task_id, name), "numpy", 3, "NextStep", one=ReferenceEnv, states=True).run(12)


@pytest.mark.parametrize("backend", [b for b in ("numba", "jax") if find_spec(b)])
@pytest.mark.parametrize("name", sparse(MODIFIERS, 6))
def test_backends_agree(name: str, backend: Any) -> None:
    """On a task of the suite that a modifier applies to, RiskyPath if it may be, which draws; `-m slow` has them all."""
    task_id = next(each for each in sorted(IDS, key=lambda i: "RiskyPath" not in i) if modified(each, name) is not None)
    Agreement(found(task_id, name), backend, 3, "SameStep", one=ReferenceEnv, states=True).run(12)


@pytest.mark.slow
@pytest.mark.parametrize("backend", [b for b in BACKENDS if b != "auto"])
@pytest.mark.parametrize(("task_id", "name"), GIVEN)
def test_backends_agree_on_every_task(task_id: str, name: str, backend: Any) -> None:
    Agreement(found(task_id, name), backend, 3, "NextStep", one=ReferenceEnv, states=True).run(20)


# -- what is kept -------------------------------------------------------------------------------------------------


def returns(task: Task) -> tuple[float, float, float]:
    known = results(task)
    values = (known.optimal, known.random, known.worst)
    assert all(v is not None and v.exact for v in values)
    return tuple(v.value for v in values if v is not None)  # type: ignore[return-value]


def some_policy(task: Task, seed: int) -> Any:
    """Actions from what the state was before any modifier, and the time: a fixed but arbitrary function of both."""
    names = [c.name for c in task.state]

    def choose(state: Mapping[str, Any], t: int) -> Mapping[str, Any]:
        number = sum((i + 3) * 17 * np.asarray(state[n], np.int64).reshape(-1, np.shape(state[n])[-1]).sum(0)
                     for i, n in enumerate(names))  # fmt: skip
        chosen = {}
        for c in task.action:
            rows = [int(low) + (number * 7919 + 31 * seed + 5 * t + k) % n
                    for k, (low, n) in enumerate(zip(c.low, c.counts, strict=True))]  # fmt: skip
            chosen[c.name] = np.stack(rows).reshape(*c.type.shape, -1) if c.type.shape else rows[0]
        return chosen

    return choose


@pytest.mark.parametrize(("task_id", "name"), sparse(FINITE, 3))
def test_what_a_modifier_says_it_keeps_is_kept(task_id: str, name: str) -> None:
    task = found(task_id, name)
    before = small(task_id)
    entry = MODIFIERS[name]
    assert results(task).model is not None, results(task).why_not
    match entry.kept(before, entry.sample(before)):
        case "every policy's return":
            assert returns(task) == pytest.approx(returns(before), rel=1e-9, abs=1e-9)
            for seed in range(3):
                policy = some_policy(before, seed)
                one, other = (score(t, policy).value for t in (before, task))
                assert one.exact and other.exact
                assert other.value == pytest.approx(one.value, rel=1e-9, abs=1e-9)
        case "all returns":
            assert returns(task) == pytest.approx(returns(before), rel=1e-9, abs=1e-9)
        case "best policies":
            for one, other in ((task, before), (before, task)):
                assert score(other, best_actions(one)).value.value == pytest.approx(returns(other)[0], abs=1e-9)
        case "nothing":
            pass


OBSERVED = {
    "relabelled=2", "distractors=2", "permuted_actions=2", "symmetry=turned", "delay=2", "reward_at_end", "reward_noise=1",
    "absorbing",
}  # fmt: skip


def test_each_modifier_that_keeps_returns_is_tried_on_what_observers_earn() -> None:
    kept = {n for n, e in MODIFIERS.items() if e.observed is not never}
    assert kept == {written.partition("=")[0] for written in OBSERVED}


def best_actions(task: Task) -> Any:
    """An optimal policy (T, S, A) of the exact model."""
    model = results(task).model
    assert model is not None
    plan = optimal_plan(model)
    best = [plan(t).argmax(axis=0) for t in range(task.horizon or 1)]
    return np.stack([np.eye(model.n_actions)[each] for each in best])


@for_each(("task_id", "name"), FINITE)
def test_exact_models_agree_with_simulation(task_id: str, name: str) -> None:
    task = found(task_id, name)
    exact = results(task).random
    sample = Results(task, 400, seed=3).sample("random")
    assert exact is not None and sample is not None and exact.exact
    assert abs(exact.value - sample.value) <= 5 * sample.error + 1e-9


@for_each(("task_id", "name"), FINITE)
def test_an_expert_that_stays_earns_what_it_did(task_id: str, name: str) -> None:
    task = found(task_id, name)
    before = small(task_id)
    if isinstance(before.annotations.expert, tuple) and isinstance(task.annotations.expert, tuple):
        one = results(before)
        other = results(task)
        assert one.expert is not None and other.expert is not None
        if MODIFIERS[name].keeps in ("every policy's return", "all returns"):
            assert other.expert.value == pytest.approx(one.expert.value)


SAME_EPISODES = [
    n for n, e in MODIFIERS.items() if e.keeps in ("every policy's return", "best policies") and n != "absorbing"
]


@for_each(("task_id", "name"), [(task_id, name) for task_id, name in GIVEN if name in SAME_EPISODES])
def test_the_draws_of_the_task_stay_as_they_are(task_id: str, name: str) -> None:
    """Episodes with the same seed and actions go through the same states."""
    task = found(task_id, name)
    one = taskspec.make(small(task_id))
    other = taskspec.make(task)
    one.action_space.seed(1)
    one.reset(seed=4)
    other.reset(seed=4)
    for _ in range(25):
        action = one.action_space.sample()
        *_, over, out, _ = one.step(action)
        assert list(other.step(action)[2:4]) == [over, out]
        states = one.state
        assert all(np.array_equal(other.state[n], v) for n, v in states.items())
        if over or out:
            one.reset()
            other.reset()
