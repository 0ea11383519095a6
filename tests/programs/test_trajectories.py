"""The generated step against the reference interpreter: every task, random parameters within their bounds, random seeds."""

import copy
import pickle
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.language.source import read_file
from taskspec.language.task.merge import complete
from taskspec.language.task.parts import FINITE_SPACES
from taskspec.language.task.task import Task
from tests.shared.conformance import ReferenceEnv
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse
from tests.shared.specs import paper_ids, varied_files

VARIED: list[tuple[str, str | None]] = []
for path in varied_files():
    VARIED += product([str(path)], complete(read_file(path)))
EVERY = [*product(paper_ids(), [None]), *VARIED]
SMALL = {"B": 12, "L": 8, "S": 6, "K": 4, "N": 8, "D": 6}  # keeps random parameters quick to enumerate and draw


def name(case: tuple[str, str | None]) -> str:
    path, variant = case
    if path.endswith("yaml"):
        path = Path(path).stem
    return f"{path}-{variant}" if variant else path


def load(case: tuple[str, str | None], **parameters: Any) -> Task:
    path, variant = case
    return taskspec.load(path, variant, **parameters)


@st.composite
def parameters(draw: st.DrawFn, task: Task) -> dict[str, Any]:
    """Values within the declared bounds, moderate where bounds are far away."""
    values: dict[str, Any] = {}
    for p in task.parameters:
        if p.kind == "choice":
            values[p.name] = draw(st.sampled_from(p.values or ()))
        elif p.kind == "bool":
            values[p.name] = draw(st.booleans())
        elif p.kind == "int":
            low = int(p.low if p.low is not None else 0)
            high = min(p.high or 1e9, SMALL.get(p.name, 30))
            values[p.name] = draw(st.integers(low, max(low, int(high))))
        else:
            low = p.low if p.low is not None else -2.0
            high = p.high if p.high is not None else 2.0
            values[p.name] = draw(st.floats(low, max(low, min(high, 1e3)), allow_nan=False))
    return values


def same(a: Any, b: Any) -> bool:
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return np.array_equal(a, b, equal_nan=True) and type(a) is type(b)


def walk_together(env: Any, seed: int, steps: int) -> None:
    """Step an environment and the reference interpreter with the same actions, and compare everything to the bit."""
    reference = ReferenceEnv(env.task)
    env.action_space.seed(seed % 2**32)
    observation, info = env.reset(seed=seed)
    assert same((observation, info), reference.reset(seed=seed))
    for _ in range(steps):
        action = env.action_space.sample()
        result = env.step(action)
        observation, reward, terminated, truncated, _ = result
        assert same(result, reference.step(action))
        assert isinstance(reward, float)
        assert env.observation_space.contains(observation) or not np.all(np.isfinite(observation))
        if terminated or truncated:
            assert same(env.reset(), reference.reset())


@for_each("case", VARIED)  # shipped ones in tests/envs/test_shipped.py
def test_defaults(case: tuple[str, str | None]) -> None:
    walk_together(taskspec.make(load(case)), 2**63 + 12_345, 30)


@pytest.mark.parametrize("case", sparse(zip(EVERY, strict=True), 9), ids=name)
@settings(max_examples=4, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_random_parameters(case: tuple[str, str | None], data: st.DataObject) -> None:
    values = data.draw(parameters(load(case)))
    try:
        task = load(case, **values)
    except SpecError as error:
        assert set(error.codes) <= {"E704"}, error  # only a declared requirement may refuse
        return
    walk_together(taskspec.make(task), data.draw(st.integers(0, 2**64 - 1)), 25)


@for_each(("case", "observe_time", "ending"), list(product(EVERY[::4], [False, True], ["terminate", "absorb"])))
def test_compile_options(case: tuple[str, str | None], observe_time: bool, ending: str) -> None:
    task = load(case)
    if ending == "absorb":
        task = taskspec.modify(task, "absorbing")
    if observe_time and task.horizon is None and task.observation.space in FINITE_SPACES:
        with pytest.raises(SpecError, match="E720"):  # an endless clock fits into no finite space
            taskspec.modify(task, "time_observed")
        return
    if observe_time:
        task = taskspec.modify(task, "time_observed")
    walk_together(taskspec.make(task), 7, 40)


@for_each("case", EVERY)
def test_copies_go_on_alike(case: tuple[str, str | None]) -> None:
    env = taskspec.make(load(case))
    env.reset(seed=5)
    alive = True
    for _ in range(7):
        if not alive:
            env.reset()
        alive = not any(env.step(env.action_space.sample())[2:4])
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    if not alive:
        first = env.reset()[0]
        for other in copies:
            assert same(other.reset()[0], first)
    for _ in range(20):
        action = env.action_space.sample()
        result = env.step(action)
        for other in copies:
            observation, *rest = other.step(action)
            assert same(observation, result[0])
            assert np.array_equal(rest[0], result[1], equal_nan=True)
            assert rest[1:3] == list(result[2:4])
            assert same(rest[3], result[4])
        if result[2] or result[3]:
            first = env.reset()[0]
            for other in copies:
                assert same(other.reset()[0], first)
