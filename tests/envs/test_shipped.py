"""Every shipped task, made by its id as users make it: on each backend it does what the reference interpreter does."""

import warnings
from typing import Any

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.language.expressions.ir import walk
from taskspec.language.expressions.types import total_size
from taskspec.language.task.parts import Parameter
from taskspec.language.task.task import Task
from tests.conftest import VECTORS, needs_vectors
from tests.programs.test_trajectories import walk_together
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse

IDS = taskspec.task_ids()
FAR = 40
"""How far from its default an int without an end is taken."""
WORK = 20_000
"""Numbers that the interpreter works out for each instance, about."""
REFUSED = {"E314", "E703", "E704"}
"""Values that a spec does not allow together, or that exceed a limit."""


def ends_of(parameter: Parameter) -> list[Any]:
    """The values of a parameter at the ends of its declared range, but for its default."""
    p = parameter
    if p.kind in ("bool", "choice"):
        ends = list(p.values or (False, True))
    else:
        ends = [end for end in (p.low, p.high) if end is not None]
        if p.kind == "int" and p.high is None:
            ends.append(p.default + FAR)
    return [end for end in ends if end != p.default]


def at_ends(task_id: str) -> list[Task]:
    """The instances with one parameter at an end of its range."""
    found = []
    for parameter in taskspec.load(task_id).parameters:
        for value in ends_of(parameter):
            try:
                found.append(taskspec.load(task_id, **{parameter.name: value}))
            except SpecError as error:
                assert set(error.codes) <= REFUSED, error
    return found


def run_compiled(task: Task, backend: str, lanes: int, most: int) -> None:
    """Compare a compiled program with the interpreter; large tasks may be refused, with the seconds that they would take."""
    try:
        Agreement(task.instance_id, backend, lanes, "NextStep", one=ReferenceEnv, states=True).run(steps_of(task, most))
    except SpecError as error:
        assert "seconds to compile this task" in str(error), error


def steps_of(task: Task, most: int) -> int:
    return max(2, min(most, WORK // total_size(walk(task.roots))))


@for_each("task_id", IDS)
def test_scalar_and_numpy_at_its_defaults(task_id: str) -> None:
    task = taskspec.load(task_id)
    walk_together(taskspec.make(task_id), 3, steps_of(task, 30))
    walk_together(gymnasium.make(task_id), 2**63 + 5, steps_of(task, 8))
    if VECTORS:
        Agreement(task_id, "numpy", 3, "NextStep", one=ReferenceEnv, states=True).run(steps_of(task, 12))


@pytest.mark.parametrize("task_id", sparse(IDS, 4))
def test_scalar_and_numpy_at_the_ends_of_each_parameter(task_id: str) -> None:
    for task in at_ends(task_id):
        walk_together(taskspec.make(task.instance_id), 11, steps_of(task, 10))
        if VECTORS:
            Agreement(task.instance_id, "numpy", 2, "NextStep", one=ReferenceEnv, states=True).run(steps_of(task, 8))


@needs_vectors()
@pytest.mark.parametrize("task_id", sparse(IDS, 36))
@pytest.mark.parametrize("backend", ["numba", "jax"])
def test_compiled_backends(backend: str, task_id: str) -> None:
    pytest.importorskip(backend)
    run_compiled(taskspec.load(task_id), backend, 3, 10)


@needs_vectors()
@pytest.mark.slow
@pytest.mark.parametrize("task_id", IDS)
@pytest.mark.parametrize("backend", ["numba", "jax"])
def test_compiled_backends_at_the_ends_of_each_parameter(backend: str, task_id: str) -> None:
    pytest.importorskip(backend)
    for task in at_ends(task_id):
        run_compiled(task, backend, 2, 6)


ONE_STEP = "truncates after 1 step"
UNBOUNDED = "value is -?infinity"
NOT_ACCEPTED = {
    "bsuite/CartPole-v0": UNBOUNDED,
    "bsuite/CartPoleSwingUp-v0": UNBOUNDED,
    "bsuite/MemoryLength-v0": "maximum and minimum values are equal",  # an observation of bsuite that is always 0
    "bsuite/MountainCar-v0": UNBOUNDED,
    "classic_control/CartPole-v0": UNBOUNDED,
    "classic_control/Pendulum-v0": "symmetric and normalized space",  # torques, as Gymnasium's own has them
    "derail/LargestSumSeals-v0": ONE_STEP,  # as seals does
    "derail/NoisyObsSeals-v0": UNBOUNDED,
    "derail/ProcGoalSeals-v0": UNBOUNDED,
    "probes/LookAlikes-v0": ONE_STEP,
    "probes/Votes-v0": ONE_STEP,
    "safety/OffSwitch-v0": ONE_STEP,
    "textbook/ContextualBandit-v0": ONE_STEP,
    "textbook/DriftingBandit-v0": UNBOUNDED,
}
"""What Gymnasium's checker says of tasks that it does not accept: episodes of one step, and spaces like those of originals."""


@for_each("task_id", IDS)
def test_gymnasium_accepts_the_environment(task_id: str) -> None:
    expected = NOT_ACCEPTED.get(task_id)
    if task_id.startswith("seals/"):
        expected = UNBOUNDED
    env = gymnasium.make(task_id)
    assert env is env.unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if expected is None:
            check_env(env, skip_render_check=True)
            return
        with pytest.raises((AssertionError, UserWarning), match=expected):
            check_env(env, skip_render_check=True)
