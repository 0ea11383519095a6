"""Benchmarks: how rates are taken, what there is to measure, how starts and memory are found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import TaskspecError
from taskspec.envs.vector import VectorEnvironment
from taskspec.learn.experiments.speed import scalar
from taskspec.programs.backend_table import PROGRAMS
from tests.benchmarks import chart, peers, tables
from tests.benchmarks.limit import bytes_of_step, copying
from tests.benchmarks.race import clock_for, jax_device, ours, race, spread
from tests.benchmarks.starts import memory, start_times
from tests.shared.sparse import sparse
from tests.shared.specs import spec_file

ROOT = Path(__file__).parents[2]
SLOW_TO_MEASURE = [("NoisyObs", "numpy"), *((name, b) for name in ("RiskyPath", "NoisyObs") for b in ("numba", "jax"))]
"""Memory is that of whole processes, and these take ten seconds and more to start and to compile."""
NEEDS = {"scalar": (), "numpy": (), "numba": ("numba",), "jax": ("jax",), "jax-scan": ("jax",)}


def needed(program: str) -> None:
    for package in NEEDS[program]:
        pytest.importorskip(package)


# -- rates --------------------------------------------------------------------------------------------------------


class Machine:
    """A clock that only drives move, and drives that take as long as they are said to."""

    def __init__(self) -> None:
        self.now = 0.0
        self.order = ""

    def drive(self, name: str, steps: int, seconds: float) -> Callable[[], int]:
        def drive() -> int:
            self.now += seconds
            self.order += name
            return steps

        return drive


@pytest.mark.parametrize("rounds", [1, 4])
def test_rates_are_steps_over_the_time_of_a_clock_and_sides_take_turns(rounds: int) -> None:
    machine = Machine()
    ticks = []
    drives = [machine.drive("a", 10, 0.25), machine.drive("b", 6, 0.5)]
    found = race(drives, rounds, 1.0, lambda: machine.now, lambda: ticks.append(1))
    assert found == [(40.0,) * rounds, (12.0,) * rounds]
    assert machine.order.endswith("aaaabb" * rounds)
    assert len(ticks) == rounds


@pytest.mark.parametrize("seconds", [1e-4, 1e-3, 0.05, 3.0])
def test_a_measurement_takes_about_as_long_as_it_should_however_fast_the_drive_is(seconds: float) -> None:
    machine = Machine()
    drive = machine.drive("", 1, seconds)
    race([drive], 0, 1.0, lambda: machine.now)
    calibration = machine.now
    race([drive], 1, 1.0, lambda: machine.now)
    assert machine.now - 2 * calibration == pytest.approx(max(1.0, seconds), rel=0.05)


def test_spread_is_half_the_distance_of_the_quartiles_over_the_median() -> None:
    values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    low, high = np.quantile(values, [0.25, 0.75], method="weibull")
    assert spread(values) == pytest.approx((high - low) / 2 / 4)
    assert spread([3.0]) is None


@pytest.mark.parametrize("program", NEEDS)
@pytest.mark.parametrize(
    "task", sparse(["Parabola", "Branching", spec_file("lights_out"), spec_file("lqr")], 2), ids=str
)
def test_every_program_steps_lanes(program: str, task: Any) -> None:
    needed(program)
    lanes = 1 if program == "scalar" else 5
    drive = ours(taskspec.load(task), program, lanes).make()
    steps = drive()
    assert steps > 0 and steps % lanes == 0
    assert drive() == steps


def test_a_scalar_drive_takes_the_steps_that_it_counts() -> None:
    taken = []

    class Counted(gymnasium.Wrapper[Any, Any, Any, Any]):
        def step(self, action: Any) -> Any:
            taken.append(action)
            return super().step(action)

    steps = scalar(Counted(taskspec.make("RiskyPath")))()
    assert steps == len(taken)


@pytest.mark.parametrize(
    ("task", "moved"),
    [
        ("RiskyPath", 8 + 8 + 8 + 2 + 2 * (8 + 8)),  # action, observation, reward, two flags; state and time in and out
        (spec_file("cart_pole"), 8 + 4 * 4 + 8 + 2 + 2 * (4 * 8 + 8)),
    ],
    ids=str,
)
def test_the_limit_of_many_environments_is_a_copy_of_what_a_step_moves(task: Any, moved: int) -> None:
    assert bytes_of_step(taskspec.load(task)) == moved
    copy = copying(1600)
    source, target = copy.args[::-1]
    copy()
    assert source.nbytes + target.nbytes == 1600 and (source == target).all()


def test_clocks_count_the_time_of_the_processor_unless_several_things_work_at_once() -> None:
    assert [clock_for(*x)[0] for x in ((None, 1), ("cpu", 1), ("cpu", 2), ("gpu", 1))] == [
        "processor", "processor", "wall", "wall",
    ]  # fmt: skip
    assert jax_device(["numpy", "gymnax"]) is None


# -- what there is to measure -------------------------------------------------------------------------------------


def test_names_of_programs_are_those_of_the_help() -> None:
    assert tuple(NEEDS) == PROGRAMS
    assert set(PROGRAMS) < set(chart.MARKS)


def test_pairs_cover_every_task_of_the_suite() -> None:
    twins = {entry.name for entry in taskspec.language.registry.shipped().values() if entry.name.endswith("Seals")}
    assert {pair.ours for pair in tables.PAIRS} == twins


def test_the_own_table_has_a_group_for_each_task_and_its_targets() -> None:
    groups = tables.own()
    assert [{c.task for c in group} for group in groups] == [{name} for name in tables.SUITE]
    aimed = {(c.task, c.program, c.lanes): c.target for group in groups for c in group if c.target}
    assert aimed[("RiskyPath", "numpy", 1024)] == tables.TARGETS["numpy", 1024]["tabular"]
    assert not any(task == "LargestSum" for task, _, _ in aimed)
    assert tables.target_of(taskspec.load("Branching"), "numpy", 1024) == tables.TARGETS["numpy", 1024]["tabular"]
    assert tables.target_of(taskspec.load("Branching", L=20), "numpy", 1024) is None
    assert tables.target_of(taskspec.load("Branching"), "numpy", 1023) is None


def test_whoever_has_the_same_task_is_compared_with_a_program_that_runs_beside_it() -> None:
    for group in tables.games():
        ours = {(c.program, c.lanes) for c in group if c.rival is None}
        assert all((c.rival, c.lanes) in ours or ("numpy", c.lanes) in ours for c in group if c.rival)


PEERS = {
    "gymnasium": lambda: peers.gymnasium_cart_pole(3),
    "envpool": lambda: peers.envpool_cart_pole(3),
    "seals": lambda: peers.seals_sync("seals/Parabola-v0", "Parabola", 3),
    "gymnax": lambda: peers.gymnax("UmbrellaChain-bsuite", "Umbrella", 3, {"n_distractor": 4}, {"chain_length": 9}),
}


@pytest.mark.parametrize("package", PEERS)
def test_others_step_as_many_lanes(package: str) -> None:
    pytest.importorskip(package)
    found = PEERS[package]()
    assert found.lanes == 3
    steps = found.make()()
    assert steps > 0 and steps % 3 == 0


# -- starting, and memory -----------------------------------------------------------------------------------------


def test_a_process_that_takes_no_step_is_reported() -> None:
    with pytest.raises(TaskspecError, match="E713"):
        start_times(taskspec.load("RiskyPath"), "abacus", 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "backend"),
    [("RiskyPath", "numpy"), *(pytest.param(*each, marks=pytest.mark.slow) for each in SLOW_TO_MEASURE)],
)
def test_memory_is_that_of_the_arrays_and_of_what_goes_with_them(name: str, backend: str) -> None:
    needed(backend)
    task = taskspec.load(name)
    lanes = 20_000
    arrays = VectorEnvironment(task, lanes, backend=backend, autoreset_mode="SameStep").nbytes
    found = memory(task, backend, lanes)
    assert arrays < found.bytes < 5 * arrays
    assert memory(task, backend, 2 * lanes).per_lane == pytest.approx(found.per_lane, rel=0.5)
