"""Whatever takes a task takes its id or the path of its spec as well, and what needs an extra says which."""

import numpy as np

import taskspec


def test_a_task_is_loaded_with_other_parameters_and_keeps_its_conventions() -> None:
    task = taskspec.load("derail/Branching-v0", L=4, B=3)
    assert taskspec.load(task, L=5) == taskspec.load("derail/Branching-v0", L=5, B=3)
    changes = ("absorbing", "sticky=0.25", "time_observed")
    changed = taskspec.load(task, modifiers=changes)
    assert taskspec.load(changed, L=5) == taskspec.modify(taskspec.load(task, L=5), *changes) != changed
    assert taskspec.load(task, "seals") == taskspec.load("derail/BranchingSeals-v0")
    assert taskspec.make(task, L=5).task.values == {"L": 5, "B": 3}


def test_the_first_observations_of_a_task_are_those_of_its_id() -> None:
    one = taskspec.make(taskspec.load("Sort", L=3))
    other = taskspec.make("Sort", L=3)
    assert np.array_equal(one.reset(seed=4)[0], other.reset(seed=4)[0])
