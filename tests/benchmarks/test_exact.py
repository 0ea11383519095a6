"""Compiled sweeps equal the plain ones, and the benchmark of exact values agrees with plain loops."""

from __future__ import annotations

import numpy as np
import pytest

from taskspec import exact
from taskspec.exact.model import extract as extraction
from taskspec.exact.solve import infinite_horizon, solve
from taskspec.exact.solve.bounded import Bounded
from taskspec.language import source
from taskspec.language.registry import load
from taskspec.language.task.build import build
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task
from tests.benchmarks import exact as benchmark
from tests.shared.solved import worst
from tests.shared.specs import spec_file
from tests.shared.tasks import shipped


@pytest.mark.parametrize("tidy", [0, 10**9])
@pytest.mark.parametrize("largest", [True, False])
def test_compiled_sweeps_equal_the_plain_ones(monkeypatch: pytest.MonkeyPatch, tidy: int, largest: bool) -> None:
    kernels = pytest.importorskip("taskspec.exact.solve.kernels_numba")
    monkeypatch.setattr(extraction, "TIDY", tidy)
    for task in (
        benchmark.to_corner(70, 100).task,
        with_all_actions(build(source.read_file(spec_file("taxi")))),  # compiled sweeps know no masks
        shipped("risky_path"),
    ):
        model = exact.extract(task)
        found = kernels.extreme_values(Bounded(model), largest)
        plain = (solve.best if largest else worst)(model)
        assert (np.abs(found.value - plain.value) <= found.error + plain.error).all()
        np.testing.assert_allclose(found.value, plain.value, atol=1e-12)
        np.testing.assert_allclose(plain.error, found.error, rtol=1e-6)
        assert (found.error <= 1e-9).all()
        first = np.flatnonzero(model.start)
        needed = kernels.extreme_values(Bounded(model), largest, at_start=True)
        assert needed.value[first].tolist() == found.value[first].tolist()
        assert (needed.error[first] <= found.error[first] * (1 + 1e-12)).all()


@pytest.mark.parametrize(
    "task",
    [
        benchmark.lasting(62, "discount").task,
        benchmark.lasting(62, "chance").task,
        load("textbook/Gambler-v0", p=0.45, start=37),  # with legal actions; steps end differently often
        load("textbook/CarRental-v0"),  # all states pay
    ],
    ids=lambda task: task.name,
)
def test_compiled_values_without_a_horizon_equal_the_plain_ones(monkeypatch: pytest.MonkeyPatch, task: Task) -> None:
    pytest.importorskip("numba")
    found = []
    for least in (0, 10**9):
        monkeypatch.setattr(infinite_horizon, "COMPILED", least)
        monkeypatch.setattr(infinite_horizon, "DIRECT", min(least, infinite_horizon.DIRECT))
        value = solve.Solvers(exact.extract(task)).in_floats.best()
        assert 0 < value.low <= value.high <= value.low * (1 + 1e-9)
        found.append(value)
    compiled, plain = found
    assert compiled.low <= plain.high and plain.low <= compiled.high


def test_the_benchmark_agrees_with_plain_loops_and_counts_the_states_that_are_built() -> None:
    """Episodes of 20 steps enter few of 12,100 cells; those of a smaller grid are all taken."""
    large = benchmark.from_middle(110, 20)
    small = benchmark.to_corner(45, 90)
    plans = [
        (large, (benchmark.ours, benchmark.storm, benchmark.declared)),
        (small, (benchmark.ours, benchmark.storm, benchmark.loops)),
        (benchmark.lasting(30, "chance"), (benchmark.ours, benchmark.storm)),
    ]
    found = benchmark.run(plans, repeat=1, apart=False)
    value = next(t.value for t in found if t.name == "plain Python")
    assert 0 < value < 1
    assert all(t.value == pytest.approx(value, abs=1e-9) for t in found if t.grid == small)
    near = sum(abs(x) + abs(y) <= 20 for x in range(-20, 21) for y in range(-20, 21))
    states = [(t.grid.n, t.name, t.states) for t in found if t.name != "Storm"]
    assert states == [
        (110, "taskspec", near),
        (110, "taskspec, all states", 110 * 110),
        (45, "taskspec", 45 * 45),
        (45, "plain Python", 45 * 45),
        (30, "taskspec", 30 * 30),
    ]
    text = benchmark.table(found)
    assert f"{near:,}" in text and f"{45 * 45:,}" in text and "plain Python" in text
    assert benchmark.record(found)[0]["total"] == found[0].total
