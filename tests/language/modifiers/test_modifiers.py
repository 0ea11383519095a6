"""Modifiers: every entry of the table, on every DERAIL task that it applies to, and what it says it keeps."""

import pickle
from collections.abc import Mapping
from functools import cache
from itertools import pairwise, product
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
from tests.programs.test_trajectories import walk_together
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.for_each import for_each
from tests.shared.invariants import broken
from tests.shared.solved import returns
from tests.shared.sparse import sparse
from tests.shared.values import BACKENDS

SMALL: dict[str, dict[str, Any]] = {
    "Branching": {"L": 3, "B": 2}, "NoisyObs": {"L": 3, "M": 2}, "Sort": {"L": 3}, "LargestSum": {"L": 4},
    "ProcGoal": {"N": 2},
}  # fmt: skip
"""Parameters that keep exact models small."""
RISKY = "derail/RiskyPath-v0"
IDS = [each for each in task_ids() if each.startswith("derail/") and "Seals" not in each]
NEVER = {
    "relabelled": ("LargestSum", "NoisyObs", "Parabola", "ProcGoal", "Sort"),
    "permuted_actions": ("Parabola",),
    "symmetry": ("Branching", "EarlyTermNeg", "EarlyTermPos", "InitShiftExpert", "InitShiftLearner", "RiskyPath"),
}


@cache
def small(task_id: str) -> Task:
    name = task_id.partition("/")[2].partition("-")[0]
    task = taskspec.load(task_id)
    values = {}
    for parameter in task.parameters:
        if parameter.name in SMALL.get(name, {}):
            values[parameter.name] = SMALL[name][parameter.name]
    return taskspec.load(task_id, **values)


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


GIVEN: list[tuple[str, str]] = []
FINITE: list[tuple[str, str]] = []
REFUSED: list[tuple[str, str]] = []
for pair in product(IDS, MODIFIERS):
    task = modified(*pair)
    if task is None:
        REFUSED.append(pair)
        continue
    GIVEN.append(pair)
    if task.is_finite and small(pair[0]).is_finite:
        FINITE.append(pair)


def found(task_id: str, name: str) -> Task:
    task = modified(task_id, name)
    assert task is not None
    return task


def test_what_does_not_apply_is_what_needs_more_than_the_task_has() -> None:
    expected = [(task_id, "hidden") for task_id in IDS if len(small(task_id).observation.components) == 1]
    for modifier, names in NEVER.items():
        expected += [(f"derail/{name}-v0", modifier) for name in names]
    assert sorted(REFUSED) == sorted(expected)


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


APPLIED = [name for task_id, name in GIVEN if task_id == RISKY]


@for_each(("one", "other"), pairwise([*APPLIED, APPLIED[0]]))
def test_modifiers_stand_on_each_other(one: str, other: str) -> None:
    """Two neighbours of the table, either way round: a task of its own each time, and printed in order."""
    base = small(RISKY)
    tasks = []
    for names in ((one, other), (other, one)):
        order = [str(found(RISKY, name).modifiers[0]) for name in names]
        try:
            task = taskspec.modify(base, *order)
        except SpecError as error:  # a horizon stands under what depends on it, and labels are of what is finite
            assert error.codes == ["E720"]
            assert names[1] in ("horizon", "relabelled")
            continue
        assert not list(broken(task))
        assert [str(m) for m, _ in sentences(task)] == order
        walk_together(taskspec.make(task), 5, 20)
        tasks.append(task)
    assert len(set(tasks)) == len(tasks)


@pytest.mark.parametrize(("task_id", "name"), sparse(GIVEN, 3))
def test_generated_code_and_numpy_agree_with_the_reference_interpreter(task_id: str, name: str) -> None:
    walk_together(taskspec.make(found(task_id, name)), 11, 30)
    Agreement(found(task_id, name), "numpy", 3, "NextStep", one=ReferenceEnv, states=True).run(12)


@pytest.mark.parametrize("backend", ["numba", "jax"])
@pytest.mark.parametrize("name", sparse(MODIFIERS, 6))
def test_backends_agree(name: str, backend: Any) -> None:
    """On a task of the suite that a modifier applies to, RiskyPath if it may be, which draws; `-m slow` has them all."""
    pytest.importorskip(backend)
    task_id = RISKY
    if name not in APPLIED:
        task_id = next(task_id for task_id, modifier in GIVEN if modifier == name)
    Agreement(found(task_id, name), backend, 3, "SameStep", one=ReferenceEnv, states=True).run(12)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("task_id", "name"), GIVEN)
def test_backends_agree_on_every_task(task_id: str, name: str, backend: Any) -> None:
    Agreement(found(task_id, name), backend, 3, "NextStep", one=ReferenceEnv, states=True).run(20)


# -- what is kept -------------------------------------------------------------------------------------------------


def some_policy(task: Task, seed: int) -> Any:
    """Actions from the components of the state before any modifier, and the time: a fixed but arbitrary function of both."""

    def choose(state: Mapping[str, Any], t: int) -> Mapping[str, Any]:
        number = 31 * seed + 5 * t
        for i, c in enumerate(task.state):
            elements = np.asarray(state[c.name], np.int64).reshape(c.type.size, -1)
            number = number + 7919 * 17 * (i + 3) * elements.sum(axis=0)
        chosen = {}
        for c in task.action:
            low = np.array(c.low, np.int64)[:, None]
            counts = np.array(c.counts)[:, None]
            elements = low + (number + np.arange(c.type.size)[:, None]) % counts
            chosen[c.name] = elements.reshape(*c.type.shape, -1)
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
            assert returns(results(task)) == pytest.approx(returns(results(before)), rel=1e-9, abs=1e-9)
            for seed in range(3):
                policy = some_policy(before, seed)
                one = score(before, policy).value
                other = score(task, policy).value
                assert one.exact and other.exact
                assert other.value == pytest.approx(one.value, rel=1e-9, abs=1e-9)
        case "all returns":
            assert returns(results(task)) == pytest.approx(returns(results(before)), rel=1e-9, abs=1e-9)
        case "best policies":
            for one, other in ((task, before), (before, task)):
                assert score(other, best_actions(one)).value.value == pytest.approx(
                    returns(results(other))[0], abs=1e-9
                )
        case "nothing":
            pass


OBSERVED = {
    "relabelled=2", "distractors=2", "permuted_actions=2", "symmetry=turned", "delay=2", "reward_at_end", "reward_noise=1",
    "absorbing",
}  # fmt: skip


def test_each_modifier_that_keeps_returns_is_tried_on_what_observers_earn() -> None:
    names = {written.partition("=")[0] for written in OBSERVED}
    for name, entry in MODIFIERS.items():
        assert (name in names) == (entry.observed is not never), name


def best_actions(task: Task) -> Any:
    """An optimal policy (T, S, A) of the exact model."""
    model = results(task).model
    assert model is not None
    plan = optimal_plan(model)
    steps = []
    for t in range(task.horizon or 1):
        best = plan(t).argmax(axis=0)
        steps.append(np.eye(model.n_actions)[best])
    return np.stack(steps)


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


def has_same_episodes(name: str) -> bool:
    return name != "absorbing" and MODIFIERS[name].keeps in ("every policy's return", "best policies")


@for_each(("task_id", "name"), [pair for pair in GIVEN if has_same_episodes(pair[1])])
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
        for component, value in one.state.items():
            assert np.array_equal(other.state[component], value)
        if over or out:
            one.reset()
            other.reset()
